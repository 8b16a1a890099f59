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
mod run;
mod transfer;

pub use correction::LinearCorrection;
pub use disengage::Evidence;
pub use drift::{Change, Drift};
pub use estimation::abduction::{Abduction, Extension, FittedExtension, Suspect};
pub use estimation::posterior::{Belief, OpenDirection, Posterior};
pub use estimation::promise::RealityGap;
pub use estimation::{Estimated, Explanation};
pub use evaluate::{Cost, phi};
pub use history::{Augmentation, EstimateRecord, Generation, History, Iteration, Side, StopReason};
pub use ledger::{Entry, Ledger, TestVerdict};
pub use map::{MapError, MapPhase, Outlook, Promise};
pub use plan::{DisengagementRule, Initial, Memory, Method, Plan, PosteriorPhase, Rule, SearchPhase, Transfer};
pub use run::{Coevolution, Environment, PlanError, RunState, StepOutcome};
