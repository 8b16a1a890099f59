//! Damaged messages to a worker are refused before anything is computed.
#![allow(clippy::unwrap_used)]

use super::bundle::{Bundle, RecordedLogs};
use super::messages::{Batch, Candidate, OutputOrder, PayloadContent, RolloutMessage, Rollouts, Sparse, encode};
use super::{DistributedError, serve};
use crate::execution::ExecutionContext;
use crate::experiment::{LogSource, RealitySource, Source, model};
use crate::identification::VerbInput;
use btr_core::distance::{DistanceSpec, Rmse};
use btr_core::log::Log;
use btr_core::world::Simulator;
use btr_identify::residual_model::{Derivation, MovedStart};
use std::path::{Path, PathBuf};

fn source() -> Source {
    Source::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots/arm.toml")).unwrap()
}

fn log(source: &Source) -> Log {
    let model = model(source).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    model.simulate(model.request(&s, 0).controller(&c).noise_seed(1)).unwrap()
}

fn served(content: &PayloadContent, batch: &Batch) -> Result<Vec<u8>, DistributedError> {
    let payload = encode(content)?;
    let no_functions = |_: &[u8]| Err(DistributedError::Functions(String::new()));
    let batch = postcard::to_allocvec(batch)?;
    serve(&[(payload.key, &payload.bytes)], &batch, &no_functions, &ExecutionContext::default())
}

fn is_mismatch(answer: Result<Vec<u8>, DistributedError>) -> bool {
    answer.is_err_and(|error| error.to_string() == "the batch does not fit its payload")
}

#[test]
fn rollouts_fit_their_problem_or_are_refused() {
    let (source, name) = (source(), PathBuf::from("log"));
    let log = log(&source);
    let logs = [LogSource::InMemory { name: name.clone(), log: log.clone() }];
    let parameters = VerbInput::new(source.clone(), &logs, &[]).unwrap().problem.parameters().len();
    let model = Bundle::pack(&source, RecordedLogs::Omit, &[]).unwrap();
    let content = PayloadContent::Problem { model, learn: vec![(name, log)], held_out: Vec::new() };
    let ask = |parameters: usize, log: usize, moved: usize, halvings: u8, derived: Option<Derivation>| {
        let (u, moved) = (Sparse::of(&vec![0.0; parameters]), Sparse::of(&vec![0.0; moved]));
        let (derived, requests) = (derived.into_iter().collect(), vec![RolloutMessage { u, log, moved }]);
        served(&content, &Batch::Rollouts(Rollouts { derived, halvings, requests }))
    };
    assert!(ask(parameters, 0, 0, 0, None).is_ok());
    assert!(is_mismatch(ask(parameters + 1, 0, 0, 0, None)), "a point of another length");
    assert!(is_mismatch(ask(0, 0, 0, 0, None)), "no point");
    assert!(is_mismatch(ask(parameters, 9, 0, 0, None)), "a log that is not there");
    assert!(is_mismatch(ask(parameters, 0, 1000, 0, None)), "a start of another length");
    assert!(is_mismatch(ask(parameters, 0, 0, 40, None)), "an endlessly fine step");
    let moved = Derivation::WithInitialState(vec![MovedStart { log: 9, by: Vec::new() }]);
    let floors = Derivation::WithTorqueFloorsAt(vec![0.0]);
    let noisier = Derivation::WithNoisierMotion(usize::MAX);
    let starts = Derivation::WithStartsAt(vec![0.0]);
    for derivation in [starts, Derivation::WithoutGlitchesAt(Vec::new()), floors, moved, noisier] {
        assert!(is_mismatch(ask(parameters, 0, 0, 0, Some(derivation.clone()))), "{derivation:?}");
    }
}

#[test]
fn candidates_are_about_scenarios_that_there_are() {
    let source = source();
    let model = model(&source).unwrap();
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let distance = serde_json::to_string(&DistanceSpec::Rmse(Rmse::default())).unwrap();
    let experiment = Bundle::pack(&source, RecordedLogs::Omit, &[]).unwrap();
    let content = PayloadContent::Experiment { experiment, distance, reality: RealitySource::Function };
    let ask = |scenario: usize| {
        let candidate = Candidate { s: s.clone(), c: c.clone(), scenario, output: OutputOrder::Behaviour };
        served(&content, &Batch::Population(vec![candidate]))
    };
    assert!(ask(0).is_ok());
    assert!(is_mismatch(ask(1)));
}
