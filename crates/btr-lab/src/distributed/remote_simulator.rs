//! The simulations of a run, worked out elsewhere, or here, as long as nobody stops it.

use super::bundle::Folder;
use super::messages::{Batch, Candidate, CandidateResult, OutputOrder, Payload, PayloadContent, fingerprint_of};
use super::{ExecutionContext, Executor, MOST_AT_ONCE};
use crate::experiment::Source;
use btr_core::distance::DistanceSpec;
use btr_core::space::Space;
use btr_core::world::{Behaviour, Job, Measure, Output, OutputRequest, Simulator, WorldError};
use btr_physics::model::Model;
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

/// What goes to the workers of a run: its experiment, and each real test once somebody is compared with it.
#[derive(Default)]
pub struct RunPayloads {
    experiment: Mutex<Option<(String, Arc<Payload>, u64)>>,
    tests: Mutex<BTreeMap<usize, Arc<Payload>>>,
}

/// A model whose runs are served.
pub struct RemoteSimulator<'a> {
    local: &'a Model,
    context: &'a ExecutionContext,
    payloads: &'a RunPayloads,
    /// The experiment's parcel, and what workers must prove; none where there are no workers.
    experiment: Option<(Arc<Payload>, u64)>,
}

impl<'a> RemoteSimulator<'a> {
    /// The simulations of an experiment with this text, for a run with this distance; `robot` where a robot of its own stands
    /// for what the text says of reality.
    ///
    /// # Errors
    /// A file that the experiment names and that cannot be read any more.
    pub fn new(
        local: &'a Model,
        source: &Source,
        (distance, robot): (&DistanceSpec, bool),
        context: &'a ExecutionContext,
        payloads: &'a RunPayloads,
    ) -> Result<Self, String> {
        let payload =
            |executor: &dyn Executor| payloads.experiment(local, source, (distance, robot), executor.functions());
        let experiment = context.executor.as_deref().map(payload).transpose()?;
        Ok(RemoteSimulator { local, context, payloads, experiment })
    }
}

impl RunPayloads {
    fn experiment(
        &self,
        model: &Model,
        source: &Source,
        (distance, robot): (&DistanceSpec, bool),
        functions: &[u8],
    ) -> Result<(Arc<Payload>, u64), String> {
        let mut known = self.experiment.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, payload, fingerprint)) = known.as_ref().filter(|(text, ..)| *text == source.text) {
            return Ok((payload.clone(), *fingerprint));
        }
        let distance = serde_json::to_string(distance).map_err(|e| e.to_string())?;
        let experiment = Folder::pack(source, !robot, functions)?;
        let payload = Payload::of(&PayloadContent::Experiment { experiment, distance, robot })?;
        let (payload, fingerprint) = (Arc::new(payload), fingerprint(model));
        *known = Some((source.text.clone(), payload.clone(), fingerprint));
        Ok((payload, fingerprint))
    }

    fn test(&self, number: usize, behaviour: &Behaviour) -> Option<Arc<Payload>> {
        let mut tests = self.tests.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(known) = tests.get(&number) {
            return Some(known.clone());
        }
        let payload = Arc::new(Payload::of(&PayloadContent::Test(behaviour.clone())).ok()?);
        tests.insert(number, payload.clone());
        Some(payload)
    }
}

/// What a model computes as it stands.
pub(super) fn fingerprint(model: &Model) -> u64 {
    let (s, c) = (model.simulations().nominal(), model.controllers().nominal());
    let Ok(log) = model.simulate(model.request(&s, 0).controller(&c)) else { return 0 };
    fingerprint_of(log.channels().map(|(_, channel)| channel.values.as_slice()).chain([s.as_slice()]))
}

impl RemoteSimulator<'_> {
    fn ask(&self, jobs: &[Job], wanted: &[OutputRequest]) -> Option<Vec<Result<Output, WorldError>>> {
        let (experiment, fingerprint) = self.experiment.as_ref()?;
        let (mut payloads, mut numbers) = (vec![experiment.clone()], Vec::new());
        let mut asked = |wanted: &OutputRequest| {
            Some(match wanted {
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
        let candidate = |(job, wanted): (&Job, &OutputRequest)| {
            let (s, c, scenario) = (job.s.to_vec(), job.c.to_vec(), job.scenario);
            Some(Candidate { s, c, scenario, wanted: asked(wanted)? })
        };
        let candidates: Option<Vec<Candidate>> = jobs.iter().zip(wanted).map(candidate).collect();
        let made: Vec<CandidateResult> =
            self.context.ask(&payloads, &Batch::Population(candidates?), jobs.len(), || *fingerprint)?;
        Some(made.into_iter().map(|made| made.map_err(|what| WorldError::Setup { what })).collect())
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
        if self.experiment.is_some() { MOST_AT_ONCE } else { self.local.side_by_side() }
    }

    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        self.local.run_all(jobs)
    }

    fn evaluate_all(&self, jobs: &[Job], wanted: &[OutputRequest]) -> Vec<Result<Output, WorldError>> {
        self.context.check_cancelled();
        self.ask(jobs, wanted).unwrap_or_else(|| self.local.evaluate_all(jobs, wanted))
    }
}
