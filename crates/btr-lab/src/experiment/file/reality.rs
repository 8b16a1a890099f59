//! `[reality]`.

use super::logs::LogsSection;
use super::parameters::EffectSection;
use super::simulation::NoiseSection;
use crate::reality::StopSignal;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// How real tests are carried out.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RealitySection {
    /// A simulation whose parameters are hidden until the end of the run.
    Twin(TwinSection),
    /// Recorded logs of a robot.
    Logs(LogsSection),
    /// A program that runs one test.
    Command(CommandSection),
    /// A person operates the robot: the run writes the test to carry out and stops, and continues with `--resume`.
    Manual {},
}

/// A hidden twin.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TwinSection {
    /// Its parameters: `nominal`, `random` (drawn within S with the seed), or values by name (the others nominal).
    pub parameters: TwinParameters,
    /// With `random`: the share of the range, around its midpoint, from which parameters are drawn.
    pub spread: Option<f64>,
    /// Effects that the model does not have.
    pub effects: Vec<EffectSection>,
    /// Physics steps between two references; default: those of the model.
    pub steps_per_control: Option<u32>,
    /// Noise of its sensors.
    pub noise: NoiseSection,
    /// Its changes during the run, in order.
    pub drift: Vec<DriftSection>,
}

/// A change of the twin during the run.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DriftSection {
    /// Number of the first real test after the change, from 0.
    pub test: usize,
    /// Factors by which parameters of S are multiplied, by name.
    pub times: IndexMap<String, f64>,
    /// Effects that are added.
    pub effects: Vec<EffectSection>,
}

/// How the twin's parameters are chosen.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(untagged, expecting = "expected \"nominal\", \"random\", or values by name: { NAME = value }")]
pub enum TwinParameters {
    /// `nominal` or `random`.
    Word(String),
    /// Values by name, in the units of S.
    Values(IndexMap<String, f64>),
}

impl Default for TwinParameters {
    fn default() -> Self {
        TwinParameters::Word("random".to_owned())
    }
}

/// A program that runs one test.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandSection {
    /// The program and its arguments; `{trial}` stands for the file with the controller, `{references}` for the CSV of
    /// joint references, `{log}` for the file to write (`.csv` or `.mcap`).
    pub run: Vec<String>,
    /// Extension of the log that it writes: `csv` or `mcap`.
    #[serde(default = "csv")]
    pub log: String,
    /// Time after which an attempt is aborted, in s.
    pub timeout_s: f64,
    /// How often a failed attempt is repeated.
    #[serde(default)]
    pub retries: u32,
    /// What asks the program and all processes that it started to end, after the time-out or when the run is
    /// interrupted: `sigterm` or `sigint`.
    #[serde(default)]
    pub stop_signal: StopSignal,
    /// Time from that signal to SIGKILL, in s.
    #[serde(default = "five")]
    pub stop_s: f64,
    /// A program that makes the robot safe, with its arguments (as in `run`): run after every attempt that gave no
    /// usable log, once nothing of that is left.
    #[serde(default)]
    pub on_stop: Vec<String>,
    /// Time after which that program is aborted, in s.
    #[serde(default = "ten")]
    pub on_stop_timeout_s: f64,
}

fn five() -> f64 {
    5.0
}

fn ten() -> f64 {
    10.0
}

fn csv() -> String {
    "csv".to_owned()
}

/// What carries out real tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RealitySource {
    /// The `[reality]` of the file.
    File,
    /// A function that replaces the `[reality]` of the file.
    Function,
}
