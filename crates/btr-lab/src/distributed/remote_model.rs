//! A residual model whose residuals are computed by workers, or in this process, until the work is cancelled.

use super::bundle::{Bundle, RecordedLogs};
use super::error::{DistributedError, SimulationError};
use super::messages::{Batch, PayloadContent, ResidualMessage, RolloutMessage, Rollouts, Sparse, encode};
use crate::execution::{BATCH_SIZE, ExecutionContext, Expected, Numbers, Payload, fingerprint_of};
use crate::experiment::ReadLog;
use crate::identification::VerbInput;
use btr_core::log::Log;
use btr_core::world::{Cancelled, WorldError};
use btr_identify::residual_model::{Derivation, ModelDescription, ResidualModel, ResidualRequest, TimeStep};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

/// The answers to some requests.
type Residuals = Vec<Result<Vec<f64>, WorldError>>;

/// A residual model evaluated by workers.
pub struct RemoteModel {
    local: Arc<dyn ResidualModel>,
    /// The model that the payload holds, and the derivations that lead from it to this one, in order.
    base: Arc<dyn ResidualModel>,
    derived: Vec<Derivation>,
    context: Arc<ExecutionContext>,
    payload: Option<Arc<Payload>>,
    fingerprint: Arc<OnceLock<u64>>,
}

impl RemoteModel {
    /// The residual model of a problem.
    ///
    /// # Errors
    /// A file that the model names and that can no longer be read.
    pub fn new(input: &VerbInput, context: Arc<ExecutionContext>) -> Result<Self, DistributedError> {
        let local: Arc<dyn ResidualModel> = Arc::new(input.problem.clone());
        let payload = context.executor().map(|e| payload(input, e.functions())).transpose()?;
        Ok(RemoteModel { payload: payload.map(Arc::new), ..RemoteModel::here(local, context) })
    }

    /// A residual model evaluated in this process until the work is cancelled.
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

    /// The workers' residuals; `None` without workers.
    fn ask(&self, rollouts: &[ResidualRequest], step: TimeStep) -> Result<Option<Residuals>, Cancelled> {
        self.context.check_cancelled()?;
        let Some(payload) = &self.payload else { return Ok(None) };
        let asked =
            |one: &ResidualRequest| RolloutMessage { u: Sparse::of(one.u), log: one.log, moved: Sparse::of(one.moved) };
        let (requests, halvings) = (rollouts.iter().map(asked).collect(), step.halvings());
        let batch = Batch::Rollouts(Rollouts { derived: self.derived.clone(), halvings, requests });
        let again = |k: usize| {
            let residuals = self.local.residuals(&rollouts[k..=k], step).pop();
            residuals.unwrap_or_else(|| Ok(Vec::new())).map_err(SimulationError::from)
        };
        let expected = Expected {
            count: rollouts.len(),
            fingerprint: &|| *self.fingerprint.get_or_init(|| fingerprint(self.base.as_ref())),
            again: &again,
            task: &|k| self.task(&rollouts[k]),
        };
        let residuals = self.context.dispatch(std::slice::from_ref(payload), &batch, &expected)?;
        Ok(residuals.map(|residuals| residuals.into_iter().map(|r| r.map_err(WorldError::from)).collect()))
    }

    /// Names a rollout: its log, and the parameters that differ from the model.
    fn task(&self, rollout: &ResidualRequest) -> String {
        let description = self.local.description();
        let log = description.logs.get(rollout.log).map_or("?", |log| log.name.as_str());
        let moved = description.parameters.iter().zip(rollout.u).filter(|(_, u)| **u != 0.0);
        let names: Vec<&str> = moved.map(|(parameter, _)| parameter.name.as_str()).collect();
        let moved = if names.is_empty() { "the model as it stands".to_owned() } else { names.join(", ") + " changed" };
        format!("a replay of {log} with {moved}")
    }
}

impl Numbers for ResidualMessage {
    fn numbers(&self) -> Vec<f64> {
        self.as_ref().cloned().unwrap_or_default()
    }
}

/// Fingerprint of the residuals at the model's current values, and of its parameters' scales.
pub(super) fn fingerprint(residual_model: &dyn ResidualModel) -> u64 {
    let description = residual_model.description();
    let origin = vec![0.0; description.parameters.len()];
    let of_log =
        |log: usize| residual_model.residual(ResidualRequest::of(&origin, log), TimeStep::USUAL).unwrap_or_default();
    let residuals: Vec<Vec<f64>> = (0..description.logs.len()).map(of_log).collect();
    let sizes: Vec<f64> = description
        .parameters
        .iter()
        .flat_map(|parameter| [parameter.origin, parameter.size, parameter.reach])
        .collect();
    fingerprint_of(residuals.iter().chain([&sizes]).map(Vec::as_slice))
}

/// The payload of a problem: the model's file and its logs.
fn payload(input: &VerbInput, functions: &[u8]) -> Result<Payload, DistributedError> {
    let log = |ReadLog { path, log, .. }: &ReadLog| -> Result<(PathBuf, Log), DistributedError> {
        let absolute = std::path::absolute(path);
        let path = absolute.map_err(|source| DistributedError::File { path: path.clone(), source })?;
        Ok((path, log.clone()))
    };
    let logs = |logs: &[ReadLog]| logs.iter().map(log).collect::<Result<_, _>>();
    encode(&PayloadContent::Problem {
        model: Bundle::pack(&input.source, RecordedLogs::Omit, functions)?,
        learn: logs(&input.recordings.learn)?,
        held_out: logs(&input.recordings.held_out)?,
    })
}

impl ResidualModel for RemoteModel {
    fn description(&self) -> ModelDescription {
        let description = self.local.description();
        let batch_size = if self.payload.is_some() { BATCH_SIZE } else { description.batch_size };
        ModelDescription { batch_size, ..description }
    }

    fn residuals(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        match self.ask(requests, step) {
            Ok(residuals) => residuals.unwrap_or_else(|| self.local.residuals(requests, step)),
            Err(cancelled) => requests.iter().map(|_| Err(cancelled.into())).collect(),
        }
    }

    /// Takes less time than to ask another machine.
    fn joint_parts(&self, requests: &[ResidualRequest], step: TimeStep) -> Vec<Result<Vec<f64>, WorldError>> {
        self.local.joint_parts(requests, step)
    }

    fn inertias(&self, u: &[f64], log: usize) -> Option<Vec<f64>> {
        self.local.inertias(u, log)
    }

    fn sizes(&self, parameter: usize, residuals: &[(usize, &[f64])]) -> Vec<(f64, f64)> {
        self.local.sizes(parameter, residuals)
    }

    fn is_cancelled(&self) -> bool {
        self.context.is_cancelled()
    }

    fn derive(&self, derivation: &Derivation) -> Option<Box<dyn ResidualModel>> {
        let local = self.local.derive(derivation)?;
        if let Derivation::WithNoisierMotion(_) = derivation {
            // For its few rollouts, every worker would derive all that leads there anew.
            return Some(Box::new(RemoteModel::here(Arc::from(local), self.context.clone())));
        }
        Some(self.derived(local, derivation.clone()))
    }
}
