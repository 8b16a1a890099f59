//! Laws of mechanics that every simulation must obey, and properties of the engines on which they depend.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod accuracy;
mod actuation;
mod bounds;
mod contact;
mod determinism;
mod drive;
mod effects;
mod engines;
mod engines_free;
mod floor;
mod formula;
mod free;
mod friction;
mod joint;
mod limits;
mod linkage;
mod motor;
mod neighbours;
mod parameter;
mod placement;
mod prescribed;
mod sampled;
mod scene;
mod transmission;
