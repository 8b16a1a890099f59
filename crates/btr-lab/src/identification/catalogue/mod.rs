//! Everything that can be varied: free parameters, parameters of effects, sites, stated values, and the terms of laws.

pub(super) mod law_terms;
pub(super) mod parameters;
pub(super) mod sites;
pub(super) mod values;
