//! The operations of the command line and of Python on a model and its logs: check, compare, diagnose, fit, add
//! effects.

mod adds_to;
mod base_parameters;
mod check;
mod compare;
mod diagnose;
mod diagnose_report;
mod effects;
mod excitation;
mod fit;
mod held_out;
mod next_experiment;
mod stated_low;

pub use crate::identification::{
    Doubt, ErrorUnit, FitOptions, FittedGlitch, NoiseFloor, ProblemError, StartModel, VerbInput, doubts,
};
pub use crate::log_quality::in_common::{CommonFinding, in_common};
pub use crate::log_quality::repeats::{Drift, RepeatReport, RepeatedChannel, RepeatedRegime, RunOutlier};
pub use crate::model_text::{AddError, Addition, OwnLaw, OwnNumber, RemoveError, add, add_law, remove};
pub use adds_to::AddsTo;
pub use base_parameters::{BaseReport, PossibleBody, PossibleReport, base_parameters};
pub use check::{CheckReport, DeadTimeReport, IdentifiabilityReport, check};
pub use compare::{Cause, CauseKind, CompareReport, CompareVerdict, JointVerdict, compare, compare_pairs};
pub use diagnose::diagnose;
pub use diagnose_report::{CorrectedValue, DiagnoseReport, EffectReport, EffectSite, LawReport, Support, ValueReport};
pub use effects::{effects, named, site};
pub use fit::{FitReport, fit};
pub use held_out::{HeldOutLogs, JudgedLogs};
pub use next_experiment::{NextExperiment, RivalExplanation, next_experiment};
