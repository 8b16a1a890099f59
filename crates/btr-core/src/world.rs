//! Interfaces to what co-evolution acts on: a family of simulations, and a reality.
//!
//! A simulation that diverges scores as the worst possible, is counted and reported; it never ends a run.

use crate::log::{Log, LogError};
use crate::space::{Space, SpaceError};
use crate::text::Text;
use serde::{Deserialize, Serialize};

/// A behaviour B(E, c): the recorded log and its fitness.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Behaviour {
    /// The sensorimotor history.
    pub log: Log,
    /// f(B): larger is better. Its unit is the experimenter's.
    pub fitness: f64,
}

/// Why a simulation gave no behaviour.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum WorldError {
    /// The simulation diverged: its state stopped being finite or left every sensible range.
    #[error("the simulation diverged at t = {} s: {what}", rounded(*time_s))]
    Diverged {
        /// Simulated time at which it was noticed.
        time_s: f64,
        /// Which quantity, on which body.
        what: String,
    },
    /// A user-defined law that returned no finite number.
    #[error("{what}")]
    Law {
        /// Which law, what it gave, and of what.
        what: String,
    },
    /// A set-up that cannot be simulated: a site that does not exist, a time step that does not fit.
    #[error("cannot simulate this: {what}")]
    Setup {
        /// What does not fit.
        what: String,
    },
    /// A point that is not in its space.
    #[error(transparent)]
    Space(#[from] SpaceError),
    /// A log that lacks something.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The work was cancelled before this simulation began.
    #[error(transparent)]
    Cancelled(#[from] Cancelled),
}

/// The work was cancelled: its results so far are incomplete and are discarded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the work was cancelled")]
pub struct Cancelled;

/// To a tenth of a millisecond.
fn rounded(time_s: f64) -> f64 {
    (1e4 * time_s).round() / 1e4
}

/// A number that is read off a log, for instance a distance walked.
///
/// # Errors
/// A channel that the log lacks.
pub type Measure = fn(&Log) -> Result<f64, LogError>;

/// A family of simulations and the task set in them.
///
/// `scenario` counts the situations in which controllers are tried: recorded drives, terrains, initial conditions. Most
/// experiments have one.
pub trait Simulator: Sync {
    /// S: the simulations.
    fn simulations(&self) -> &Space;
    /// C: the controllers; empty when the drive is fixed.
    fn controllers(&self) -> &Space;
    /// Number of scenarios, at least 1.
    fn scenarios(&self) -> usize;
    /// Runs controller `c` in simulation `s`. The same arguments give the same bits.
    ///
    /// # Errors
    /// A point outside its space, or a simulation that diverged.
    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError>;
    /// The measure of a behaviour's log with this name; `None` if there is none.
    fn measure(&self, name: &str) -> Option<Measure> {
        let _ = name;
        None
    }
    /// Number of runs that are best requested at once.
    fn side_by_side(&self) -> usize {
        1
    }
    /// What [`run`](Self::run) gives for each job, bit by bit, in the order of the jobs. Those that follow each other
    /// in one scenario may be simulated side by side.
    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        jobs.iter().map(|job| self.run(job.s, job.c, job.scenario)).collect()
    }
    /// The requested output of each job, in the order of the jobs. An executor in another process need not send back
    /// whole behaviours where only a number is requested.
    fn evaluate_all(&self, jobs: &[Job], requests: &[OutputRequest]) -> Vec<Result<Output, WorldError>> {
        self.run_all(jobs).into_iter().zip(requests).map(|(behaviour, request)| Ok(request.of(behaviour?))).collect()
    }
}

/// Requested output of a simulation.
#[derive(Clone, Copy)]
pub enum OutputRequest<'a> {
    /// All of it.
    Behaviour,
    /// Its fitness.
    Fitness,
    /// How far it is from a real one.
    Distance(Reference<'a>),
}

/// A real test that a behaviour is compared with.
#[derive(Clone, Copy)]
pub struct Reference<'a> {
    /// Number of the real test in its run.
    pub test: usize,
    /// Its behaviour.
    pub real: &'a Behaviour,
    /// Whether residuals are requested as well.
    pub squares: bool,
    /// Compares the real behaviour with the simulated one.
    pub compare: &'a (dyn Fn(&Behaviour, &Behaviour) -> Compared + Sync),
}

/// How far a behaviour is from another one, with the residuals of which that is the sum of squares, a block per
/// channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// The distance.
    pub distance: f64,
    /// The residuals, where they were requested.
    pub residuals: Option<Vec<Vec<f64>>>,
}

/// Output of a simulation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Output {
    /// All of it.
    Behaviour(Behaviour),
    /// Its fitness.
    Fitness(f64),
    /// How far it is from a real one.
    Distance(Compared),
}

impl OutputRequest<'_> {
    /// The output for a behaviour.
    pub fn of(&self, behaviour: Behaviour) -> Output {
        match self {
            OutputRequest::Behaviour => Output::Behaviour(behaviour),
            OutputRequest::Fitness => Output::Fitness(behaviour.fitness),
            OutputRequest::Distance(reference) => Output::Distance((reference.compare)(reference.real, &behaviour)),
        }
    }
}

/// A simulation, a controller and a situation.
#[derive(Clone, Copy, Debug)]
pub struct Job<'a> {
    /// A point of S.
    pub s: &'a [f64],
    /// A point of C.
    pub c: &'a [f64],
    /// Number of the situation.
    pub scenario: usize,
}

/// One requested real test.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// Counts the real tests of a run, from 0.
    pub number: usize,
    /// The Back-to-Reality iteration it belongs to, from 1.
    pub iteration: usize,
    /// The controller to try, in the units of C.
    pub controller: Vec<f64>,
    /// The situation to try it in.
    pub scenario: usize,
}

/// Outcome of a real test.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The test was carried out, with this behaviour.
    Done(Behaviour),
    /// The test failed (the robot fell off the table, timed out, sent invalid data). It still counts as spent.
    Failed {
        /// What went wrong, for the report.
        why: String,
    },
    /// The test is still to be carried out by hand; the run stops here and goes on when it is resumed.
    Pending {
        /// What is awaited and where, and what to do then.
        what: Text,
    },
    /// Nobody knows whether the robot stands still; the run ends here, and asks for the test again when it is resumed.
    Unsafe {
        /// What may still move the robot, and what to do.
        why: Text,
    },
    /// The files of the test are damaged, or cannot be written; the run ends here, and asks for the test again when it
    /// is resumed.
    Storage {
        /// Which file, and what is wrong with it.
        why: Text,
    },
}

/// Why trials cannot be announced.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AnnounceError {
    /// The commands of a controller cannot be computed.
    #[error(transparent)]
    Commands(#[from] WorldError),
    /// The trials cannot be kept where they are prepared, for instance on a full disk.
    #[error("{0}")]
    Storage(Text),
}

impl AnnounceError {
    /// The error as a text.
    pub fn text(&self) -> Text {
        match self {
            AnnounceError::Commands(error) => error.to_string().into(),
            AnnounceError::Storage(text) => text.clone(),
        }
    }
}

/// Source of real tests: a hidden twin, recorded logs, a command, a person at the robot.
///
/// An implementation must have the log on disk before it returns it, so that no real test is ever lost.
pub trait Reality {
    /// Announces the trials that come next, so that they can be prepared together. The default does nothing.
    ///
    /// # Errors
    /// Whatever keeps the trials from being prepared.
    fn announce(&mut self, trials: &[Trial]) -> Result<(), AnnounceError> {
        let _ = trials;
        Ok(())
    }

    /// Carries out one test. For a trial that was carried out before, it returns the same behaviour without moving the
    /// robot again.
    fn test(&mut self, trial: &Trial) -> Outcome;

    /// The behaviour of a test that was carried out before; never moves a robot.
    fn recall(&mut self, trial: &Trial) -> Outcome {
        self.test(trial)
    }
}

/// Time step of a simulation: the model's own, halved a number of times.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TimeStep {
    halvings: u8,
}

impl TimeStep {
    /// The model's own time step.
    pub const USUAL: TimeStep = TimeStep { halvings: 0 };

    /// A step half as long.
    #[must_use]
    pub fn halved(self) -> TimeStep {
        TimeStep { halvings: self.halvings + 1 }
    }

    /// The model's own step, halved `halvings` times.
    pub fn of_halvings(halvings: u8) -> Self {
        TimeStep { halvings }
    }

    /// Number of halvings.
    pub fn halvings(self) -> u8 {
        self.halvings
    }

    /// Number of such steps in one of the model's own.
    pub fn divides_by(self) -> u32 {
        1 << self.halvings
    }
}
