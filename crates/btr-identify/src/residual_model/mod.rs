//! The interface between identification and simulation: a model's residuals as a function of its parameters.
//!
//! A simulator depends on parameters. Some of them are free from the beginning (masses, gains); others belong to
//! effects that may be missing and are *off* by default. Both are [`FitParameter`]s of one vector in normalised
//! coordinates: 0 is the model at its current values, 1 is a typical deviation.
//!
//! A [`ResidualModel`] is data ([`ModelDescription`]) plus one function that simulates
//! ([`residuals`](ResidualModel::residuals)). Residuals are in multiples of the noise floor, so that 1 is noise.

mod candidate;
mod description;
mod log;
mod parameter;
mod request;

pub use btr_core::world::TimeStep;
pub use candidate::{CandidateKind, EffectCandidate, LawTerm, Needs, Ripple};
pub use description::{JointLaws, ModelDescription, NOISE, ProportionalParameter};
pub use log::{LogStart, MeasuredChannel, RecordedLog, StartNumber};
pub use parameter::{FitParameter, Parametrisation};
pub use request::{Derivation, MovedStart, ResidualRequest};

use btr_core::world::WorldError;

/// Simulations compared with measurements, as a function of parameters.
pub trait ResidualModel: Send + Sync {
    /// Everything about the model that does not have to be simulated.
    fn description(&self) -> ModelDescription;

    /// For each request, (measured − simulated)/sigma of its log, all channels one after the other; NaN where nothing
    /// was measured. The same request gives the same bits, whichever requests it is batched with.
    ///
    /// A simulation that diverges, or that cannot be set up, gives an error in its place.
    fn residuals(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>>;

    /// The part of each residual that what acts in the joints contributes, where the motion is prescribed
    /// ([`ModelDescription::joint_laws`]); 0 in channels where nothing acts.
    fn joint_parts(&self, requests: &[ResidualRequest], _step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        let without = || WorldError::Setup { what: "the model has no laws of joints".to_owned() };
        requests.iter().map(|_| Err(without())).collect()
    }

    /// The numbers that the residual in a log is a linear function of, plus a constant, while no other parameters than
    /// those of [`ModelDescription::inertial`] differ from 0: what the links of a robot weigh, where its motion is
    /// prescribed. `None` where there are none, or at a point that cannot be simulated.
    fn inertias(&self, _u: &[f64], _log: usize) -> Option<Vec<f64>> {
        None
    }

    /// The coordinates of a parameter in which the cost is a stair ([`Parametrisation::Stair`]) that the residuals of
    /// some logs without its effect, each with the log's index, suggest; best first, each with the squares that it may
    /// explain.
    fn sizes(&self, _parameter: usize, _residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        Vec::new()
    }

    /// Whether the work was cancelled. Residuals are then errors ([`WorldError::Cancelled`]), which a search takes for
    /// simulations that fail; its result is discarded.
    fn is_cancelled(&self) -> bool {
        false
    }

    /// The model with a change; `None` where the change is not available or would make no difference.
    fn derive(&self, _derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
        None
    }
}

impl dyn ResidualModel + '_ {
    /// The residual of one request.
    ///
    /// # Errors
    /// A simulation that diverges or cannot be set up.
    pub fn residual(&self, request: ResidualRequest, step: TimeStep) -> Result<Vec<f64>, WorldError> {
        let unanswered = || Err(WorldError::Setup { what: "the residual model did not answer".to_owned() });
        self.residuals(&[request], step).pop().unwrap_or_else(unanswered)
    }
}
