//! The worker: answers batches.

use super::bundle::Functions;
use super::cache::Cache;
use super::error::{DistributedError, SimulationError};
use super::messages::{
    Batch, Candidate, CandidateResult, OutputOrder, PayloadContent, ResidualMessage, Rollouts, decode,
};
use super::remote_model;
use super::remote_simulator;
use super::shape::{Shape, are_of};
use crate::execution::{Answer, ExecutionContext, hash_of};
use crate::experiment;
use crate::experiment::LogSource;
use crate::identification::VerbInput;
use btr_core::distance::{Distance, DistanceSpec};
use btr_core::world::{Behaviour, Compared, Job, OutputRequest, Reference, Simulator};
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_physics::model::Model;
use std::hash::{DefaultHasher, Hasher};
use std::sync::Arc;

/// A payload that a worker has opened.
enum OpenPayload {
    /// Batch size and shape are kept: a description is too large to be made for every batch.
    Problem {
        residual_model: Box<dyn ResidualModel>,
        batch_size: usize,
        shape: Shape,
        fingerprint: u64,
    },
    Simulations {
        model: Box<Model>,
        distance: Box<dyn Distance>,
        fingerprint: u64,
    },
    Test(Behaviour),
}

/// Problems and experiments. They are large, and few are worked on at once.
static PROBLEMS: Cache<OpenPayload, DistributedError> = Cache::new(4);
/// Real tests of a run.
static TESTS: Cache<OpenPayload, DistributedError> = Cache::new(256);

const MISMATCH: DistributedError = DistributedError::Payload("the batch does not fit its payload");

/// Answers a batch: `payloads` are keys and contents, the first of them the problem or experiment. To be called by
/// workers, each in one thread; each payload is opened once per process. `functions` unpacks the laws that
/// [`Executor::functions`](crate::execution::Executor::functions) packed; the context is cancelled where one of them
/// fails.
///
/// # Errors
/// Payloads of another version, files that do not exist, cancelled work.
pub fn serve(
    payloads: &[(u64, &[u8])],
    batch: &[u8],
    functions: Functions,
    context: &ExecutionContext,
) -> Result<Vec<u8>, DistributedError> {
    let no_payload = DistributedError::Payload("a batch without a payload");
    let ((key, content), tests) = payloads.split_first().ok_or(no_payload)?;
    let (batch, request) = (hash_of(batch), postcard::from_bytes(batch)?);
    let open_payload = || {
        let opened = open(decode(content)?, functions)?;
        // What was opened while a function failed is incomplete, and must not stay in the cache.
        context.check_cancelled()?;
        Ok(opened)
    };
    let opened = PROBLEMS.get(*key, open_payload).map_err(DistributedError::Shared)?;
    let answer = match (&*opened, request) {
        (problem @ OpenPayload::Problem { residual_model, fingerprint, .. }, Batch::Rollouts(rollouts)) => {
            let results = match rollouts.derived.is_empty() {
                true => simulated(problem, &rollouts)?,
                false => simulated(&*derived(residual_model.as_ref(), *key, &rollouts)?, &rollouts)?,
            };
            postcard::to_allocvec(&Answer { fingerprint: *fingerprint, batch, results })
        }
        (OpenPayload::Simulations { model, distance, fingerprint }, Batch::Population(candidates)) => {
            let open = |(key, content): &(u64, &[u8])| TESTS.get(*key, || open(decode(content)?, functions));
            let tests = tests.iter().map(open).collect::<Result<Vec<_>, _>>().map_err(DistributedError::Shared)?;
            let tests: Vec<&Behaviour> = tests
                .iter()
                .filter_map(|test| if let OpenPayload::Test(test) = &**test { Some(test) } else { None })
                .collect();
            postcard::to_allocvec(&Answer {
                fingerprint: *fingerprint,
                batch,
                results: population(model, distance.as_ref(), &tests, &candidates)?,
            })
        }
        _ => return Err(MISMATCH),
    };
    Ok(answer?)
}

fn open(content: PayloadContent, functions: Functions) -> Result<OpenPayload, DistributedError> {
    match content {
        PayloadContent::Problem { model, learn, held_out } => model.unpacked(functions, |source| {
            let sources = |logs: Vec<_>| -> Vec<LogSource> {
                logs.into_iter().map(|(name, log)| LogSource::InMemory { name, log }).collect()
            };
            let input = VerbInput::new(source, &sources(learn), &sources(held_out))?;
            let fingerprint = remote_model::fingerprint(&input.problem);
            Ok(problem(Box::new(input.problem), fingerprint))
        }),
        PayloadContent::Experiment { experiment, distance, reality } => experiment.unpacked(functions, |source| {
            let model = experiment::simulations(&source, reality)?;
            let spec: DistanceSpec = serde_json::from_str(&distance)?;
            Ok(OpenPayload::Simulations {
                fingerprint: remote_simulator::fingerprint(&model),
                model: Box::new(model),
                distance: spec.build(),
            })
        }),
        PayloadContent::Test(behaviour) => Ok(OpenPayload::Test(behaviour)),
    }
}

fn problem(residual_model: Box<dyn ResidualModel>, fingerprint: u64) -> OpenPayload {
    let description = residual_model.description();
    let (batch_size, shape) = (description.batch_size.max(1), Shape::of(&description));
    OpenPayload::Problem { residual_model, batch_size, shape, fingerprint }
}

/// The residual model that is derived from one.
fn derived(base: &dyn ResidualModel, key: u64, rollouts: &Rollouts) -> Result<Arc<OpenPayload>, DistributedError> {
    let mut hasher = DefaultHasher::new();
    hasher.write_u64(key);
    hasher.write(&postcard::to_allocvec(&rollouts.derived)?);
    let derive = || {
        let mut residual_model: Option<Box<dyn ResidualModel>> = None;
        for how in &rollouts.derived {
            let from = residual_model.as_deref().unwrap_or(base);
            if !Shape::of(&from.description()).allows(how) {
                return Err(MISMATCH);
            }
            let not_derived = DistributedError::Payload("this residual model cannot be derived by the worker");
            residual_model = Some(from.derive(how).ok_or(not_derived)?);
        }
        Ok(problem(residual_model.ok_or(MISMATCH)?, 0))
    };
    PROBLEMS.get(hasher.finish(), derive).map_err(DistributedError::Shared)
}

/// Residuals of a problem.
fn simulated(problem: &OpenPayload, rollouts: &Rollouts) -> Result<Vec<ResidualMessage>, DistributedError> {
    let OpenPayload::Problem { residual_model, batch_size, shape, .. } = problem else { return Err(MISMATCH) };
    if !shape.fits(rollouts) {
        return Err(MISMATCH);
    }
    let step = TimeStep::of_halvings(rollouts.halvings);
    let dense: Vec<_> = rollouts.requests.iter().map(|one| (one.u.dense(), one.log, one.moved.dense())).collect();
    let requests: Vec<ResidualRequest> =
        dense.iter().map(|(u, log, moved)| ResidualRequest { u, log: *log, moved }).collect();
    let results = requests.chunks(*batch_size).flat_map(|few| residual_model.residuals(few, step));
    Ok(results.map(|result| result.map_err(SimulationError::from)).collect())
}

fn population(
    model: &Model,
    distance: &dyn Distance,
    tests: &[&Behaviour],
    candidates: &[Candidate],
) -> Result<Vec<CandidateResult>, DistributedError> {
    if !are_of(candidates, model) {
        return Err(MISMATCH);
    }
    let plain = |real: &Behaviour, simulated: &Behaviour| Compared {
        distance: distance.distance(real, simulated),
        residuals: None,
    };
    let squared = |real: &Behaviour, simulated: &Behaviour| Compared {
        residuals: distance.as_squares().map(|squares| squares.residuals(real, simulated)),
        ..plain(real, simulated)
    };
    let request = |candidate: &Candidate| -> Result<OutputRequest, DistributedError> {
        Ok(match candidate.output {
            OutputOrder::Behaviour => OutputRequest::Behaviour,
            OutputOrder::Fitness => OutputRequest::Fitness,
            OutputOrder::Distance { test, squares } => {
                let real = tests.get(test).copied().ok_or(DistributedError::Payload("a real test is missing"))?;
                OutputRequest::Distance(Reference {
                    test,
                    real,
                    squares,
                    compare: if squares { &squared } else { &plain },
                })
            }
        })
    };
    let requests: Vec<OutputRequest> = candidates.iter().map(request).collect::<Result<_, _>>()?;
    let jobs: Vec<Job> = candidates.iter().map(|one| Job { s: &one.s, c: &one.c, scenario: one.scenario }).collect();
    let few = model.side_by_side().max(1);
    let batches = jobs.chunks(few).zip(requests.chunks(few));
    let outputs = batches.flat_map(|(jobs, requests)| model.evaluate_all(jobs, requests));
    Ok(outputs.map(|output| output.map_err(SimulationError::from)).collect())
}
