//! The Back-to-Reality loop (the paper's section 3.3), its baselines, and their common ledger of real tests.
//!
//! A run is a [`Coevolution`]: plain data that does one unit of work per [`step`](Coevolution::step) - a generation, a
//! real test, the end of an iteration - and can be saved and resumed between any two steps. A kill therefore costs at
//! most the step in progress and never a real test. Random numbers belong to (seed, step, iteration, generation), so
//! that a resumed run continues bit for bit.
//!
//! - [`Plan`]: all settings. [`Ledger`]: every real test, its prediction and its outcome. [`History`]: records of
//!   generations and iterations, with the [`Evidence`] on disengagement.
//! - [`Posterior`]: the belief about S, estimated by statistical linearisation of each test; [`Abduction`] asks which
//!   larger S explains tests that S does not.
//! - [`MapPhase`]: transfer by quality diversity. [`Drift`]: a robot that changes during the run.
//!
//! Inside searches costs are minimised; fitness is maximised wherever it is reported.

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
    Abduction, Belief, EstimateError, Estimated, Explanation, Extension, FittedExtension, OpenDirection, Posterior,
    Suspect,
};
pub use evaluate::{Cost, phi};
pub use history::{Augmentation, EstimateRecord, Evidence, Generation, History, Iteration, Side, StopReason};
pub use ledger::{Entry, Ledger, Memory, RecallError, TestVerdict};
pub use map::{MapError, MapPhase, Outlook, Promise};
pub use plan::{DisengagementRule, Initial, Method, Plan, PosteriorPhase, Rule, SearchPhase, Transfer};
pub use promise::RealityGap;
pub use run::{Coevolution, Environment, PlanError, RunState, StateError, StepOutcome};
