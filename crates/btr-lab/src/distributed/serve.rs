//! The worker's side.

use super::cache::Cache;
use super::family::proof;
use super::folder::Functions;
use super::message::{Answer, Batch, Candidate, Content, Derived, Order, Parcel, Rated, Residuals, Rollouts, name_of};
use super::simulator;
use crate::experiment;
use crate::experiment::LogSource;
use crate::verbs::Problem;
use btr_core::distance::{Distance, DistanceSpec};
use btr_core::world::{Against, Behaviour, Compared, Job, Simulator, Wanted};
use btr_identify::residual_model::{Family, Rollout, Step};
use btr_physics::model::Model;
use std::hash::{DefaultHasher, Hasher};

/// What a worker knows of a parcel.
enum Known {
    Family { family: Box<dyn Family>, proof: u64 },
    Simulations { model: Box<Model>, distance: Box<dyn Distance>, proof: u64 },
    Test(Behaviour),
}

/// Problems are large, and few are asked about at once.
static PROBLEMS: Cache<Known> = Cache::new(4);
/// Real tests of a run.
static TESTS: Cache<Known> = Cache::new(256);

/// Answers a batch: `parcels` are keys and contents, the first of them what the batch is about. To be called wherever work is
/// done, in one thread; what a parcel takes to be opened is done once in a process. `functions` makes laws of what
/// [`Executor::functions`](super::Executor::functions) packed.
///
/// # Errors
/// Parcels of another version, files that are not there.
pub fn serve(parcels: &[(u64, &[u8])], batch: &[u8], functions: Functions) -> Result<Vec<u8>, String> {
    let ((key, content), tests) = parcels.split_first().ok_or("no parcel")?;
    let (batch, asked) = (name_of(batch), postcard::from_bytes(batch).map_err(|e| e.to_string())?);
    let known = PROBLEMS.get(*key, || open(Parcel::content(content)?, functions))?;
    let answer = match (&*known, asked) {
        (Known::Family { family, proof }, Batch::Rollouts(rollouts)) => {
            let results = residuals(family.as_ref(), *key, &rollouts)?;
            postcard::to_allocvec(&Answer { proof: *proof, batch, results })
        }
        (Known::Simulations { model, distance, proof }, Batch::Population(candidates)) => {
            let open = |(key, content): &(u64, &[u8])| TESTS.get(*key, || open(Parcel::content(content)?, functions));
            let tests = tests.iter().map(open).collect::<Result<Vec<_>, String>>()?;
            let tests: Vec<&Behaviour> = tests
                .iter()
                .filter_map(|test| if let Known::Test(test) = &**test { Some(test) } else { None })
                .collect();
            postcard::to_allocvec(&Answer {
                proof: *proof,
                batch,
                results: population(model, distance.as_ref(), &tests, &candidates)?,
            })
        }
        _ => return Err("the batch does not fit its parcel".to_owned()),
    };
    answer.map_err(|e| e.to_string())
}

fn open(content: Content, functions: Functions) -> Result<Known, String> {
    match content {
        Content::Problem { model, learn, held_out } => model.unpacked(functions, |source| {
            let made = |logs: Vec<_>| -> Vec<LogSource> {
                logs.into_iter().map(|(name, log)| LogSource::Made { name, log }).collect()
            };
            let problem = Problem::new(source, &made(learn), &made(held_out)).map_err(|e| e.to_string())?;
            Ok(Known::Family { proof: proof(&problem.beside), family: Box::new(problem.beside) })
        }),
        Content::Experiment { experiment, distance, robot } => experiment.unpacked(functions, |source| {
            let model = experiment::simulations(&source, robot).map_err(|e| e.to_string())?;
            let spec: DistanceSpec = serde_json::from_str(&distance).map_err(|e| e.to_string())?;
            Ok(Known::Simulations { proof: simulator::proof(&model), model: Box::new(model), distance: spec.build() })
        }),
        Content::Test(behaviour) => Ok(Known::Test(behaviour)),
    }
}

fn residuals(base: &dyn Family, key: u64, rollouts: &Rollouts) -> Result<Vec<Residuals>, String> {
    if rollouts.derived.is_empty() {
        return Ok(made_of(base, rollouts));
    }
    let mut hasher = DefaultHasher::new();
    hasher.write_u64(key);
    hasher.write(&postcard::to_allocvec(&rollouts.derived).map_err(|e| e.to_string())?);
    let derive = || {
        let mut family: Option<Box<dyn Family>> = None;
        for how in &rollouts.derived {
            let from = family.as_deref().unwrap_or(base);
            let next = match how {
                Derived::Beginnings => from.beginnings(),
                Derived::SeenFrom(u) => from.seen_from(u),
                Derived::Begun(moved) => from.begun(moved),
            };
            family = Some(next.ok_or("this family cannot be derived here")?);
        }
        let family = family.ok_or("nothing was derived")?;
        Ok(Known::Family { family, proof: 0 })
    };
    match &*PROBLEMS.get(hasher.finish(), derive)? {
        Known::Family { family, .. } => Ok(made_of(family.as_ref(), rollouts)),
        _ => Err("the batch does not fit its parcel".to_owned()),
    }
}

fn made_of(family: &dyn Family, rollouts: &Rollouts) -> Vec<Residuals> {
    let step = Step::of_halvings(rollouts.halvings);
    let dense: Vec<_> = rollouts.asked.iter().map(|one| (one.u.dense(), one.log, one.moved.dense())).collect();
    let asked: Vec<Rollout> = dense.iter().map(|(u, log, moved)| Rollout { u, log: *log, moved }).collect();
    let results = asked.chunks(family.side_by_side().max(1)).flat_map(|few| family.residuals(few, step));
    results.map(|result| result.map_err(|e| e.to_string())).collect()
}

fn population(
    model: &Model,
    distance: &dyn Distance,
    tests: &[&Behaviour],
    candidates: &[Candidate],
) -> Result<Vec<Rated>, String> {
    let plain = |real: &Behaviour, simulated: &Behaviour| Compared {
        distance: distance.distance(real, simulated),
        residuals: None,
    };
    let squared = |real: &Behaviour, simulated: &Behaviour| Compared {
        residuals: distance.as_squares().map(|squares| squares.residuals(real, simulated)),
        ..plain(real, simulated)
    };
    let wanted = |candidate: &Candidate| match candidate.wanted {
        Order::Behaviour => Ok(Wanted::Behaviour),
        Order::Fitness => Ok(Wanted::Fitness),
        Order::Distance { test, squares } => {
            let real = tests.get(test).copied().ok_or("a real test did not come along")?;
            Ok(Wanted::Distance(Against { test, real, squares, compare: if squares { &squared } else { &plain } }))
        }
    };
    let wanted: Vec<Wanted> = candidates.iter().map(wanted).collect::<Result<_, String>>()?;
    let jobs: Vec<Job> = candidates.iter().map(|one| Job { s: &one.s, c: &one.c, scenario: one.scenario }).collect();
    let few = model.side_by_side().max(1);
    let made = jobs.chunks(few).zip(wanted.chunks(few)).flat_map(|(jobs, wanted)| model.make_all(jobs, wanted));
    Ok(made.map(|made| made.map_err(|e| e.to_string())).collect())
}
