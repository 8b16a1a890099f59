//! What a quality check of a log finds.

use btr_core::signal::dead_time::DeadTime;
use btr_core::signal::glitch::GlitchKind;
use btr_core::signal::lag::Lag;
use serde::{Deserialize, Serialize};

/// How bad a finding is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Severity {
    /// No problem.
    Fine,
    /// Results may be affected.
    Doubtful,
    /// Results that use it cannot be trusted.
    Bad,
}

/// What a finding is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Topic {
    /// Rate, jitter.
    Clock,
    /// Gaps in the clock.
    Gaps,
    /// Missing samples.
    Missing,
    /// Readings that no motion explains.
    Glitches,
    /// A channel that never changes.
    Dead,
    /// A channel that is at the end of its range.
    Saturation,
    /// Noise or quantisation steps that are large compared with the motion.
    Noise,
    /// Values that look like another unit.
    Unit,
    /// Positions that a joint cannot have.
    Limits,
    /// A joint whose command has no actuator.
    Actuator,
    /// A sign that contradicts that of a related channel.
    Sign,
    /// How late a joint follows its command.
    CommandLag,
    /// How much of that is dead time.
    DeadTime,
    /// A command that excites little.
    Excitation,
    /// A log that does not begin where it should.
    Start,
}

/// What may be behind a finding, where something acts on that.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FindingCause {
    /// A channel is in degrees instead of radians.
    Degrees,
    /// A joint counts the other way round than its command or its velocity.
    Reversed,
    /// A joint follows its command later than servos do.
    Late,
}

/// One result of a quality check.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Its topic.
    pub topic: Topic,
    /// Its severity.
    pub severity: Severity,
    /// The channel or joint; empty for the clock.
    pub channel: String,
    /// Its description, one sentence.
    pub sentence: String,
    /// What may be behind it.
    #[serde(skip)]
    pub cause: Option<FindingCause>,
}

impl Finding {
    /// A finding about a channel or joint.
    pub fn new(topic: Topic, severity: Severity, channel: &str, sentence: String) -> Self {
        Finding { topic, severity, channel: channel.to_owned(), sentence, cause: None }
    }

    /// The same with what may be behind it.
    #[must_use]
    pub fn because(self, cause: FindingCause) -> Self {
        Finding { cause: Some(cause), ..self }
    }
}

/// A glitch of a channel.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct GlitchReport {
    /// The channel.
    pub channel: String,
    /// What it looks like.
    pub kind: GlitchKind,
    /// Its first sample.
    pub sample: usize,
    /// Number of samples.
    pub samples: usize,
    /// Time of its first sample by the log's clock, in s.
    pub time_s: f64,
    /// The reading that departs most, in the channel's unit.
    pub value: f64,
    /// What the readings around it predict for that sample, in the channel's unit.
    pub expected: f64,
    /// Whether all positions repeat their samples before: a message was lost.
    pub lost_message: bool,
    /// Whether its samples were left out.
    pub left_out: bool,
}

impl GlitchReport {
    /// The same in a log that begins this many samples and seconds earlier.
    #[must_use]
    pub fn later(self, samples: usize, seconds: f64) -> Self {
        GlitchReport { sample: self.sample + samples, time_s: self.time_s + seconds, ..self }
    }

    /// The sample after its last one.
    pub(super) fn end(&self) -> usize {
        self.sample + self.samples
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
    /// Steps longer than three usual ones: their begin and their length, in s.
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
    /// Share of missing samples.
    pub missing: f64,
    /// Smallest value.
    pub min: f64,
    /// Largest value.
    pub max: f64,
    /// Standard deviation of the readings' errors, steps included; `None` for commands and with too few readings.
    pub noise: Option<f64>,
    /// The readings' step; `None` where there is none.
    pub quantum: Option<f64>,
    /// Share of the samples at the smallest or the largest value.
    pub at_ends: f64,
}

/// How a joint follows its command.
#[derive(Clone, Debug, PartialEq)]
pub struct CommandResponse {
    /// The joint.
    pub joint: String,
    /// Its lag; `None` where it does not follow at all.
    pub lag: Option<Lag>,
    /// What its steps from rest say of its dead time; `None` where it is not commanded in positions.
    pub dead_time: Option<DeadTime>,
}

/// The result of a quality check.
#[derive(Clone, Debug, PartialEq)]
pub struct Quality {
    /// The clock.
    pub clock: ClockReport,
    /// Readings of joint positions and torques that no motion explains, channel by channel.
    pub glitches: Vec<GlitchReport>,
    /// Commands and sensors.
    pub sensors: Vec<SensorReport>,
    /// Joints with a command and a position.
    pub joints: Vec<CommandResponse>,
    /// All findings, worst first.
    pub findings: Vec<Finding>,
}

impl Quality {
    /// The worst severity.
    pub fn worst(&self) -> Severity {
        self.findings.iter().map(|finding| finding.severity).max().unwrap_or(Severity::Fine)
    }

    /// The findings that are not [`Severity::Fine`], worst first.
    pub fn doubts(&self) -> impl Iterator<Item = &Finding> {
        self.findings.iter().filter(|finding| finding.severity > Severity::Fine)
    }

    /// Adds findings from other checks.
    pub fn add(&mut self, found: impl IntoIterator<Item = Finding>) {
        self.findings.extend(found);
        self.findings.sort_by_key(|finding| std::cmp::Reverse(finding.severity));
    }
}
