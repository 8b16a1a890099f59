//! Vector and matrix arithmetic on several candidates at once: scalars ([`Lanes`](lanes::Lanes)), 3-D vectors and
//! spatial quantities.

pub(super) mod lanes;
pub(super) mod spatial;
pub(super) mod vectors;
