//! `[reality]`.

use super::logs::LogsSection;
use super::parameters::EffectSection;
use super::simulation::NoiseSection;
use indexmap::IndexMap;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Where the truth comes from.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RealitySection {
    /// A simulation that nobody looks into before the end.
    Twin(TwinSection),
    /// What a robot did on other days.
    Logs(LogsSection),
    /// A program that runs one test.
    Command(CommandSection),
    /// A person at the robot: the run stops after writing what is to be tried, and goes on with `--resume`.
    Manual {},
}

/// A hidden twin.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct TwinSection {
    /// Its parameters: `nominal`, `random` (drawn from the seed within S), or values by name (the others nominal).
    pub parameters: TwinParameters,
    /// With `random`: the share of the bounds, around their middle, that is drawn from.
    pub spread: Option<f64>,
    /// Effects that the model does not have.
    pub effects: Vec<EffectSection>,
    /// Finer physics than the model's: steps between two references.
    pub steps_per_control: Option<u32>,
    /// Its sensors' noise.
    pub noise: NoiseSection,
    /// How it changes during the run, in this order.
    pub drift: Vec<DriftSection>,
}

/// A change of the twin: from then on it is another robot.
#[derive(Clone, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DriftSection {
    /// Number of the first real test of the changed robot, from 0.
    pub test: usize,
    /// Factors on parameters of S, by name.
    pub times: IndexMap<String, f64>,
    /// Effects that it has besides from then on.
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
    /// Ending of the log it writes.
    #[serde(default = "csv")]
    pub log: String,
    /// After so many seconds a try is given up.
    pub timeout_s: f64,
    /// How often a failed try is repeated.
    #[serde(default)]
    pub retries: u32,
}

fn csv() -> String {
    "csv".to_owned()
}

/// What answers real tests.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum RealitySource {
    /// The `[reality]` of the file.
    File,
    /// A function that replaces the `[reality]` of the file.
    Function,
}
