//! A small analytic world for tests of the loop: a damped oscillation whose amplitude and phase are the controller; and
//! the desk arm with something planted in it.

pub mod planted;

use btr_core::coevolve::{Coevolution, Environment, Plan, StepOutcome, StopReason};
use btr_core::distance::Distance;
use btr_core::log::{Log, Role};
use btr_core::space::{Dim, Space, SpaceError};
use btr_core::world::{Behaviour, Outcome, Reality, Simulator, Trial, WorldError};

/// Samples of a behaviour.
const SAMPLES: usize = 40;
/// Time between them, in s.
const SAMPLE_S: f64 = 0.05;

/// q(t) = amplitude·exp(−damping·t)·cos(omega·t + phase): S is (omega, damping), C is (amplitude, phase).
///
/// The task is to be far out at t = 1 s for little amplitude: f = q(1 s) − 0.2·amplitude². Scenario k lets k times 0.3
/// s pass before the clock starts.
pub struct Oscillator {
    simulations: Space,
    controllers: Space,
    scenarios: usize,
    /// Controllers whose simulation fails.
    refuses: fn(&[f64]) -> bool,
    /// Offset of every q, which no point of S can reproduce.
    offset: f64,
}

impl Oscillator {
    /// The family with omega in [1, 3] rad/s and damping in [0.1, 1] 1/s.
    ///
    /// # Errors
    /// None: the bounds are sound.
    pub fn new() -> Result<Self, SpaceError> {
        let simulations =
            vec![Dim::new("omega", "rad/s", 1.0, 3.0).nominal(1.5), Dim::new("damping", "1/s", 0.1, 1.0).nominal(0.2)];
        let controllers = vec![Dim::new("amplitude", "rad", 0.0, 2.0), Dim::new("phase", "rad", -3.0, 3.0)];
        Ok(Oscillator {
            simulations: Space::new(simulations)?,
            controllers: Space::new(controllers)?,
            scenarios: 1,
            refuses: |_| false,
            offset: 0.0,
        })
    }

    /// The same with several scenarios.
    #[must_use]
    pub fn scenarios(mut self, count: usize) -> Self {
        self.scenarios = count;
        self
    }

    /// The same, with simulations that diverge for some controllers.
    #[must_use]
    pub fn refusing(mut self, refuses: fn(&[f64]) -> bool) -> Self {
        self.refuses = refuses;
        self
    }

    /// The same with all positions moved.
    #[must_use]
    pub fn moved_by(mut self, offset: f64) -> Self {
        self.offset = offset;
        self
    }

    /// What simulation `s` does with controller `c`, whether or not `s` lies in S.
    ///
    /// # Errors
    /// A controller that this family refuses.
    pub fn behave(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        if (self.refuses)(c) {
            return Err(WorldError::Diverged { time_s: 0.0, what: "amplitude".to_owned() });
        }
        let q = |t: f64| {
            let t = t + 0.3 * scenario as f64;
            c[0] * (-s[1] * t).exp() * (s[0] * t + c[1]).cos() + self.offset
        };
        let clock: Vec<f64> = (0..SAMPLES).map(|k| SAMPLE_S * k as f64).collect();
        let mut log = Log::new(clock.clone())?;
        log.insert("q_mass", "rad", Role::Measured, clock.iter().map(|&t| q(t)).collect())?;
        Ok(Behaviour { log, fitness: q(1.0) - 0.2 * c[0] * c[0] })
    }
}

impl Simulator for Oscillator {
    fn simulations(&self) -> &Space {
        &self.simulations
    }

    fn controllers(&self) -> &Space {
        &self.controllers
    }

    fn scenarios(&self) -> usize {
        self.scenarios
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.simulations.check(s)?;
        self.controllers.check(c)?;
        self.behave(s, c, scenario)
    }
}

/// A reality that records its trials.
pub struct Hidden {
    world: Oscillator,
    truth: [f64; 2],
    /// Which trials cannot be carried out.
    fails: fn(&Trial) -> bool,
    /// Added to f, as a function of the controller.
    bonus: fn(&[f64]) -> f64,
    /// Every distinct trial.
    pub trials: Vec<Trial>,
}

impl Hidden {
    /// The oscillator of this omega and damping.
    pub fn new(world: Oscillator, truth: [f64; 2]) -> Self {
        Hidden { world, truth, fails: |_| false, bonus: |_| 0.0, trials: Vec::new() }
    }

    /// The same, unable to carry out some trials.
    #[must_use]
    pub fn failing(mut self, fails: fn(&Trial) -> bool) -> Self {
        self.fails = fails;
        self
    }

    /// The same with another fitness.
    #[must_use]
    pub fn with_bonus(mut self, bonus: fn(&[f64]) -> f64) -> Self {
        self.bonus = bonus;
        self
    }
}

impl Reality for Hidden {
    fn test(&mut self, trial: &Trial) -> Outcome {
        if !self.trials.contains(trial) {
            self.trials.push(trial.clone());
        }
        if (self.fails)(trial) {
            return Outcome::Failed { why: "it fell off the table".to_owned() };
        }
        match self.world.behave(&self.truth, &trial.controller, trial.scenario) {
            Ok(mut behaviour) => {
                behaviour.fitness += (self.bonus)(&trial.controller);
                Outcome::Done(behaviour)
            }
            Err(why) => Outcome::Failed { why: why.to_string() },
        }
    }
}

/// A plan with everything small: 20 controllers, 10 simulators, as many generations as the oscillator needs.
///
/// # Errors
/// Changes that are no TOML or no plan.
pub fn plan(changes: &str) -> Result<Plan, toml::de::Error> {
    let base = "iterations = 4\ndistance = 'fitness'\n\
        controllers = { generations = 6, search = { algorithm = 'real_ga', population = 20 } }\n\
        simulators = { generations = 25, search = { algorithm = 'cma_es', population = 10 } }\n";
    let mut plan: toml::Table = toml::from_str(base)?;
    plan.extend(toml::from_str::<toml::Table>(changes)?);
    toml::Value::Table(plan).try_into()
}

/// Runs until it stops.
pub fn finish(run: &mut Coevolution, world: &Oscillator, reality: &mut Hidden) -> StopReason {
    let distance: Box<dyn Distance> = run.plan().distance.build();
    let mut on = Environment { simulator: world, distance: distance.as_ref(), reality };
    loop {
        if let Ok(StepOutcome::Stopped(reason)) = run.step(&mut on) {
            return reason;
        }
    }
}
