//! The simulations of a run, done by workers or in this process, until the run is cancelled.

use super::bundle::{Bundle, RecordedLogs};
use super::error::{DistributedError, SimulationError};
use super::messages::{Batch, Candidate, CandidateResult, OutputOrder, PayloadContent, encode};
use crate::execution::{BATCH_SIZE, ExecutionContext, Executor, Expected, Numbers, Payload, fingerprint_of};
use crate::experiment::{RealitySource, Source};
use btr_core::distance::DistanceSpec;
use btr_core::space::Space;
use btr_core::world::{Behaviour, Cancelled, Job, Measure, Output, OutputRequest, Simulator, WorldError};
use btr_physics::model::Model;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// The payloads of a run: its experiment, and each real test once a candidate is compared with it.
#[derive(Default)]
pub struct RunPayloads {
    experiment: Mutex<Option<ExperimentPayload>>,
    tests: Mutex<BTreeMap<usize, Arc<Payload>>>,
}

/// The payload of an experiment.
#[derive(Clone)]
struct ExperimentPayload {
    /// The experiment's text.
    text: String,
    payload: Arc<Payload>,
    /// Fingerprint of this process, which workers must reproduce.
    fingerprint: u64,
}

/// What a run compares its simulations with.
#[derive(Clone, Copy)]
pub struct TestComparison<'a> {
    /// The distance to real tests.
    pub distance: &'a DistanceSpec,
    /// What answers real tests.
    pub reality: RealitySource,
}

/// A model whose simulations workers do.
pub struct RemoteSimulator<'a> {
    local: &'a Model,
    context: &'a ExecutionContext,
    payloads: &'a RunPayloads,
    /// None without workers.
    experiment: Option<ExperimentPayload>,
}

impl<'a> RemoteSimulator<'a> {
    /// The simulations of an experiment with this text.
    ///
    /// # Errors
    /// A file that the experiment names and that can no longer be read.
    pub fn new(
        local: &'a Model,
        source: &Source,
        comparison: TestComparison,
        context: &'a ExecutionContext,
        payloads: &'a RunPayloads,
    ) -> Result<Self, DistributedError> {
        let payload = |executor: &dyn Executor| payloads.experiment(local, source, comparison, executor.functions());
        let experiment = context.executor().map(payload).transpose()?;
        Ok(RemoteSimulator { local, context, payloads, experiment })
    }
}

impl RunPayloads {
    fn experiment(
        &self,
        model: &Model,
        source: &Source,
        TestComparison { distance, reality }: TestComparison,
        functions: &[u8],
    ) -> Result<ExperimentPayload, DistributedError> {
        let mut known = self.experiment.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = known.as_ref().filter(|known| known.text == source.text) {
            return Ok(known.clone());
        }
        let distance = serde_json::to_string(distance)?;
        let logs = match reality {
            RealitySource::File => RecordedLogs::Include,
            RealitySource::Function => RecordedLogs::Omit,
        };
        let experiment = Bundle::pack(source, logs, functions)?;
        let payload = Arc::new(encode(&PayloadContent::Experiment { experiment, distance, reality })?);
        let packed = ExperimentPayload { text: source.text.clone(), payload, fingerprint: fingerprint(model) };
        *known = Some(packed.clone());
        Ok(packed)
    }

    fn test(&self, number: usize, behaviour: &Behaviour) -> Option<Arc<Payload>> {
        let mut tests = self.tests.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = tests.get(&number) {
            return Some(known.clone());
        }
        let payload = Arc::new(encode(&PayloadContent::Test(behaviour.clone())).ok()?);
        tests.insert(number, payload.clone());
        Some(payload)
    }
}

/// Fingerprint of a model at its nominal values.
pub(super) fn fingerprint(model: &Model) -> u64 {
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let Ok(log) = model.simulate(model.request(&s, 0).controller(&c)) else { return 0 };
    fingerprint_of(log.channels().map(|(_, channel)| channel.values.as_slice()).chain([s.as_slice()]))
}

/// Names a simulation: what is asked of it, and where it stands in S and C.
fn task(job: &Job, request: &OutputRequest) -> String {
    let asked = match request {
        OutputRequest::Behaviour => "the behaviour".to_owned(),
        OutputRequest::Fitness => "the fitness".to_owned(),
        OutputRequest::Distance(against) => format!("the distance to real test {}", against.test),
    };
    format!("{asked} of controller {:?} in simulation {:?}, scenario {}", job.c, job.s, job.scenario)
}

impl Numbers for CandidateResult {
    fn numbers(&self) -> Vec<f64> {
        match self {
            Ok(Output::Behaviour(behaviour)) => {
                let channels = behaviour.log.channels().flat_map(|(_, channel)| channel.values.iter().copied());
                channels.chain([behaviour.fitness]).collect()
            }
            Ok(Output::Fitness(fitness)) => vec![*fitness],
            Ok(Output::Distance(compared)) => {
                let residuals = compared.residuals.iter().flatten().flatten().copied();
                [compared.distance].into_iter().chain(residuals).collect()
            }
            Err(_) => Vec::new(),
        }
    }
}

impl RemoteSimulator<'_> {
    /// Workers' outputs for some jobs; `None` without workers.
    fn dispatch(
        &self,
        jobs: &[Job],
        requests: &[OutputRequest],
    ) -> Result<Option<Vec<Result<Output, WorldError>>>, Cancelled> {
        self.context.check_cancelled()?;
        let Some(ExperimentPayload { payload, fingerprint, .. }) = &self.experiment else { return Ok(None) };
        let (mut payloads, mut numbers) = (vec![payload.clone()], Vec::new());
        let mut order = |request: &OutputRequest| {
            Some(match request {
                OutputRequest::Behaviour => OutputOrder::Behaviour,
                OutputRequest::Fitness => OutputOrder::Fitness,
                OutputRequest::Distance(against) => {
                    let test = match numbers.iter().position(|number| *number == against.test) {
                        Some(known) => known,
                        None => {
                            payloads.push(self.payloads.test(against.test, against.real)?);
                            numbers.push(against.test);
                            numbers.len() - 1
                        }
                    };
                    OutputOrder::Distance { test, squares: against.squares }
                }
            })
        };
        let candidate = |(job, request): (&Job, &OutputRequest)| {
            let (s, c, scenario) = (job.s.to_vec(), job.c.to_vec(), job.scenario);
            Some(Candidate { s, c, scenario, output: order(request)? })
        };
        let candidates: Option<Vec<Candidate>> = jobs.iter().zip(requests).map(candidate).collect();
        let Some(candidates) = candidates else { return Ok(None) };
        let again = |k: usize| {
            let output = self.local.evaluate_all(&jobs[k..=k], &requests[k..=k]).pop();
            output.unwrap_or(Err(Cancelled.into())).map_err(SimulationError::from)
        };
        let expected = Expected {
            count: jobs.len(),
            fingerprint: &|| *fingerprint,
            again: &again,
            task: &|k| task(&jobs[k], &requests[k]),
        };
        let outputs = self.context.dispatch(&payloads, &Batch::Population(candidates), &expected)?;
        Ok(outputs.map(|outputs| outputs.into_iter().map(|output| output.map_err(WorldError::from)).collect()))
    }
}

impl Simulator for RemoteSimulator<'_> {
    fn simulations(&self) -> &Space {
        self.local.simulations()
    }

    fn controllers(&self) -> &Space {
        self.local.controllers()
    }

    fn scenarios(&self) -> usize {
        self.local.scenarios()
    }

    fn measure(&self, name: &str) -> Option<Measure> {
        self.local.measure(name)
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.local.run(s, c, scenario)
    }

    fn side_by_side(&self) -> usize {
        if self.experiment.is_some() { BATCH_SIZE } else { self.local.side_by_side() }
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        self.local.run_all(jobs)
    }

    fn evaluate_all(&self, jobs: &[Job], requests: &[OutputRequest]) -> Vec<Result<Output, WorldError>> {
        match self.dispatch(jobs, requests) {
            Ok(outputs) => outputs.unwrap_or_else(|| self.local.evaluate_all(jobs, requests)),
            Err(cancelled) => jobs.iter().map(|_| Err(cancelled.into())).collect(),
        }
    }
}
