//! Robots in minimal coordinates, on the ground, in the air or bolted down: one, or several candidates for the same
//! robot side by side, each in a lane of the vector registers.
//!
//! Joint-space dynamics from the composite-rigid-body and the recursive Newton-Euler algorithm, factorised along the
//! tree (R. Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008, chapters 5, 6 and 8), with all spatial
//! quantities in the world's axes about one point, so that composite inertias are plain sums.
//!
//! A step is the implicit midpoint rule for servos, springs and dampers, with inertia, gravity and velocity forces
//! taken at the middle that the past predicts: second order. Joints so stiff that the rule would let them ring are
//! advanced by backward Euler instead. Motors at their bounds are found step by step. Dry friction, joint limits and
//! contacts are impulses within bounds. A contact is a spring and a damper that are solved for the step's end, and
//! Coulomb friction that holds; a hard floor is a stiff one.
#![allow(
    clippy::needless_range_loop,
    reason = "what an iterator calls may be left out of line, where it is compiled for narrow registers"
)]

mod build;
mod constraints;
mod contacts;
mod dynamics;
mod forward;
mod impulses;
mod joint_forces;
mod linear_algebra;
mod prescribed;
mod state;
mod step;
mod torque_bounds;
mod tree;

pub(crate) use build::{engine, engine_of_several, lanes, width, widths};
pub use forward::forward_dynamics;
