//! Robots in contact with the ground: the noise floor of the model itself, and the size of changes that exceed it.

pub(super) mod noise_floor;
pub(super) mod probes;
