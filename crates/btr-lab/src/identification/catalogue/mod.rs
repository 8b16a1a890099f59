//! Everything that can be varied: free parameters, parameters of effects, sites, and the terms of laws.

pub(super) mod law_terms;
pub(super) mod parameters;
pub(super) mod sites;
