//! What makes real tests doubtful: how they were recorded, not how the robot moved. A run goes on with them, but whoever started
//! it is told at once.

use crate::check;
use crate::experiment::Experiment;
use btr_core::check::{Finding, Severity, Topic};
use btr_core::coevolve::Entry;
use btr_core::world::{Behaviour, Simulator};
use serde::Serialize;

/// Something odd about a real test's log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestDoubt {
    /// The test.
    pub test: usize,
    /// What was found.
    #[serde(flatten)]
    pub finding: Finding,
}

impl TestDoubt {
    /// In one line.
    pub fn sentence(&self) -> String {
        format!("real test {}: {}", self.test, self.finding.sentence)
    }
}

/// Everything bad about real tests, test by test. Nothing about a twin, which is a simulation.
pub fn doubts(experiment: &Experiment, tests: &[Entry]) -> Vec<TestDoubt> {
    if experiment.reality.reveal().is_some() {
        return Vec::new();
    }
    let logs = tests.iter().filter_map(|entry| Some((entry, entry.behaviour()?)));
    let of = |(entry, real): (&Entry, &Behaviour)| {
        let bad = incomparable(experiment, entry, real).into_iter().chain(recorded_badly(experiment, real));
        let test = entry.trial.number;
        bad.map(move |finding| TestDoubt { test, finding }).collect::<Vec<_>>()
    };
    logs.flat_map(of).collect()
}

/// What has been told of a run's real tests: each thing once, in the first test that shows it.
#[derive(Default)]
pub struct Told {
    tests: usize,
    known: Vec<(Topic, String)>,
}

impl Told {
    /// Looks at the tests since the last time; what was not told before.
    pub fn new_in(&mut self, experiment: &Experiment, tests: &[Entry]) -> Vec<TestDoubt> {
        let mut new = doubts(experiment, tests.get(self.tests..).unwrap_or_default());
        self.tests = tests.len();
        new.retain(|TestDoubt { finding, .. }| {
            let key = (finding.topic, finding.channel.clone());
            let is_new = !self.known.contains(&key);
            self.known.extend(is_new.then_some(key));
            is_new
        });
        new
    }
}

/// A log that no simulation of the same test can be compared with.
fn incomparable(experiment: &Experiment, entry: &Entry, real: &Behaviour) -> Option<Finding> {
    let (model, distance) = (&experiment.model, experiment.plan.distance.build());
    let simulated = model.run(&model.simulations.nominal(), &entry.trial.controller, entry.trial.scenario).ok()?;
    (!distance.distance(real, &simulated).is_finite()).then(|| {
        let sentence = format!("its log has nothing that {} could compare with a simulation", distance.name());
        Finding::new(Topic::Missing, Severity::Bad, "", sentence)
    })
}

fn recorded_badly(experiment: &Experiment, real: &Behaviour) -> Vec<Finding> {
    let quality = check::quality(&real.log, &experiment.model.robot, &experiment.model.setup.noise);
    let of_recording = [Topic::Clock, Topic::Missing, Topic::Unit, Topic::Sign];
    let bad = |finding: &&Finding| finding.severity == Severity::Bad && of_recording.contains(&finding.topic);
    quality.findings.iter().filter(bad).cloned().collect()
}
