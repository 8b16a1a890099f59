//! Findings about real tests: defects of the recording, not of the robot's motion. A run continues despite them, but
//! reports them at once.

use crate::experiment::Experiment;
use crate::log_quality::quality;
use btr_core::coevolve::{Entry, TestVerdict};
use btr_core::log::Log;
use btr_core::world::{Behaviour, Simulator};
use btr_identify::quality::{FEWEST_SAMPLES, Finding, Severity, Topic, check_references, find_glitches};
use btr_physics::robot::{Base, Joint, Robot};
use btr_physics::sensor::SensorNoise;
use serde::Serialize;

/// A log that ends before this share of the test is partial.
const MIN_SHARE: f64 = 0.8;
/// A log that begins later than this many of its steps has lost more than its first row.
const LATE_ROWS: f64 = 1.5;
/// A log with fewer samples than this share of the commands has too few.
const FEW: f64 = 0.25;
/// Latest time of a reading that shows where a joint began, in s.
const FIRST_READING_S: f64 = 0.05;
/// A joint begins at another position if it is further away than this share of its range in the log, ...
const START_SHARE: f64 = 0.15;
/// ... and further than this many noise floors.
const START_FLOORS: f64 = 10.0;

/// A finding about a real test's log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TestDoubt {
    /// Number of the test.
    pub test: usize,
    /// The finding.
    #[serde(flatten)]
    pub finding: Finding,
}

impl TestDoubt {
    /// One-line summary.
    pub fn sentence(&self) -> String {
        format!("real test {}: {}", self.test, self.finding.sentence)
    }
}

/// All findings about real tests, test by test. None for a twin, which is a simulation. If no test gave a log, includes
/// why each one failed.
pub fn doubts(experiment: &Experiment, tests: &[Entry]) -> Vec<TestDoubt> {
    doubts_since(experiment, tests, 0)
}

/// The same for the tests from `first` on.
fn doubts_since(experiment: &Experiment, tests: &[Entry], first: usize) -> Vec<TestDoubt> {
    if experiment.reality.reveal().is_some() {
        return Vec::new();
    }
    let nothing = tests.iter().all(|entry| entry.behaviour().is_none());
    let of = |entry: &Entry| {
        let found = match (entry.behaviour(), &entry.verdict) {
            (Some(real), _) => of_log(experiment, entry, real),
            (None, TestVerdict::Failed { why }) if nothing => vec![failed(why)],
            (None, _) => Vec::new(),
        };
        found.into_iter().map(|finding| TestDoubt { test: entry.trial.number, finding }).collect::<Vec<_>>()
    };
    tests.iter().skip(first).flat_map(of).collect()
}

fn failed(why: &str) -> Finding {
    Finding::new(Topic::Missing, Severity::Bad, "test", format!("it gave no log: {why}"))
}

fn of_log(experiment: &Experiment, entry: &Entry, real: &Behaviour) -> Vec<Finding> {
    let incomparable = incomparable(experiment, entry, real);
    let missing = if incomparable.is_none() { absent(experiment, &real.log) } else { None };
    let of_the_test = incomparable.into_iter().chain(missing).chain(deviations(experiment, entry, &real.log));
    of_the_test.chain(recorded_badly(experiment, real)).collect()
}

/// Findings reported during a run: each is reported once, for the first test that shows it.
#[derive(Default)]
pub struct ReportedDoubts {
    tests: usize,
    known: Vec<(Topic, String)>,
}

impl ReportedDoubts {
    /// Checks the tests that were added since the last call and returns the findings not yet reported.
    pub fn new_in(&mut self, experiment: &Experiment, tests: &[Entry]) -> Vec<TestDoubt> {
        let mut new = doubts_since(experiment, tests, self.tests);
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

/// Finding for a log that cannot be compared with a simulation of the same test.
fn incomparable(experiment: &Experiment, entry: &Entry, real: &Behaviour) -> Option<Finding> {
    let (model, distance) = (&experiment.model, experiment.plan.distance.build());
    let simulated = model.run(&model.simulations.nominal(), &entry.trial.controller, entry.trial.scenario).ok()?;
    (!distance.distance(real, &simulated).is_finite()).then(|| {
        let sentence = format!("its log has nothing that {} could compare with a simulation", distance.name());
        Finding::new(Topic::Missing, Severity::Bad, "", sentence)
    })
}

/// Findings where the log shows that the test was not carried out as requested.
fn deviations(experiment: &Experiment, entry: &Entry, log: &Log) -> Vec<Finding> {
    let (model, trial) = (&experiment.model, &entry.trial);
    let known = &model.scenarios[trial.scenario];
    // A recorded log replays its own commands.
    if known.replay.is_some() {
        return Vec::new();
    }
    let references = model.references(&trial.controller, trial.scenario);
    // The references of a policy depend on the robot's sensors.
    let commands =
        references.ok().filter(|_| !model.drive.senses()).and_then(|references| check_references(&references, log));
    let begins = model.beginning(&trial.controller, trial.scenario);
    let displaced = begins.map(|robot| displaced(&robot, &model.setup.noise, log)).unwrap_or_default();
    commands.into_iter().chain(partial(known.duration_s, model.setup.control_s, log)).chain(displaced).collect()
}

/// Finding for a log that covers only a part of the test or has too few samples.
fn partial(test_s: f64, control_s: f64, log: &Log) -> Option<Finding> {
    let (first_s, last_s) = (*log.clock_s().first()?, *log.clock_s().last()?);
    let step_s = log.usual_step_s()?;
    let say = |severity, sentence| Some(Finding::new(Topic::Clock, severity, "", sentence));
    if last_s < MIN_SHARE * test_s {
        return say(Severity::Bad, format!("its log ends at {last_s:.2} s, but the test lasts {test_s} s"));
    }
    if first_s > LATE_ROWS * step_s {
        let sentence = format!(
            "its log begins {first_s:.3} s into the test by its own clock, which is kept: give it times from the \
             first command on"
        );
        return say(Severity::Doubtful, sentence);
    }
    let ticks = test_s / control_s;
    ((log.len() as f64) < FEW * ticks && log.len() >= FEWEST_SAMPLES).then(|| {
        let samples = log.len();
        let sentence = format!("its log has {samples} samples, but the robot received {ticks:.0} commands");
        Finding::new(Topic::Clock, Severity::Bad, "", sentence)
    })
}

/// Findings for joints whose log begins at another position than the test.
fn displaced(robot: &Robot, noise: &SensorNoise, log: &Log) -> Vec<Finding> {
    let soon = |k: usize| log.clock_s()[k] <= FIRST_READING_S;
    let finding = |joint: &Joint| {
        let name = format!("q_{}", joint.name);
        let values = &log.channel(&name).filter(|channel| channel.unit == joint.position_unit())?.values;
        let first = values.iter().position(|q| q.is_finite()).filter(|k| soon(*k))?;
        let finite = || values.iter().copied().filter(|q| q.is_finite());
        let range = finite().fold(f64::NEG_INFINITY, f64::max) - finite().fold(f64::INFINITY, f64::min);
        let floor = noise.floor(&name, values).unwrap_or(0.0);
        let (begins, unit) = (values[first], joint.position_unit());
        ((begins - joint.start).abs() > (START_SHARE * range).max(START_FLOORS * floor)).then(|| {
            let sentence = format!(
                "{name} begins at {begins:.3} {unit}, but the test and its simulations begin at {:.3} {unit}",
                joint.start
            );
            Finding::new(Topic::Start, Severity::Bad, &name, sentence)
        })
    };
    robot.movable().filter_map(|(_, link)| finding(&link.joint)).collect()
}

/// Finding for compared joints that are not in the log.
fn absent(experiment: &Experiment, log: &Log) -> Option<Finding> {
    let compared = experiment.plan.distance.channels()?;
    let joints = experiment.model.robot.movable().map(|(_, link)| &link.joint).filter(|joint| joint.mimic.is_none());
    let names = joints.map(|joint| format!("q_{}", joint.name));
    let absent: Vec<String> = names.filter(|name| compared.contains(name) && log.channel(name).is_none()).collect();
    let first = absent.first()?;
    let (all, are) = (absent.join(", "), if absent.len() == 1 { "is" } else { "are" });
    let sentence = format!("{all} {are} not in its log, and not compared");
    Some(Finding::new(Topic::Missing, Severity::Doubtful, first, sentence))
}

fn recorded_badly(experiment: &Experiment, real: &Behaviour) -> Vec<Finding> {
    let (robot, noise) = (&experiment.model.robot, &experiment.model.setup.noise);
    let glitches = if robot.base == Base::Fixed { find_glitches(&real.log) } else { Vec::new() };
    let quality = quality(&real.log, glitches, robot, noise);
    let of_recording = [Topic::Clock, Topic::Missing, Topic::Dead, Topic::Unit, Topic::Sign, Topic::CommandLag];
    let bad = |finding: &Finding| finding.severity == Severity::Bad && of_recording.contains(&finding.topic);
    let told = |finding: &&Finding| bad(finding) || finding.topic == Topic::Glitches;
    quality.findings.iter().filter(told).cloned().collect()
}
