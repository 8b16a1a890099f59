//! Remote and local evaluation give the same results bit by bit, also for derived residual models.

use btr_core::distance::{DistanceSpec, Rmse};
use btr_core::log::Log;
use btr_core::world::{Cancelled, Job, Output, OutputRequest, Simulator, WorldError};
use btr_identify::fit::Objective;
use btr_identify::residual_model::{Derivation, MovedStart, ResidualModel, ResidualRequest, TimeStep};
use btr_lab::distributed::{DistributedError, RemoteModel, RemoteSimulator, RunPayloads, TestComparison, serve};
use btr_lab::execution::{Cause, ExecutionContext, Executor, Payload};
use btr_lab::experiment::{LogSource, RealitySource, Source, model};
use btr_lab::verbs::VerbInput;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

type Tested<T> = Result<T, Box<dyn std::error::Error>>;

/// A worker in this process.
struct Worker;

impl Executor for Worker {
    fn workers(&self) -> usize {
        2
    }

    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause> {
        let payloads: Vec<(u64, &[u8])> = payloads.iter().map(|p| (p.key, p.bytes.as_slice())).collect();
        let context = ExecutionContext::default();
        Ok(serve(&payloads, batch, &|_| Err(DistributedError::Functions("no functions here".to_owned())), &context)?)
    }
}

/// A worker that is gone after some batches.
struct Unreliable {
    batches: AtomicUsize,
}

impl Executor for Unreliable {
    fn workers(&self) -> usize {
        1
    }

    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause> {
        let left = self.batches.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |left| left.checked_sub(1));
        left.map_err(|_| "the worker is gone")?;
        Worker.work(payloads, batch)
    }
}

/// A worker of another kind: the last number of each answer has another last bit.
struct OtherKind {
    checked_one_in: Option<NonZeroUsize>,
}

impl Executor for OtherKind {
    fn workers(&self) -> usize {
        1
    }

    fn check_one_in(&self) -> Option<NonZeroUsize> {
        self.checked_one_in
    }

    fn work(&self, payloads: &[Arc<Payload>], batch: &[u8]) -> Result<Vec<u8>, Cause> {
        let mut answer = Worker.work(payloads, batch)?;
        // A number has eight bytes, the lowest first.
        let last = answer.len() - 8;
        answer[last] ^= 1;
        Ok(answer)
    }
}

fn robots(name: &str) -> Tested<Source> {
    Ok(Source::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots").join(name))?)
}

/// A model's own motion with noise, from `from_s` on.
fn recorded(source: &Source, from_s: f64, seed: u64) -> Tested<LogSource> {
    let model = model(source)?;
    let log: Log = model.simulate(
        model.request(&model.simulations().nominal(), 0).controller(&model.controllers().nominal()).noise_seed(seed),
    )?;
    let first = log.clock_s().partition_point(|t| *t < from_s);
    let log = log.part(first..log.len()).from_zero();
    Ok(LogSource::InMemory { name: PathBuf::from(format!("log {seed}")), log })
}

fn assert_the_same(local: &dyn ResidualModel, remote: &dyn ResidualModel) {
    let description = local.description();
    let parameters = description.parameters.len();
    let reach = |k: usize| description.parameters[k].reach;
    let moved = |k: usize| (0..parameters).map(|i| if i == k { reach(k) } else { 0.0 }).collect::<Vec<f64>>();
    let points: Vec<Vec<f64>> = (0..parameters).step_by(parameters / 7 + 1).map(moved).collect();
    let bits = |all: Vec<Result<Vec<f64>, _>>| -> Vec<Vec<u64>> {
        let of = |one: Result<Vec<f64>, _>| one.unwrap_or_default().iter().map(|x: &f64| x.to_bits()).collect();
        all.into_iter().map(of).collect()
    };
    let moved = |log: usize| {
        let still = vec![0.0; description.starts[log].numbers.len()];
        (0..still.len().min(5)).map(move |k| (log, [&still[..k], &[0.5], &still[k + 1..]].concat()))
    };
    let logs = 0..description.logs.len();
    let moved: Vec<(usize, Vec<f64>)> = logs.clone().flat_map(moved).collect();
    let of_points = logs.flat_map(|log| points.iter().map(move |u| ResidualRequest::of(u, log)));
    let of_starts = moved.iter().map(|(log, moved)| ResidualRequest { u: &points[0], log: *log, moved });
    let rollouts: Vec<ResidualRequest> = of_points.chain(of_starts).collect();
    for step in [TimeStep::USUAL, TimeStep::USUAL.halved()] {
        let together = bits(local.residuals(&rollouts, step));
        assert_eq!(together, bits(remote.residuals(&rollouts, step)));
        assert_eq!(together, bits(rollouts.iter().map(|one| local.residual(*one, step)).collect()), "one by one");
    }
}

fn local_and_remote(source: &Source, from_s: f64) -> Tested<(VerbInput, RemoteModel)> {
    let (learn, held_out) = ([recorded(source, from_s, 1)?], [recorded(source, from_s + 0.1, 2)?]);
    let input = VerbInput::new(source.clone(), &learn, &held_out)?;
    let residual_model = RemoteModel::new(&input, Arc::new(ExecutionContext::with_executor(Box::new(Worker))))?;
    Ok((input, residual_model))
}

/// The held-out end of a log has the same initial state as its beginning.
#[test]
fn a_log_that_is_cut_in_two_has_one_start() -> Tested<()> {
    let source = robots("arm.toml")?;
    let problem = VerbInput::new(source.clone(), &[recorded(&source, 0.0, 1)?], &[] as &[LogSource])?.problem;
    let begin: Vec<usize> = problem.description().starts.iter().map(|start| start.begins_with).collect();
    assert_eq!(begin, [0, 0]);
    let with_initial_state = problem
        .derive(&Derivation::WithInitialState(vec![MovedStart {
            log: 0,
            by: vec![2.0; problem.description().starts[0].numbers.len()],
        }]))
        .ok_or("a fixed robot's logs can begin in another state")?;
    let origin = vec![0.0; problem.parameters().len()];
    for log in 0..2 {
        let residual = |residual_model: &dyn ResidualModel| {
            residual_model.residual(ResidualRequest::of(&origin, log), TimeStep::USUAL)
        };
        let finite = |residual: Vec<f64>| residual.into_iter().filter(|r| r.is_finite()).collect::<Vec<f64>>();
        assert_ne!(finite(residual(&problem)?), finite(residual(&*with_initial_state)?), "part {log}");
    }
    Ok(())
}

#[test]
fn an_arm_with_files_of_its_own() -> Tested<()> {
    let mut source = robots("arm.toml")?;
    source.text.push_str("\n[drive]\nkind = \"sine\"\nomega_rad_s = 4.0\n");
    let (input, residual_model) = local_and_remote(&source, 0.0)?;
    assert_the_same(&input.problem, &residual_model);
    // One with another initial state.
    let description = residual_model.description();
    let numbers = 0..description.starts[0].numbers.len();
    let moved =
        Derivation::WithInitialState(vec![MovedStart { log: 0, by: numbers.map(|k| 0.1 * k as f64 - 0.3).collect() }]);
    let (local, remote) = (input.problem.derive(&moved), residual_model.derive(&moved));
    let (local, remote) = local.zip(remote).ok_or("a fixed robot's logs can begin in another state")?;
    assert_the_same(&*local, &*remote);
    let origin = vec![0.0; residual_model.description().parameters.len()];
    let from = |residual_model: &dyn ResidualModel, log| {
        residual_model.residual(ResidualRequest::of(&origin, log), TimeStep::USUAL)
    };
    assert_ne!(from(&*local, 0)?, from(&residual_model, 0)?);
    assert_eq!(from(&*local, 1)?, from(&residual_model, 1)?);
    let windows = (input.problem.derive(&Derivation::InWindows), residual_model.derive(&Derivation::InWindows));
    let (local, remote) = windows.0.zip(windows.1).ok_or("a fixed robot's logs can be cut into windows")?;
    assert_the_same(&*local, &*remote);
    Ok(())
}

/// A log of the ant that begins at rest has a standing start; one that begins in motion has starts estimated by the
/// model.
#[test]
fn derived_residual_models() -> Tested<()> {
    let mut source = robots("ant.toml")?;
    source.set(&["simulation.duration_s=1.5".to_owned()])?;
    let mut derived = 0;
    for from_s in [0.0, 0.6] {
        let (input, residual_model) = local_and_remote(&source, from_s)?;
        assert_the_same(&input.problem, &residual_model);
        let seen = Derivation::WithStartsAt(vec![0.0; residual_model.description().parameters.len()]);
        for (local, remote) in [
            (input.problem.derive(&Derivation::Beginnings), residual_model.derive(&Derivation::Beginnings)),
            (input.problem.derive(&seen), residual_model.derive(&seen)),
        ] {
            assert_eq!(local.is_some(), remote.is_some());
            if let (Some(local), Some(remote)) = (local, remote) {
                assert_the_same(&*local, &*remote);
                derived += 1;
            }
        }
    }
    assert!(derived > 0, "no residual model was derived");
    Ok(())
}

#[test]
fn cancelled_work_simulates_no_further() -> Tested<()> {
    let model = model(&robots("pendulum.toml")?)?;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let jobs = vec![Job { s: &s, c: &c, scenario: 0 }; 4096];
    let context = ExecutionContext::default();
    let check_cancelled = || {
        if model.rollouts.load(Ordering::Relaxed) > 0 {
            context.cancel();
        }
        context.check_cancelled()
    };
    assert_eq!(model.simulate_jobs(&jobs, &check_cancelled), Err(Cancelled));
    let simulated = model.rollouts.load(Ordering::Relaxed);
    assert!(simulated > 0 && simulated < 4096 / 2, "{simulated}");
    Ok(())
}

#[test]
fn a_worker_that_fails_ends_a_fit_with_its_cause() -> Tested<()> {
    let source = robots("pendulum.toml")?;
    let input = VerbInput::new(source.clone(), &[recorded(&source, 0.0, 1)?], &[])?;
    for batches in [0, 3] {
        let context = ExecutionContext::with_executor(Box::new(Unreliable { batches: batches.into() }));
        let context = Arc::new(context);
        let model = RemoteModel::new(&input, context.clone())?;
        let fitted = btr_identify::fit::fitted(&mut Objective::new(&model), &|_| {});
        assert!(matches!(fitted, Err(WorldError::Cancelled(_))));
        assert_eq!(context.take_cause().map(|cause| cause.to_string()).as_deref(), Some("the worker is gone"));
    }
    Ok(())
}

#[test]
fn a_population_of_an_experiment() -> Tested<()> {
    let source = robots("nao.toml")?;
    let model = model(&source)?;
    let (context, payloads) = (ExecutionContext::with_executor(Box::new(Worker)), RunPayloads::default());
    let comparison = TestComparison { distance: &DistanceSpec::Rmse(Rmse::default()), reality: RealitySource::File };
    let remote = RemoteSimulator::new(&model, &source, comparison, &context, &payloads)?;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let jobs = [Job { s: &s, c: &c, scenario: 0 }; 3];
    let outputs = [OutputRequest::Fitness, OutputRequest::Behaviour, OutputRequest::Fitness];
    let (local, remote) = (model.evaluate_all(&jobs, &outputs), remote.evaluate_all(&jobs, &outputs));
    assert!(matches!(local[1], Ok(Output::Behaviour(_))) && local == remote);
    Ok(())
}

/// The fingerprint of such a worker agrees; only its results tell.
#[test]
fn a_worker_of_another_kind_is_told_and_its_numbers_are_not_used() -> Tested<()> {
    let source = robots("pendulum.toml")?;
    let input = VerbInput::new(source.clone(), &[recorded(&source, 0.0, 1)?], &[])?;
    let origin = vec![0.0; input.problem.description().parameters.len()];
    let of_log = |log| ResidualRequest { u: &origin, log, moved: &[] };
    let (usual, all) = (TimeStep::USUAL, NonZeroUsize::new(1));
    let asked = |checked_one_in, requests: &[ResidualRequest]| -> Tested<_> {
        let context = Arc::new(ExecutionContext::with_executor(Box::new(OtherKind { checked_one_in })));
        let results = RemoteModel::new(&input, context.clone())?.residuals(requests, usual);
        Ok((results, context.take_cause().map(|cause| cause.to_string())))
    };
    let (unchecked, cause) = asked(None, &[of_log(0)])?;
    assert!(cause.is_none() && unchecked != input.problem.residuals(&[of_log(0)], usual), "the plant shows");
    // Of the first batch, the first result is checked at any rate.
    for one_in in [all, NonZeroUsize::new(usize::MAX)] {
        let (results, cause) = asked(one_in, &[of_log(0)])?;
        let cause = cause.ok_or("nothing was told")?;
        assert!(cause.contains("a replay of log 1 with the model as it stands: 1 of"), "{cause}");
        assert!(results.iter().all(|one| matches!(one, Err(WorldError::Cancelled(_)))));
    }
    let (_, cause) = asked(all, &[of_log(0), of_log(1)])?;
    assert!(cause.ok_or("nothing was told")?.contains("with the model as it stands"));
    Ok(())
}

#[test]
fn a_fitness_of_another_kind_of_worker_is_told() -> Tested<()> {
    let source = robots("pendulum.toml")?;
    let model = model(&source)?;
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let outputs = |checked_one_in| -> Tested<_> {
        let context = ExecutionContext::with_executor(Box::new(OtherKind { checked_one_in }));
        let comparison =
            TestComparison { distance: &DistanceSpec::Rmse(Rmse::default()), reality: RealitySource::File };
        let payloads = RunPayloads::default();
        let remote = RemoteSimulator::new(&model, &source, comparison, &context, &payloads)?;
        let outputs = remote.evaluate_all(&[Job { s: &s, c: &c, scenario: 0 }], &[OutputRequest::Fitness]);
        Ok((outputs, context.take_cause().map(|cause| cause.to_string())))
    };
    assert!(matches!(outputs(None)?, (results, None) if results[0].is_ok()));
    let (results, cause) = outputs(NonZeroUsize::new(1))?;
    let cause = cause.ok_or("nothing was told")?;
    assert!(cause.contains("the fitness of controller [") && cause.contains("1 of 1 numbers differ"), "{cause}");
    assert!(matches!(results[..], [Err(WorldError::Cancelled(_))]));
    Ok(())
}
