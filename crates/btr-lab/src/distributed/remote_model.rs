//! A family whose residuals are worked out elsewhere, or here, as long as nobody stops it.

use super::bundle::Folder;
use super::messages::{
    Batch, Derivation, Payload, PayloadContent, ResidualMessage, RolloutMessage, Rollouts, Sparse, fingerprint_of,
};
use super::{ExecutionContext, MOST_AT_ONCE};
use crate::experiment;
use crate::experiment::LogSource;
use crate::verbs::VerbInput;
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_identify::residual_model::{
    EffectCandidate, FitParameter, LawTerm, RecordedLog, ResidualModel, ResidualRequest, TimeStep,
};
use std::ops::Range;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// The family of a problem, served.
pub struct RemoteModel {
    local: Arc<dyn ResidualModel>,
    /// The family that the parcel holds, and what was made of it one after the other to get this one.
    base: Arc<dyn ResidualModel>,
    derived: Vec<Derivation>,
    context: Arc<ExecutionContext>,
    payload: Option<Arc<Payload>>,
    fingerprint: Arc<OnceLock<u64>>,
}

impl RemoteModel {
    /// The family of a problem, which was made of these logs.
    ///
    /// # Errors
    /// A file that the model names and that cannot be read any more.
    pub fn new(
        input: &VerbInput,
        learn: &[LogSource],
        held_out: &[LogSource],
        context: Arc<ExecutionContext>,
    ) -> Result<Self, String> {
        let local: Arc<dyn ResidualModel> = Arc::new(input.problem.clone());
        let payload = context.executor.as_ref().map(|e| payload(input, learn, held_out, e.functions())).transpose()?;
        Ok(RemoteModel { payload: payload.map(Arc::new), ..RemoteModel::here(local, context) })
    }

    /// A family that nobody works on but this process, as long as nobody stops it.
    pub fn here(local: Arc<dyn ResidualModel>, context: Arc<ExecutionContext>) -> Self {
        RemoteModel {
            base: local.clone(),
            local,
            derived: Vec::new(),
            context,
            payload: None,
            fingerprint: Arc::default(),
        }
    }

    fn derived(&self, local: Box<dyn ResidualModel>, how: Derivation) -> Box<dyn ResidualModel> {
        let (context, payload, fingerprint) = (self.context.clone(), self.payload.clone(), self.fingerprint.clone());
        let (base, derived) = (self.base.clone(), self.derived.iter().cloned().chain([how]).collect());
        Box::new(RemoteModel { local: Arc::from(local), base, derived, context, payload, fingerprint })
    }

    /// What workers make of some rollouts; `None` where there is nobody to ask.
    fn ask(&self, rollouts: &[ResidualRequest], step: TimeStep) -> Option<Vec<Result<Vec<f64>, WorldError>>> {
        let payload = self.payload.as_ref()?;
        let asked =
            |one: &ResidualRequest| RolloutMessage { u: Sparse::of(one.u), log: one.log, moved: Sparse::of(one.moved) };
        let (asked, halvings) = (rollouts.iter().map(asked).collect(), step.halvings());
        let batch = Batch::Rollouts(Rollouts { derived: self.derived.clone(), halvings, asked });
        let fingerprint = || *self.fingerprint.get_or_init(|| fingerprint(self.base.as_ref()));
        let residuals: Vec<ResidualMessage> =
            self.context.ask(std::slice::from_ref(payload), &batch, rollouts.len(), fingerprint)?;
        Some(residuals.into_iter().map(|r| r.map_err(|what| WorldError::Setup { what })).collect())
    }
}

/// What a family computes for the model as it stands.
pub(super) fn fingerprint(residual_model: &dyn ResidualModel) -> u64 {
    let origin = vec![0.0; residual_model.parameters().len()];
    let of_log =
        |log: usize| residual_model.residual(ResidualRequest::of(&origin, log), TimeStep::USUAL).unwrap_or_default();
    let residuals: Vec<Vec<f64>> = (0..residual_model.logs().len()).map(of_log).collect();
    let sizes: Vec<f64> = residual_model
        .parameters()
        .iter()
        .flat_map(|parameter| [parameter.origin, parameter.size, parameter.reach])
        .collect();
    fingerprint_of(residuals.iter().chain([&sizes]).map(Vec::as_slice))
}

fn payload(
    input: &VerbInput,
    learn: &[LogSource],
    held_out: &[LogSource],
    functions: &[u8],
) -> Result<Payload, String> {
    let read = |log: &LogSource| -> Result<(PathBuf, Log), String> {
        let path = std::path::absolute(log.path()).map_err(|e| e.to_string())?;
        Ok((path, experiment::recorded(&input.source, log).map_err(|e| e.to_string())?))
    };
    let read = |logs: &[LogSource]| logs.iter().map(read).collect::<Result<_, _>>();
    Payload::of(&PayloadContent::Problem {
        model: Folder::pack(&input.source, false, functions)?,
        learn: read(learn)?,
        held_out: read(held_out)?,
    })
}

impl ResidualModel for RemoteModel {
    fn parameters(&self) -> &[FitParameter] {
        self.local.parameters()
    }

    fn free(&self) -> &[usize] {
        self.local.free()
    }

    fn candidates(&self) -> &[EffectCandidate] {
        self.local.candidates()
    }

    fn features(&self) -> &[LawTerm] {
        self.local.features()
    }

    fn clock_s(&self, log: usize) -> &[f64] {
        self.local.clock_s(log)
    }

    fn logs(&self) -> &[RecordedLog] {
        self.local.logs()
    }

    fn residual(&self, rollout: ResidualRequest, step: TimeStep) -> Result<Vec<f64>, WorldError> {
        self.residuals(&[rollout], step).pop().unwrap_or_else(|| self.local.residual(rollout, step))
    }

    fn side_by_side(&self) -> usize {
        if self.payload.is_some() { MOST_AT_ONCE } else { self.local.side_by_side() }
    }

    fn residuals(&self, rollouts: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        self.context.check_cancelled();
        self.ask(rollouts, step).unwrap_or_else(|| self.local.residuals(rollouts, step))
    }

    fn order(&self) -> i32 {
        self.local.order()
    }

    fn starts(&self, log: usize) -> usize {
        self.local.starts(log)
    }

    fn windows(&self, log: usize) -> Vec<Range<usize>> {
        self.local.windows(log)
    }

    fn has_contact(&self) -> bool {
        self.local.has_contact()
    }

    fn is_chaotic(&self) -> bool {
        self.local.is_chaotic()
    }

    fn with_starts_at(&self, u: &[f64]) -> Option<Box<dyn ResidualModel>> {
        self.context.check_cancelled();
        Some(self.derived(self.local.with_starts_at(u)?, Derivation::SeenFrom(u.to_vec())))
    }

    fn with_initial_state(&self, moved: &[(usize, Vec<f64>)]) -> Option<Box<dyn ResidualModel>> {
        Some(self.derived(self.local.with_initial_state(moved)?, Derivation::Begun(moved.to_vec())))
    }

    fn beginnings(&self) -> Option<Box<dyn ResidualModel>> {
        Some(self.derived(self.local.beginnings()?, Derivation::Beginnings))
    }

    fn start_near(&self, log: usize, number: usize) -> &[String] {
        self.local.start_near(log, number)
    }

    fn near(&self, candidate: usize) -> &[String] {
        self.local.near(candidate)
    }

    fn start_spread(&self) -> f64 {
        self.local.start_spread()
    }

    fn start_open(&self, log: usize) -> Vec<f64> {
        self.local.start_open(log)
    }

    fn begins_with(&self, log: usize) -> usize {
        self.local.begins_with(log)
    }
}
