//! What co-evolution acts on: a family of simulations, and a reality.

use crate::log::{Log, LogError};
use crate::space::{Space, SpaceError};
use serde::{Deserialize, Serialize};

/// A behaviour B(E, c): what was recorded, and the experimenter's judgement of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Behaviour {
    /// The sensorimotor history.
    pub log: Log,
    /// f(B): larger is better. Its unit is the experimenter's.
    pub fitness: f64,
}

/// Why a simulation gave no behaviour.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum WorldError {
    /// The state stopped being finite or left every sensible range.
    #[error("the simulation blew up at t = {} s: {what}", rounded(*time_s))]
    BlewUp {
        /// Simulated time at which it was noticed.
        time_s: f64,
        /// Which quantity, on which body.
        what: String,
    },
    /// A user's own law that gave no finite number.
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
}

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
    /// How many situations there are, at least 1.
    fn scenarios(&self) -> usize;
    /// Runs controller `c` in simulation `s`. The same arguments give the same bits.
    ///
    /// # Errors
    /// A point outside its space, or a simulation that blew up.
    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError>;
    /// What this name measures of a behaviour's log; `None` where it means nothing here.
    fn measure(&self, name: &str) -> Option<Measure> {
        let _ = name;
        None
    }
    /// How many runs are best asked for at once.
    fn side_by_side(&self) -> usize {
        1
    }
    /// What [`run`](Self::run) gives for each job, bit by bit, in the order of the jobs. Those that follow each other in one
    /// scenario may be simulated side by side.
    fn run_all(&self, jobs: &[Job]) -> Vec<Result<Behaviour, WorldError>> {
        jobs.iter().map(|job| self.run(job.s, job.c, job.scenario)).collect()
    }
    /// What is wanted of each job's behaviour, in the order of the jobs. Who simulates elsewhere need not send behaviours
    /// home of which only a number is wanted.
    fn evaluate_all(&self, jobs: &[Job], wanted: &[OutputRequest]) -> Vec<Result<Output, WorldError>> {
        self.run_all(jobs).into_iter().zip(wanted).map(|(behaviour, wanted)| Ok(wanted.of(behaviour?))).collect()
    }
}

/// What is wanted of a simulated behaviour.
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
    /// What came of it.
    pub real: &'a Behaviour,
    /// Whether residuals are wanted as well.
    pub squares: bool,
    /// Compares the real behaviour with the simulated one.
    pub compare: &'a (dyn Fn(&Behaviour, &Behaviour) -> Compared + Sync),
}

/// How far a behaviour is from another one, with the residuals of which that is the sum of squares, a block per channel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Compared {
    /// The distance.
    pub distance: f64,
    /// The residuals, where they were wanted.
    pub residuals: Option<Vec<Vec<f64>>>,
}

/// What was made of a behaviour.
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
    /// Makes it of a behaviour.
    pub fn of(&self, behaviour: Behaviour) -> Output {
        match self {
            OutputRequest::Behaviour => Output::Behaviour(behaviour),
            OutputRequest::Fitness => Output::Fitness(behaviour.fitness),
            OutputRequest::Distance(against) => Output::Distance((against.compare)(against.real, &behaviour)),
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

/// One real test that somebody asks for.
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

/// What came of a real test.
#[derive(Clone, Debug, PartialEq)]
pub enum Outcome {
    /// The robot did it, and this is what it did.
    Done(Behaviour),
    /// The robot could not do it (fell off the table, timed out, sent rubbish). It still counts as spent.
    Failed {
        /// What went wrong, for the report.
        why: String,
    },
    /// Somebody has to do it first; the run stops here and goes on when it is resumed.
    Pending {
        /// What is awaited and where.
        what: String,
    },
}

/// Where the truth comes from: a hidden twin, recorded logs, a command, a person at the robot.
///
/// An implementation must have the log on disk before it returns it: what a robot once produced is never lost.
pub trait Reality {
    /// Tells which trials are about to be asked for, so that they can be prepared in one go. Nothing has to be done here.
    ///
    /// # Errors
    /// Whatever keeps the trials from being prepared, for instance a full disk.
    fn announce(&mut self, trials: &[Trial]) -> Result<(), String> {
        let _ = trials;
        Ok(())
    }

    /// Carries out one test. Asked again for a trial that was done before, it returns the same behaviour without
    /// troubling the robot again.
    fn test(&mut self, trial: &Trial) -> Outcome;

    /// The behaviour of a test that was done before; never a new one where that would trouble a robot.
    fn recall(&mut self, trial: &Trial) -> Outcome {
        self.test(trial)
    }
}

/// How exactly a simulation is computed: with the model's own time step, halved so many times.
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

    /// The model's own step, halved so many times.
    pub fn of_halvings(halvings: u8) -> Self {
        TimeStep { halvings }
    }

    /// How many times the model's own step is halved.
    pub fn halvings(self) -> u8 {
        self.halvings
    }

    /// How many such steps make one of the model's own.
    pub fn divides_by(self) -> u32 {
        1 << self.halvings
    }
}
