//! A run as a state machine: one file per step of the paper, one for the baseline without a simulation, one for maps of
//! controllers.

mod coevolution;
mod controllers;
mod fits;
mod map;
mod reality_only;
mod record;
mod simulators;
mod state;
mod step;
mod transfers;
mod uncertainty;
mod validate;

pub use coevolution::{Coevolution, Environment, StepOutcome};
pub use fits::StateError;
pub use state::RunState;
pub use validate::PlanError;
