//! The command line's arguments.

use btr_lab::experiment::DamagedLogs;
use btr_lab::export::{FORMATS, Format};
use clap::builder::{PossibleValue, PossibleValuesParser};
use clap::{Args as ClapArgs, Parser, Subcommand};
use clap_complete::Shell;
use std::path::PathBuf;
use std::time::Duration;

/// Examples of the main workflows, below the help.
const WORKFLOWS: &str = "Make a model file of a robot's URDF, xacro or MuJoCo model, and of a log:
  btr new arm.urdf monday.csv -o arm.toml

Diagnose and fit a model against logs of the robot:
  btr check    robots/arm.toml robots/arm/learn_*.csv
  btr compare  robots/arm.toml robots/arm/learn_*.csv --report where.html
  btr diagnose robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv
  btr fit      robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv \\
               --add coulomb_friction@yaw -o fitted.toml
or do all that on a page in the browser (pip install 'btr[studio]'):
  btr studio   robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv

Evolve a controller and its simulation:
  btr coevolve robots/nao.toml --out runs/nao";

/// What btr is for.
const ABOUT: &str = "Find out where a robot's simulation is wrong, and why: which joint, which physical effect, which value. \
                     Or evolve controllers and their simulator against each other, with a few tests on the robot.";

/// Usage of a verb with training logs and held-out logs.
macro_rules! held_out_usage {
    ($verb:literal) => {
        concat!("btr ", $verb, " [OPTIONS] <MODEL> <LOG>... [--held-out <LOG>...]")
    };
}

/// The arguments of an invocation.
#[derive(Parser)]
#[command(name = "btr", version, about = ABOUT, after_help = WORKFLOWS)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// Options of every verb.
#[derive(ClapArgs)]
pub(crate) struct Global {
    /// Print one JSON document on stdout instead of tables
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Print nothing but the result
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Print more: every generation, all warnings, all failures
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    /// Number of threads [default: all cores]. Results do not depend on it
    #[arg(short = 'j', long, global = true, env = "BTR_THREADS", value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Random seed; overrides the file's
    #[arg(long, global = true, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Override a value of the file: dotted key, TOML value
    #[arg(long = "set", global = true, value_name = "KEY=VALUE")]
    pub(crate) settings: Vec<String>,
}

#[derive(Subcommand)]
pub(crate) enum Verb {
    /// Run the Back-to-Reality loop of an experiment
    #[command(
        after_help = "Examples:\n  btr coevolve robots/nao.toml\n  btr coevolve robots/ant.toml --seed 7 --out runs/ant-7\n  \
        btr coevolve robots/ant.toml --seed 7 --out runs/ant-7 --resume"
    )]
    Coevolve(CoevolveArgs),
    /// Simulate a model: replay a log's commands, or run its own drive
    #[command(after_help = "Example:\n  btr simulate robots/nao.toml -o walk.mcap")]
    Simulate(SimulateArgs),
    /// Make a model file of a URDF, xacro or MuJoCo model, and of logs
    #[command(after_help = "Examples:\n  btr new arm.urdf monday.csv -o arm.toml\n  btr new scene.xml -o arm.toml\n\n\
        Logs may have any column names: joints, quantities and units are matched by names and ranges, and what is guessed \
        is told. MuJoCo models need Python with btr[mujoco], xacro files the program or the Python package xacro.")]
    New(NewArgs),
    /// Judge logs: clock, sensors, lags, which parameters they identify
    #[command(after_help = "Example:\n  btr check leg.toml monday.mcap tuesday.csv\n\n\
        Exit code 1 if a log has a bad finding, or cannot be used at all: results based on it cannot be trusted.")]
    Check(CheckArgs),
    /// Show where a model fails: which joint, how much, in which motion
    #[command(after_help = "Examples:\n  btr compare leg.toml monday.mcap\n  \
        btr compare leg.toml logs/*.csv --report where.html --max-chi 1.5")]
    Compare(CompareArgs),
    /// Find the physical effect that the model lacks
    #[command(
        override_usage = held_out_usage!("diagnose"),
        after_help = "Examples:\n  btr diagnose robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv\n  \
        btr diagnose arm.toml monday.mcap --report why.html\n\n\
        Without --held-out, the last 30 % of each log are held out."
    )]
    Diagnose(DiagnoseArgs),
    /// Add an effect to a model, with free parameters
    #[command(after_help = "Example:\n  btr add arm.toml coulomb_friction@elbow -o arm2.toml")]
    Add(AddArgs),
    /// Fit the free parameters of a model to logs
    #[command(
        override_usage = held_out_usage!("fit"),
        after_help = "Examples:\n  btr fit arm.toml monday.mcap --add coulomb_friction@elbow -o fitted.toml --report fit.html\n  \
        btr diagnose arm.toml monday.mcap -o found.toml && btr fit arm.toml monday.mcap --from found.toml -o fitted.toml"
    )]
    Fit(FitArgs),
    /// Write what a model says into files of other simulators
    #[command(after_help = "Examples:\n  btr export fitted.toml robot.xml --to mujoco -o robot_fitted.xml\n  \
        btr export fitted.toml --to urdf -o robot_fitted.urdf\n  \
        btr export fitted.toml --to isaac-lab -o actuators.py\n  \
        btr export fitted.toml --to ros2 -o joint_limits.yaml\n  \
        btr export fitted.toml robot.xml --to mujoco -o robot_fitted.xml --randomize fit.json --draws 50\n\n\
        A file that is changed keeps its comments and its layout. What a format cannot say is told, and its effects\n\
        are written as JSON beside the output (OUT.effects.json).")]
    Export(ExportArgs),
    /// Do all that on a local page: compare, diagnose, add, fit, save; or watch a run
    #[command(
        override_usage = concat!(held_out_usage!("studio"), "\n       btr studio [OPTIONS] <RUN>"),
        after_help = "Examples:\n  btr studio robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv\n  \
        btr studio runs/nao\n\n\
        Needs Python with btr[studio]. Only browsers that open the printed address are answered; Ctrl-C ends it."
    )]
    Studio(StudioArgs),
    /// List the physical effects, or describe one
    #[command(after_help = "Example:\n  btr effects coulomb_friction")]
    Effects {
        /// Name of an effect
        name: Option<String>,
    },
    /// Describe a log; without one, list drives, distances, searches
    #[command(after_help = "Examples:\n  btr info walk.mcap\n  btr info lerobot_folder#0 --model arm.toml")]
    Info {
        /// A log: MCAP, CSV, or an episode of a LeRobot data set (FOLDER#0)
        log: Option<PathBuf>,
        /// Read the log as this model does: its [channels] name columns and state their units
        #[arg(long, requires = "log")]
        model: Option<PathBuf>,
    },
    /// Convert a log between CSV and MCAP
    #[command(after_help = "Example:\n  btr convert walk.csv walk.mcap")]
    Convert {
        /// The log to read
        from: PathBuf,
        /// The log to write; its extension chooses the format
        to: PathBuf,
    },
    /// Print the JSON schema of model and experiment files
    #[command(after_help = "Example:\n  btr schema > btr.schema.json")]
    Schema,
    /// Print completions for a shell
    #[command(after_help = "Example:\n  btr completions bash > /etc/bash_completion.d/btr")]
    Completions {
        /// The shell
        shell: Shell,
    },
    /// Print the manual page
    #[command(hide = true)]
    Man,
}

#[derive(ClapArgs)]
pub(crate) struct CoevolveArgs {
    /// The experiment (TOML)
    pub(crate) experiment: PathBuf,
    /// Folder of the run [default: runs/NAME]
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Resume the run in that folder
    #[arg(long)]
    pub(crate) resume: bool,
    /// Check the experiment and print its plan without running it
    #[arg(long)]
    pub(crate) dry_run: bool,
    /// Show the run on a local page as it grows, until Ctrl-C (needs Python with btr[studio])
    #[arg(long)]
    pub(crate) studio: bool,
}

#[derive(ClapArgs)]
pub(crate) struct SimulateArgs {
    /// The model or experiment (TOML)
    pub(crate) model: PathBuf,
    /// Replay the commands of this log instead of the model's own drive
    #[arg(long, conflicts_with = "drive")]
    pub(crate) log: Option<PathBuf>,
    /// A file with a [drive] section to use instead of the model's own
    #[arg(long)]
    pub(crate) drive: Option<PathBuf>,
    /// Where to write the simulated log; .mcap or .csv
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: PathBuf,
    /// Overwrite an existing log
    #[arg(long)]
    pub(crate) overwrite: bool,
}

#[derive(ClapArgs)]
pub(crate) struct NewArgs {
    /// The robot: .urdf, .xacro, or .xml (URDF or MJCF)
    pub(crate) robot: PathBuf,
    /// Logs of the robot (CSV, MCAP, or a LeRobot data set's FOLDER), whose columns become its channels
    #[arg(value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Where to write the model; the URDF of a xacro file or MuJoCo model is written beside it
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: PathBuf,
    /// How the root is held, if the guess is wrong
    #[arg(long, value_parser = ["fixed", "floating"])]
    pub(crate) base: Option<String>,
    /// The first body of the robot in a MuJoCo scene with several
    #[arg(long, value_name = "BODY")]
    pub(crate) root: Option<String>,
    /// A folder with the packages of a URDF's meshes (package://NAME/...); as often as needed
    #[arg(long = "package-path", value_name = "DIR")]
    pub(crate) package_paths: Vec<PathBuf>,
    /// Overwrite an existing model
    #[arg(long)]
    pub(crate) overwrite: bool,
}

#[derive(ClapArgs)]
pub(crate) struct CheckArgs {
    /// The model or experiment (TOML)
    pub(crate) model: PathBuf,
    /// Recorded logs (MCAP or CSV); `-` is the standard input
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

/// How logs are read.
#[derive(ClapArgs)]
pub(crate) struct Reading {
    /// Keep readings that no motion explains (spikes, wrap-arounds, zeros, stuck sensors, lost messages) instead of
    /// leaving them out
    #[arg(long)]
    pub(crate) keep_glitches: bool,
    /// Refuse all logs if the content of one cannot be used, instead of leaving it out
    #[arg(long)]
    pub(crate) strict: bool,
}

impl Reading {
    /// What to do about a log whose content cannot be used, among others.
    pub(crate) fn damaged(&self) -> DamagedLogs {
        if self.strict { DamagedLogs::Refuse } else { DamagedLogs::LeaveOut }
    }
}

#[derive(ClapArgs)]
pub(crate) struct CompareArgs {
    /// The model or experiment (TOML)
    pub(crate) model: PathBuf,
    /// Recorded logs (MCAP or CSV); `-` is the standard input
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Write all plots into one HTML file
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
    /// Write the measured and the simulated robot into one MCAP file, for Foxglove and Rerun
    #[arg(short, long, value_name = "MCAP")]
    pub(crate) output: Option<PathBuf>,
    /// Exit with 1 if a channel's error exceeds X noise floors
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub(crate) max_chi: Option<f64>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

#[derive(ClapArgs)]
pub(crate) struct LogArgs {
    /// The model (TOML)
    pub(crate) model: PathBuf,
    /// Training logs (MCAP or CSV); `-` is the standard input
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Held-out logs, which are not fitted; put this option after MODEL and LOG: it takes all arguments that follow
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub(crate) held_out: Vec<PathBuf>,
    /// Keep the free parameters of this name at the model's values; `*` matches any characters: 'mass@*',
    /// 'coulomb_friction.*@*'
    #[arg(long, value_name = "PATTERN")]
    pub(crate) freeze: Vec<String>,
    /// Write the result and its plots into one HTML file
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
    #[command(flatten)]
    pub(crate) reading: Reading,
}

impl LogArgs {
    /// All logs, training and held-out.
    pub(crate) fn all_logs(&self) -> impl Iterator<Item = PathBuf> {
        self.logs.iter().chain(&self.held_out).cloned()
    }
}

#[derive(ClapArgs)]
pub(crate) struct DiagnoseArgs {
    #[command(flatten)]
    pub(crate) logs_args: LogArgs,
    /// Maximum number of effects to name; usually 3, or 4 per joint where the motion of all joints is prescribed
    #[arg(long, value_name = "N")]
    pub(crate) max_effects: Option<usize>,
    /// Where to write the model as the diagnosis leaves it, whatever the verdict: with the effects that were found, at
    /// their fitted values; .toml
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Option<PathBuf>,
    /// Stop searching after this time and report the best so far, as Ctrl-C does
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    pub(crate) max_time: Option<Duration>,
    /// Stop searching after about as many simulated logs and report the best so far; usually 850 per joint, of at least
    /// four joints, and per effect that may be named; without limit for floating robots
    #[arg(long, value_name = "N")]
    pub(crate) max_rollouts: Option<usize>,
    /// Where to write the commands of the next experiment, which separates effects that these logs cannot; .csv or
    /// .mcap
    #[arg(long, value_name = "LOG")]
    pub(crate) next: Option<PathBuf>,
    /// Exit with 1 unless the verdict is this one: effect_missing, value_wrong, partly_explained, nothing_missing or
    /// unexplained
    #[arg(long, value_name = "VERDICT")]
    pub(crate) expect: Option<String>,
}

#[derive(ClapArgs)]
pub(crate) struct AddArgs {
    /// The model (TOML)
    pub(crate) model: PathBuf,
    /// Effects to add; without a site, at every possible site with values of its own (`@*` shares one value)
    #[arg(required = true, value_name = "EFFECT[@SITE]")]
    pub(crate) effects: Vec<String>,
    /// Where to write the model
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: PathBuf,
}

#[derive(ClapArgs)]
pub(crate) struct ExportArgs {
    /// The model (TOML), fitted or not
    pub(crate) model: PathBuf,
    /// Your robot's file that is to be changed: MJCF or URDF [default: the model's URDF, for `--to urdf`]
    pub(crate) robot: Option<PathBuf>,
    /// The format
    #[arg(long, value_name = "FORMAT", value_parser = formats())]
    pub(crate) to: String,
    /// Physics step of the other simulator, in which Isaac Lab counts delays
    #[arg(long, value_name = "SECONDS", default_value = "0.005", value_parser = seconds)]
    pub(crate) step: Duration,
    /// Also write what the fit of the model leaves uncertain, for domain randomisation: the document of `btr fit
    /// --json`. MJCF and URDF get a file for each draw (OUT.000.xml), Isaac Lab ranges
    #[arg(long, value_name = "FIT_JSON")]
    pub(crate) randomize: Option<PathBuf>,
    /// How many draws are written; `--seed` chooses others
    #[arg(long, value_name = "N", default_value_t = 10, requires = "randomize", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) draws: u32,
    /// Where to write
    #[arg(short, long, value_name = "OUT")]
    pub(crate) output: PathBuf,
}

#[derive(ClapArgs)]
pub(crate) struct FitArgs {
    #[command(flatten)]
    pub(crate) logs_args: LogArgs,
    /// Effect to add before fitting; without a site, at every possible site with values of its own (`@*` shares one)
    #[arg(long, value_name = "EFFECT[@SITE]")]
    pub(crate) add: Vec<String>,
    /// Begin at the values that this model states for the parameters, and add the effects that it has as free
    /// parameters: a model of the same robot that `diagnose -o` or `fit -o` wrote. Bounds and priors stay MODEL's
    #[arg(long, value_name = "FITTED")]
    pub(crate) from: Option<PathBuf>,
    /// Also estimate the base parameters of an arm whose motion is prescribed: the combinations of masses, moments,
    /// inertias, friction and rotors that the logs can tell
    #[arg(long)]
    pub(crate) base_parameters: bool,
    /// Where to write the fitted model
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Option<PathBuf>,
}

#[derive(ClapArgs)]
pub(crate) struct StudioArgs {
    /// The model (TOML), or the folder of a run of `btr coevolve`
    pub(crate) model: PathBuf,
    /// Training logs (MCAP or CSV); none for a run
    #[arg(value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Held-out logs, which are not fitted; put this option after MODEL and LOG: it takes all arguments that follow
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub(crate) held_out: Vec<PathBuf>,
    /// The file that a run began with, if it names others, such as a URDF
    #[arg(long, value_name = "FILE")]
    pub(crate) experiment: Option<PathBuf>,
    /// Where the page saves models, reports and scripts [default: here]
    #[arg(long, value_name = "DIR")]
    pub(crate) folder: Option<PathBuf>,
    /// Where it listens [default: 127.0.0.1, this machine alone]
    #[arg(long, value_name = "ADDRESS")]
    pub(crate) host: Option<String>,
    /// The first port to try [default: 8080]
    #[arg(long, value_name = "N")]
    pub(crate) port: Option<u16>,
    /// Print the address only, without opening the browser
    #[arg(long)]
    pub(crate) no_browser: bool,
}

fn formats() -> PossibleValuesParser {
    let value = |format: &Format| PossibleValue::new(format.name).help(format.what);
    PossibleValuesParser::new(FORMATS.iter().map(value))
}

/// A time that is longer than nothing.
fn seconds(text: &str) -> Result<Duration, String> {
    let time = text.parse::<f64>().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    time.filter(|time| !time.is_zero()).ok_or_else(|| "give a number of seconds above 0".to_owned())
}
