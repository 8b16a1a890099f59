//! The command line as it is typed.

use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Args as ClapArgs, CommandFactory, Error, Parser, Subcommand};
use clap_complete::Shell;
use std::ffi::OsString;
use std::path::PathBuf;

/// What people come for.
const JOURNEYS: &str = "A model and logs of the robot: where is it wrong, what is missing, does the error fall?
  btr check    robots/arm.toml robots/arm/learn_*.csv
  btr compare  robots/arm.toml robots/arm/learn_*.csv --report where.html
  btr diagnose robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv
  btr fit      robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv \\
               --add coulomb_friction@yaw -o fitted.toml

A controller to be found, and a simulation with it:
  btr coevolve robots/nao.toml --out runs/nao";

/// How logs are given to a verb that learns from some and judges on others.
macro_rules! beside_usage {
    ($verb:literal) => {
        concat!("btr ", $verb, " [OPTIONS] <MODEL> <LOG>... [--held-out <LOG>...]")
    };
}

/// Evolve robot controllers and their simulator against each other.
///
/// Controllers are found in simulation, a few are tried in reality, and what they really did is used to find a better
/// simulation, again and again.
#[derive(Parser)]
#[command(name = "btr", version, after_help = JOURNEYS)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(crate) global: Global,
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

impl Args {
    /// What was typed; a mistake is told as clap tells it, with what clap cannot know.
    pub(crate) fn of(typed: Vec<OsString>) -> Result<Self, Error> {
        let with_held_out = typed.iter().any(|argument| argument == "--held-out");
        Args::try_parse_from(typed).map_err(|mut error| {
            let tip = match error.kind() {
                ErrorKind::MissingRequiredArgument if with_held_out => {
                    Some("put the logs before --held-out, which takes whatever follows".to_owned())
                }
                ErrorKind::InvalidSubcommand => Some(format!("verbs: {}", verbs().join(", "))),
                _ => None,
            };
            if let Some(tip) = tip {
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            }
            error
        })
    }
}

/// The verbs that are not hidden.
fn verbs() -> Vec<String> {
    let command = Args::command();
    command.get_subcommands().filter(|verb| !verb.is_hide_set()).map(|verb| verb.get_name().to_owned()).collect()
}

/// Options of every verb.
#[derive(ClapArgs)]
pub(crate) struct Global {
    /// Print one JSON document on stdout instead of tables
    #[arg(long, global = true)]
    pub(crate) json: bool,
    /// Say nothing but the result
    #[arg(short, long, global = true)]
    pub(crate) quiet: bool,
    /// Say more: every generation, every warning
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    /// Threads to use; all cores unless given. The result is the same for any number
    #[arg(short = 'j', long, global = true, env = "BTR_THREADS", value_name = "N")]
    pub(crate) threads: Option<usize>,
    /// Seed of every random number; wins over the file's
    #[arg(long, global = true, value_name = "N")]
    pub(crate) seed: Option<u64>,
    /// Change a value of the file: dotted key, TOML value
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
    /// Run a model: replay a log's commands, or its own drive
    #[command(after_help = "Example:\n  btr simulate robots/nao.toml -o walk.mcap")]
    Simulate(SimulateArgs),
    /// Judge logs before anything is fitted to them: clock, sensors, lags, and which numbers in doubt they can tell
    #[command(after_help = "Example:\n  btr check leg.toml monday.mcap tuesday.csv\n\n\
        Exit code 1 where something in a log is bad: nothing that uses it can be trusted.")]
    Check(CheckArgs),
    /// Tell where a model fails: per channel, per joint and regime of motion
    #[command(after_help = "Examples:\n  btr compare leg.toml monday.mcap\n  \
        btr compare leg.toml logs/*.csv --report where.html --max-chi 1.5")]
    Compare(CompareArgs),
    /// Find out which physical effect the model lacks
    #[command(
        override_usage = beside_usage!("diagnose"),
        after_help = "Examples:\n  btr diagnose robots/arm.toml robots/arm/learn_*.csv --held-out robots/arm/held_out_*.csv\n  \
        btr diagnose arm.toml monday.mcap --report why.html\n\n\
        Without --held-out the last three tenths of each log are held out."
    )]
    Diagnose(DiagnoseArgs),
    /// Write an effect into a model, free to fit
    #[command(after_help = "Example:\n  btr add arm.toml coulomb_friction@elbow -o arm2.toml")]
    Add(AddArgs),
    /// Fit what is in doubt to logs, and see the error fall
    #[command(
        override_usage = beside_usage!("fit"),
        after_help = "Example:\n  btr fit arm.toml monday.mcap --add coulomb_friction@elbow -o fitted.toml --report fit.html"
    )]
    Fit(FitArgs),
    /// List the physical effects, or tell all about one
    #[command(after_help = "Example:\n  btr effects coulomb_friction")]
    Effects {
        /// The effect
        name: Option<String>,
    },
    /// Tell what a log holds; without a log, what btr knows: drives, distances, searches, fitness terms
    #[command(after_help = "Example:\n  btr info walk.mcap")]
    Info {
        /// A log (MCAP or CSV)
        log: Option<PathBuf>,
    },
    /// Convert a log between CSV and MCAP
    #[command(after_help = "Example:\n  btr convert walk.csv walk.mcap")]
    Convert {
        /// The log to read
        from: PathBuf,
        /// The log to write; its ending chooses the format
        to: PathBuf,
    },
    /// Print the JSON schema of model and experiment files
    #[command(after_help = "Example:\n  btr schema > btr.schema.json")]
    Schema,
    /// Print a shell's completions
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
    /// Folder of the run; runs/NAME unless given
    #[arg(long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Go on with the run in that folder
    #[arg(long)]
    pub(crate) resume: bool,
    /// Check the experiment, say what it would do, and stop
    #[arg(long)]
    pub(crate) dry_run: bool,
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
    /// Where to write what the sensors say; .mcap or .csv
    #[arg(short, long, value_name = "LOG")]
    pub(crate) output: PathBuf,
    /// Write over a log that is there
    #[arg(long)]
    pub(crate) overwrite: bool,
}

#[derive(ClapArgs)]
pub(crate) struct CheckArgs {
    /// The model or experiment (TOML)
    pub(crate) model: PathBuf,
    /// Recorded logs (MCAP or CSV)
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
}

#[derive(ClapArgs)]
pub(crate) struct CompareArgs {
    /// The model or experiment (TOML)
    pub(crate) model: PathBuf,
    /// Recorded logs (MCAP or CSV)
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Write plots of everything into one HTML file
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
    /// End with exit code 1 when a channel's error is above so many noise floors
    #[arg(long, value_name = "X", allow_negative_numbers = true)]
    pub(crate) max_chi: Option<f64>,
}

#[derive(ClapArgs)]
pub(crate) struct LogArgs {
    /// The model (TOML)
    pub(crate) model: PathBuf,
    /// The logs to learn from (MCAP or CSV)
    #[arg(required = true, value_name = "LOG")]
    pub(crate) logs: Vec<PathBuf>,
    /// Logs to judge on, which nothing is fitted to; after MODEL and LOG, as it takes whatever follows
    #[arg(long, num_args = 1.., value_name = "LOG")]
    pub(crate) held_out: Vec<PathBuf>,
    /// Write what was found and plots of it into one HTML file
    #[arg(long, value_name = "HTML")]
    pub(crate) report: Option<PathBuf>,
}

impl LogArgs {
    /// Every log that is read.
    pub(crate) fn all_logs(&self) -> impl Iterator<Item = PathBuf> {
        self.logs.iter().chain(&self.held_out).cloned()
    }
}

#[derive(ClapArgs)]
pub(crate) struct DiagnoseArgs {
    #[command(flatten)]
    pub(crate) logs_args: LogArgs,
    /// The most effects to name
    #[arg(long, value_name = "N", default_value_t = 3)]
    pub(crate) max_effects: usize,
    /// Where to write the commands of the experiment that would tell apart what these logs cannot; .csv or .mcap
    #[arg(long, value_name = "LOG")]
    pub(crate) next: Option<PathBuf>,
    /// Exit with 1 unless this is the verdict: effect_missing, nothing_missing or unexplained
    #[arg(long, value_name = "VERDICT")]
    pub(crate) expect: Option<String>,
}

#[derive(ClapArgs)]
pub(crate) struct AddArgs {
    /// The model (TOML)
    pub(crate) model: PathBuf,
    /// What to add; without a site it sits everywhere it can
    #[arg(required = true, value_name = "EFFECT[@SITE]")]
    pub(crate) effects: Vec<String>,
    /// Where to write the model
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: PathBuf,
}

#[derive(ClapArgs)]
pub(crate) struct FitArgs {
    #[command(flatten)]
    pub(crate) logs_args: LogArgs,
    /// An effect to add first
    #[arg(long, value_name = "EFFECT[@SITE]")]
    pub(crate) add: Vec<String>,
    /// Where to write the fitted model
    #[arg(short, long, value_name = "MODEL")]
    pub(crate) output: Option<PathBuf>,
}
