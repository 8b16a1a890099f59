//! Bounded impulses: dry friction in the joints, joint limits, contacts. The velocities at the step's end obey the
//! constraint laws (time stepping after J. J. Moreau). Impulses are solved in constraint space, either by projected
//! Gauss-Seidel (sweep.rs) or, where that converges slowly, by an active-set method (stick.rs).
//!
//! Candidates in one engine share their rows: a row exists if any candidate needs it, and has no impulse in the others.
//! Each candidate's sweeps end when its own velocities have converged.

mod assemble;
mod rows;
mod solve;
mod stick;
mod sweep;

pub(super) use rows::{BoundedRow, ContactLaw, Impulses};
