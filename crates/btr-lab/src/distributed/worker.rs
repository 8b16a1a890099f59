//! The worker's side.

use super::bundle::Functions;
use super::cache::Cache;
use super::messages::{
    Answer, Batch, Candidate, CandidateResult, OutputOrder, Payload, PayloadContent, ResidualMessage, RolloutFailure,
    Rollouts, name_of,
};
use super::remote_model::fingerprint;
use super::remote_simulator;
use crate::experiment;
use crate::experiment::LogSource;
use crate::verbs::VerbInput;
use btr_core::distance::{Distance, DistanceSpec};
use btr_core::world::{Behaviour, Compared, Job, OutputRequest, Reference, Simulator};
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_physics::model::Model;
use std::hash::{DefaultHasher, Hasher};

/// What a worker knows of a parcel.
enum DecodedPayload {
    Family { residual_model: Box<dyn ResidualModel>, fingerprint: u64 },
    Simulations { model: Box<Model>, distance: Box<dyn Distance>, fingerprint: u64 },
    Test(Behaviour),
}

/// Problems are large, and few are asked about at once.
static PROBLEMS: Cache<DecodedPayload> = Cache::new(4);
/// Real tests of a run.
static TESTS: Cache<DecodedPayload> = Cache::new(256);

/// Answers a batch: `payloads` are keys and contents, the first of them what the batch is about. To be called wherever work is
/// done, in one thread; what a parcel takes to be opened is done once in a process. `functions` makes laws of what
/// [`Executor::functions`](super::Executor::functions) packed.
///
/// # Errors
/// Parcels of another version, files that are not there.
pub fn serve(payloads: &[(u64, &[u8])], batch: &[u8], functions: Functions) -> Result<Vec<u8>, String> {
    let ((key, content), tests) = payloads.split_first().ok_or("no parcel")?;
    let (batch, asked) = (name_of(batch), postcard::from_bytes(batch).map_err(|e| e.to_string())?);
    let known = PROBLEMS.get(*key, || open(Payload::content(content)?, functions))?;
    let answer = match (&*known, asked) {
        (DecodedPayload::Family { residual_model, fingerprint }, Batch::Rollouts(rollouts)) => {
            let results = residuals(residual_model.as_ref(), *key, &rollouts)?;
            postcard::to_allocvec(&Answer { fingerprint: *fingerprint, batch, results })
        }
        (DecodedPayload::Simulations { model, distance, fingerprint }, Batch::Population(candidates)) => {
            let open = |(key, content): &(u64, &[u8])| TESTS.get(*key, || open(Payload::content(content)?, functions));
            let tests = tests.iter().map(open).collect::<Result<Vec<_>, String>>()?;
            let tests: Vec<&Behaviour> = tests
                .iter()
                .filter_map(|test| if let DecodedPayload::Test(test) = &**test { Some(test) } else { None })
                .collect();
            postcard::to_allocvec(&Answer {
                fingerprint: *fingerprint,
                batch,
                results: population(model, distance.as_ref(), &tests, &candidates)?,
            })
        }
        _ => return Err("the batch does not fit its parcel".to_owned()),
    };
    answer.map_err(|e| e.to_string())
}

fn open(content: PayloadContent, functions: Functions) -> Result<DecodedPayload, String> {
    match content {
        PayloadContent::Problem { model, learn, held_out } => model.unpacked(functions, |source| {
            let made = |logs: Vec<_>| -> Vec<LogSource> {
                logs.into_iter().map(|(name, log)| LogSource::Made { name, log }).collect()
            };
            let input = VerbInput::new(source, &made(learn), &made(held_out)).map_err(|e| e.to_string())?;
            Ok(DecodedPayload::Family {
                fingerprint: fingerprint(&input.problem),
                residual_model: Box::new(input.problem),
            })
        }),
        PayloadContent::Experiment { experiment, distance, robot } => experiment.unpacked(functions, |source| {
            let model = experiment::simulations(&source, robot).map_err(|e| e.to_string())?;
            let spec: DistanceSpec = serde_json::from_str(&distance).map_err(|e| e.to_string())?;
            Ok(DecodedPayload::Simulations {
                fingerprint: remote_simulator::fingerprint(&model),
                model: Box::new(model),
                distance: spec.build(),
            })
        }),
        PayloadContent::Test(behaviour) => Ok(DecodedPayload::Test(behaviour)),
    }
}

fn residuals(base: &dyn ResidualModel, key: u64, rollouts: &Rollouts) -> Result<Vec<ResidualMessage>, String> {
    if rollouts.derived.is_empty() {
        return Ok(made_of(base, rollouts));
    }
    let mut hasher = DefaultHasher::new();
    hasher.write_u64(key);
    hasher.write(&postcard::to_allocvec(&rollouts.derived).map_err(|e| e.to_string())?);
    let derive = || {
        let mut residual_model: Option<Box<dyn ResidualModel>> = None;
        for how in &rollouts.derived {
            let from = residual_model.as_deref().unwrap_or(base);
            residual_model = Some(from.derive(how).ok_or("this family cannot be derived here")?);
        }
        let residual_model = residual_model.ok_or("nothing was derived")?;
        Ok(DecodedPayload::Family { residual_model, fingerprint: 0 })
    };
    match &*PROBLEMS.get(hasher.finish(), derive)? {
        DecodedPayload::Family { residual_model, .. } => Ok(made_of(residual_model.as_ref(), rollouts)),
        _ => Err("the batch does not fit its parcel".to_owned()),
    }
}

fn made_of(residual_model: &dyn ResidualModel, rollouts: &Rollouts) -> Vec<ResidualMessage> {
    let step = TimeStep::of_halvings(rollouts.halvings);
    let dense: Vec<_> = rollouts.asked.iter().map(|one| (one.u.dense(), one.log, one.moved.dense())).collect();
    let asked: Vec<ResidualRequest> =
        dense.iter().map(|(u, log, moved)| ResidualRequest { u, log: *log, moved }).collect();
    let results = asked
        .chunks(residual_model.description().batch_size.max(1))
        .flat_map(|few| residual_model.residuals(few, step));
    results.map(|result| result.map_err(RolloutFailure::from)).collect()
}

fn population(
    model: &Model,
    distance: &dyn Distance,
    tests: &[&Behaviour],
    candidates: &[Candidate],
) -> Result<Vec<CandidateResult>, String> {
    let plain = |real: &Behaviour, simulated: &Behaviour| Compared {
        distance: distance.distance(real, simulated),
        residuals: None,
    };
    let squared = |real: &Behaviour, simulated: &Behaviour| Compared {
        residuals: distance.as_squares().map(|squares| squares.residuals(real, simulated)),
        ..plain(real, simulated)
    };
    let wanted = |candidate: &Candidate| match candidate.wanted {
        OutputOrder::Behaviour => Ok(OutputRequest::Behaviour),
        OutputOrder::Fitness => Ok(OutputRequest::Fitness),
        OutputOrder::Distance { test, squares } => {
            let real = tests.get(test).copied().ok_or("a real test did not come along")?;
            Ok(OutputRequest::Distance(Reference {
                test,
                real,
                squares,
                compare: if squares { &squared } else { &plain },
            }))
        }
    };
    let wanted: Vec<OutputRequest> = candidates.iter().map(wanted).collect::<Result<_, String>>()?;
    let jobs: Vec<Job> = candidates.iter().map(|one| Job { s: &one.s, c: &one.c, scenario: one.scenario }).collect();
    let few = model.side_by_side().max(1);
    let made = jobs.chunks(few).zip(wanted.chunks(few)).flat_map(|(jobs, wanted)| model.evaluate_all(jobs, wanted));
    Ok(made.map(|made| made.map_err(|e| e.to_string())).collect())
}
