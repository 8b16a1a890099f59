//! The Back-to-Reality loop (the paper's section 3.3), its baselines, and their common ledger of real tests.
//!
//! A run is a [`Coevolution`]: plain data that does one unit of work per [`step`](Coevolution::step) - a generation, a real
//! test, the end of an iteration - and can be written down and taken up again between any two steps. Random numbers belong
//! to (seed, step, iteration, generation), so that a resumed run continues bit for bit.

mod correction;
mod disengage;
mod drift;
mod estimation;
mod evaluate;
#[cfg(test)]
mod fixture;
mod history;
mod ledger;
mod map;
mod plan;
mod promise;
mod run;
mod transfer;

pub use correction::LinearCorrection;
pub use drift::{Change, Drift};
pub use estimation::{
    Abduction, Belief, Estimated, Explanation, Extension, FittedExtension, OpenDirection, Posterior, Suspect,
};
pub use evaluate::{Cost, phi};
pub use history::{Augmentation, EstimateRecord, Evidence, Generation, History, Iteration, Side, StopReason};
pub use ledger::{Entry, Ledger, Memory, TestVerdict};
pub use map::{MapError, MapPhase, Outlook, Promise};
pub use plan::{DisengagementRule, Initial, Method, Plan, PosteriorPhase, Rule, SearchPhase, Transfer};
pub use promise::RealityGap;
pub use run::{Coevolution, Environment, PlanError, RunState, StepOutcome};
