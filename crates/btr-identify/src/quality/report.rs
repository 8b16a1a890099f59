//! What a quality check of a log finds.

use btr_core::signal::lag::Lag;
use serde::{Deserialize, Serialize};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// As it should be.
    Fine,
    /// Results may suffer.
    Doubtful,
    /// Nothing that uses it can be trusted.
    Bad,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// Rate, jitter.
    Clock,
    /// Holes in the clock.
    Gaps,
    /// Samples that are not there.
    Missing,
    /// A channel that never changes.
    Dead,
    /// A channel that stands at its end.
    Saturation,
    /// Noise or steps that are large beside the motion.
    Noise,
    /// Numbers that look like another unit.
    Unit,
    /// Positions that a joint cannot have.
    Limits,
    /// A joint whose command has no actuator.
    Actuator,
    /// A sign that contradicts that of a related channel.
    Sign,
    /// How late a joint follows its command.
    CommandLag,
    /// A command that excites little.
    Excitation,
    /// A log that does not begin where it should.
    Start,
}

/// One thing that was found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What it is about.
    pub topic: Topic,
    /// How bad it is.
    pub severity: Severity,
    /// The channel or joint; empty for the clock.
    pub channel: String,
    /// In one sentence.
    pub sentence: String,
}

impl Finding {
    /// Something that was found.
    pub fn new(topic: Topic, severity: Severity, channel: &str, sentence: String) -> Self {
        Finding { topic, severity, channel: channel.to_owned(), sentence }
    }
}

/// The clock of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ClockReport {
    /// Samples.
    pub samples: usize,
    /// From the first to the last, in s.
    pub duration_s: f64,
    /// Usual rate, in 1/s; 0 with fewer than two samples.
    pub rate_hz: f64,
    /// Standard deviation of the usual steps, in s.
    pub jitter_s: f64,
    /// Steps longer than three usual ones: when they begin and how long they are, in s.
    pub gaps: Vec<(f64, f64)>,
    /// Steps shorter than a tenth of the usual one: the same sample twice, most likely.
    pub duplicates: usize,
}

/// A channel of a log.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SensorReport {
    /// Its name.
    pub name: String,
    /// SI unit as text.
    pub unit: String,
    /// Share of the samples that are not there.
    pub missing: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Standard deviation of the readings' errors, steps included; `None` for commands and with too few readings.
    pub noise: Option<f64>,
    /// The readings' step; `None` where there is none.
    pub quantum: Option<f64>,
    /// Share of the samples that stand at the smallest or the largest value.
    pub at_ends: f64,
}

/// How a joint follows its command.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandResponse {
    /// The joint.
    pub joint: String,
    /// How late; `None` where it does not follow at all.
    pub lag: Option<Lag>,
}

/// All that was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// The clock.
    pub clock: ClockReport,
    /// Commands and sensors.
    pub sensors: Vec<SensorReport>,
    /// Joints with a command and a position.
    pub joints: Vec<CommandResponse>,
    /// What is to be said about all of them, worst first.
    pub findings: Vec<Finding>,
}

impl Quality {
    /// The worst that was found.
    pub fn worst(&self) -> Severity {
        self.findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Fine)
    }

    /// What makes results doubtful, worst first.
    pub fn doubts(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| finding.severity > Severity::Fine)
    }

    /// Adds findings from other checks.
    pub fn add(&mut self, found: impl IntoIterator<Item = Finding>) {
        self.findings.extend(found);
        self.findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    }
}
