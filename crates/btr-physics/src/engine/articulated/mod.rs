//! The default engine: robots in minimal coordinates, with a floating or a fixed base. It simulates one robot, or
//! several candidates for the same robot at once, each in a SIMD lane.
//!
//! Joint-space dynamics use the composite-rigid-body and the recursive Newton-Euler algorithm, with a factorisation
//! that exploits the tree's sparsity (R. Featherstone, "Rigid Body Dynamics Algorithms", Springer 2008, chapters 5, 6
//! and 8). All spatial quantities are in the world's axes about one point, so that composite inertias are plain sums.
//!
//! A step is the implicit midpoint rule for servos, springs and dampers; inertia, gravity and velocity-dependent forces
//! are evaluated at an extrapolated midpoint. This is second order. Joints so stiff that the midpoint rule would
//! oscillate are advanced by backward Euler instead. An active-set iteration within the step finds which motors are at
//! their bounds. Dry friction, joint limits and contacts are bounded impulses. A contact is a spring and a damper,
//! solved at the step's end, and Coulomb friction with sticking; a hard floor is a stiff spring.
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
