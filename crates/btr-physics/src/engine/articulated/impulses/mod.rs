//! Impulses within bounds: dry friction in the joints, joint limits, contacts. Velocities at the step's end obey the
//! laws (time stepping after J. J. Moreau), and impulses are found on what each does to the others: one after the
//! other, sweep by sweep (sweep.rs), or, for whom that takes for ever, all at once (stick.rs).
//!
//! Candidates side by side share their rows: a row is there if any of them needs it, and pushes nothing where it is not
//! needed. Each candidate's sweeps end when its own velocities have settled.

mod assemble;
mod rows;
mod solve;
mod stick;
mod sweep;

pub(super) use rows::{ContactLaw, Impulses};
