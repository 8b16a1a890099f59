//! A toy whose truth is known, for the tests of estimates: two parameters of an oscillation, with a jump and,
//! optionally, a chaotic part.
#![allow(clippy::unwrap_used)]

use super::ledger::{Ledger, Memory, PredictedFitness};
use super::plan::{DisengagementRule, Initial, Method, Plan, PosteriorPhase, Rule, SearchPhase, Transfer};
use crate::distance::{DistanceSpec, Whitened};
use crate::log::{Log, Role};
use crate::random;
use crate::search::SearchSpec;
use crate::search::cmaes::CmaEsSettings;
use crate::space::{Dim, Space};
use crate::world::{Behaviour, Outcome, Reality, Simulator, Trial, WorldError};

const SIGMA: f64 = 0.02;
const ROWS: usize = 300;

/// `rate` and `gain` of an oscillation, and its drift; in its second half, optionally, a motion that depends
/// chaotically on both.
pub(super) struct Toy {
    pub(super) space: Space,
    controllers: Space,
    chaotic: bool,
    /// Oscillations below this amplitude stick.
    stuck_below: f64,
}

impl Toy {
    pub(super) fn new(chaotic: bool, further: &[Dim]) -> Self {
        let dims = [Dim::new("rate", "rad/s", 1.0, 3.0).nominal(2.0), Dim::new("gain", "1", 0.5, 1.5).nominal(1.0)];
        let space = Space::new([&dims, further].concat()).unwrap();
        Toy { space, controllers: Space::default(), chaotic, stuck_below: 0.0 }
    }

    /// A toy whose controller is the amplitude; the smaller the fitter. Below some amplitude it sticks around zero.
    pub(super) fn driven(stuck_below: f64, further: &[Dim]) -> Self {
        let controllers = Space::new(vec![Dim::new("amplitude", "1", 0.5, 1.5).nominal(1.0)]).unwrap();
        Toy { controllers, stuck_below, ..Toy::new(false, further) }
    }

    fn readings(&self, s: &[f64], c: &[f64]) -> Vec<f64> {
        let (rate, gain, drift) = (s[0], s[1], s.get(2).copied().unwrap_or(0.0));
        let amplitude = c.first().copied().unwrap_or(1.0);
        let reading = |k: usize| {
            let t = 0.02 * k as f64;
            let wild =
                if self.chaotic && k > ROWS / 2 { 0.5 * (1e7 * (rate + 3.0 * gain) + 50.0 * t).sin() } else { 0.0 };
            // A foot that lands a step earlier.
            let landed = if t > 0.02 * (50.0 * gain).floor() { 0.05 } else { 0.0 };
            let swing = amplitude * gain * (rate * t).sin();
            let moved = if amplitude < self.stuck_below && swing.abs() < 0.2 { 0.0 } else { swing };
            moved + landed + wild + drift * t
        };
        (0..ROWS).map(reading).collect()
    }

    fn behaviour(q: Vec<f64>, c: &[f64]) -> Behaviour {
        let mut log = Log::new((0..ROWS).map(|k| 0.02 * k as f64).collect()).unwrap();
        log.insert("q_toy", "rad", Role::Measured, q).unwrap();
        Behaviour { log, fitness: -c.first().copied().unwrap_or(0.0) }
    }
}

impl Simulator for Toy {
    fn simulations(&self) -> &Space {
        &self.space
    }

    fn controllers(&self) -> &Space {
        &self.controllers
    }

    fn scenarios(&self) -> usize {
        1
    }

    fn run(&self, s: &[f64], c: &[f64], _: usize) -> Result<Behaviour, WorldError> {
        Ok(Toy::behaviour(self.readings(s, c), c))
    }
}

/// A space of simulations that maps onto that of a toy.
pub(super) struct DerivedSpace<F> {
    pub(super) space: Space,
    pub(super) of: Toy,
    pub(super) by: F,
}

impl<F: Fn(&[f64]) -> Vec<f64> + Sync> Simulator for DerivedSpace<F> {
    fn simulations(&self) -> &Space {
        &self.space
    }

    fn controllers(&self) -> &Space {
        &self.of.controllers
    }

    fn scenarios(&self) -> usize {
        1
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.of.run(&(self.by)(s), c, scenario)
    }
}

/// A toy with sensor noise, which may change.
pub(super) struct ToyRobot<'a> {
    pub(super) toy: &'a Toy,
    pub(super) truth: Vec<f64>,
    /// First test of the changed robot, and its truth.
    pub(super) later: Option<(usize, Vec<f64>)>,
    pub(super) seed: u64,
}

impl<'a> ToyRobot<'a> {
    pub(super) fn new(toy: &'a Toy, truth: &[f64], seed: u64) -> Self {
        ToyRobot { toy, truth: truth.to_vec(), later: None, seed }
    }
}

impl Reality for ToyRobot<'_> {
    fn test(&mut self, trial: &Trial) -> Outcome {
        let mut rng = random::stream(self.seed, &[trial.number as u64]);
        let noisy = |q: f64| q + SIGMA * crate::random::normal(&mut rng);
        let later = self.later.as_ref().filter(|(from, _)| trial.number >= *from).map(|(_, truth)| truth);
        let readings = self.toy.readings(later.unwrap_or(&self.truth), &trial.controller);
        Outcome::Done(Toy::behaviour(readings.into_iter().map(noisy).collect(), &trial.controller))
    }
}

pub(super) fn tested(robot: &mut ToyRobot, tests: usize) -> Ledger {
    let mut ledger = Ledger::default();
    for number in 0..tests {
        let trial = Trial { number, iteration: 1, controller: Vec::new(), scenario: 0 };
        ledger.carry_out(trial, PredictedFitness::default(), robot).unwrap();
    }
    ledger
}

/// The distance with the toy's noise.
pub(super) fn whitened() -> Whitened {
    Whitened { noise: [("q_*".to_owned(), SIGMA)].into_iter().collect(), ..Whitened::default() }
}

/// A run with a posterior, of one test in each iteration.
pub(super) fn estimating(iterations: usize) -> Plan {
    let search = SearchSpec::CmaEs(CmaEsSettings::default());
    Plan {
        method: Method::default(),
        iterations,
        real_tests: None,
        distance: DistanceSpec::Whitened(whitened()),
        initial_simulation: Initial::default(),
        controllers: Some(SearchPhase { generations: 5, search, carry_over: false, refine: 0 }),
        transfer: Transfer { rule: Rule::Informative, count: Some(1), ..Transfer::default() },
        simulators: None,
        map: None,
        posterior: Some(PosteriorPhase::default()),
        memory: Memory::default(),
        phi_goal: None,
        fitness_goal: None,
        disengagement: DisengagementRule::default(),
        self_augment: false,
    }
}
