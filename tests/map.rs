//! Transfer by quality diversity: a robot that does badly what the simulation does best.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_core::coevolve::{Coevolution, Environment, MapError, Outlook, PlanError, StopReason};
use btr_core::log::{Log, LogError};
use btr_core::space::Space;
use btr_core::world::{Behaviour, Measure, Simulator, WorldError};
use btr_tests::{Hidden, Oscillator, finish, plan};

/// The simulation without the robot's damage.
const TRUTH: [f64; 2] = [1.5, 0.2];

const MAP: &str = "method = 'quality_diversity'\niterations = 10\nreal_tests = 10\n[map]\ngenerations = 60\npopulation = 50\n\
    cells = 10\nmutation = 0.05\nlength_scale = 0.1\n[map.descriptors]\nphase = [-3.0, 3.0]\namplitude = [0.0, 2.0]\n";

/// The loss of fitness by the damage near the best phase of the simulation, −1.5 rad.
fn damage(c: &[f64]) -> f64 {
    if (c[1] + 1.5).abs() < 0.7 { -c[0] } else { 0.0 }
}

fn run(changes: &str, reality: &mut Hidden) -> (Coevolution, StopReason, Outlook) {
    let world = Oscillator::new().unwrap();
    let mut run = Coevolution::new(plan(changes).unwrap(), 1, &world).unwrap();
    let reason = finish(&mut run, &world, reality);
    let outlook = run.outlook(&world).unwrap();
    (run, reason, outlook)
}

fn fitness(run: &Coevolution) -> Vec<f64> {
    run.ledger().entries().iter().map(|entry| entry.fitness().unwrap_or(f64::NAN)).collect()
}

#[test]
fn a_damaged_robot_finds_another_kind_of_controller() {
    let world = Oscillator::new().unwrap();
    let (run, reason, outlook) = run(MAP, &mut Hidden::new(Oscillator::new().unwrap(), TRUTH).with_bonus(damage));
    assert_eq!(reason, StopReason::NothingBetter, "{:?}", fitness(&run));
    // The real fitness of every controller of the map.
    let real = |c: &[f64]| world.behave(&TRUTH, c, 0).unwrap().fitness + damage(c);
    let best = outlook.elites.iter().map(|elite| real(&elite.controller)).fold(f64::MIN, f64::max);
    let tried = fitness(&run);
    let found = tried.iter().copied().fold(f64::MIN, f64::max);
    assert!(tried.len() <= 10 && tried[0] < 0.0, "the simulation's best is tried first: {tried:?}");
    assert!(found > 0.8 * best && best > 0.2, "{found} of {best}: {tried:?}");
    // Every controller once, the first one the simulation's best, and each with an interval.
    let entries = run.ledger().entries();
    for (k, entry) in entries.iter().enumerate() {
        assert!(entries[..k].iter().all(|other| other.trial.controller != entry.trial.controller));
        assert!(entry.promised.unwrap().is_finite() && entry.promised_ci95.unwrap()[0] < entry.promised.unwrap());
    }
    let simulated = outlook.elites.iter().map(|elite| elite.simulated).fold(f64::MIN, f64::max);
    assert!((entries[0].promised.unwrap() - simulated).abs() < 1e-12);
    assert_eq!(run.simulation(), run.start(), "the simulation stays as it is");
}

#[test]
fn an_undamaged_robot_takes_the_first_controller() {
    let (run, reason, outlook) = run(MAP, &mut Hidden::new(Oscillator::new().unwrap(), TRUTH));
    assert_eq!((reason, run.ledger().spent()), (StopReason::NothingBetter, 1));
    assert_eq!((outlook.cells, outlook.elites.len()), (100, 100));
    assert!(fitness(&run)[0] > 0.99 * (-TRUTH[1]).exp().powi(2) / 0.8 - 0.01, "{:?}", fitness(&run));
}

#[test]
fn failures_count_as_spent_and_repel_the_choice() {
    let mut reality = Hidden::new(Oscillator::new().unwrap(), TRUTH).failing(|trial| damage(&trial.controller) < 0.0);
    let (run, reason, _) = run(MAP, &mut reality);
    assert_eq!(reason, StopReason::NoRealData, "three failures in a row");
    assert_eq!(run.ledger().spent(), 3);
    let mut reality = Hidden::new(Oscillator::new().unwrap(), TRUTH).failing(|trial| trial.number == 0);
    let (run, reason, outlook) = self::run(MAP, &mut reality);
    assert_eq!(reason, StopReason::NothingBetter);
    let first = outlook.elites.iter().find(|elite| elite.controller == run.ledger().entries()[0].trial.controller);
    let first = first.unwrap();
    assert!(first.real.is_none() && first.promised < first.simulated, "{first:?}");
}

/// An oscillator whose last position can be measured.
struct MeasuredChannel(Oscillator);

impl Simulator for MeasuredChannel {
    fn simulations(&self) -> &Space {
        self.0.simulations()
    }

    fn controllers(&self) -> &Space {
        self.0.controllers()
    }

    fn scenarios(&self) -> usize {
        Simulator::scenarios(&self.0)
    }

    fn run(&self, s: &[f64], c: &[f64], scenario: usize) -> Result<Behaviour, WorldError> {
        self.0.run(s, c, scenario)
    }

    fn measure(&self, name: &str) -> Option<Measure> {
        (name == "last").then_some(last as Measure)
    }
}

fn last(log: &Log) -> Result<f64, LogError> {
    Ok(log.values("q_mass")?.last().copied().unwrap_or(f64::NAN))
}

#[test]
fn measures_of_behaviour_are_descriptors() {
    let world = MeasuredChannel(Oscillator::new().unwrap().scenarios(2));
    let changes = MAP.replace("phase = [-3.0, 3.0]", "last = [-1.0, 1.0]").replace("amplitude =", "'ampl' =");
    assert!(matches!(
        Coevolution::new(plan(&changes).unwrap(), 1, &world).unwrap_err(),
        PlanError::Map(MapError::Unknown { name }) if name == "ampl"
    ));
    let changes = changes.replace("'ampl'", "'ampl*'");
    let mut run = Coevolution::new(plan(&changes).unwrap(), 1, &world).unwrap();
    let distance = run.plan().distance.build();
    let mut reality = Hidden::new(Oscillator::new().unwrap(), TRUTH);
    let mut on = Environment { simulator: &world, distance: distance.as_ref(), reality: &mut reality };
    (0..60).for_each(|_| drop(run.step(&mut on)));
    let outlook = run.outlook(&world).unwrap();
    assert!(outlook.elites.len() > 30);
    for elite in outlook.elites {
        let behaviours = [0, 1].map(|scenario| world.run(run.simulation(), &elite.controller, scenario).unwrap());
        let mean = |of: &dyn Fn(&Behaviour) -> f64| behaviours.iter().map(of).sum::<f64>() / 2.0;
        let measured = [mean(&|b| last(&b.log).unwrap()).clamp(-1.0, 1.0), elite.controller[0]];
        let apart = measured.iter().zip(&elite.descriptor).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        assert!(apart < 1e-12, "{measured:?} {:?}", elite.descriptor);
        assert!((mean(&|b| b.fitness) - elite.simulated).abs() < 1e-12);
    }
}

#[test]
fn invalid_map_settings_are_refused() {
    let refused = |changes: &str| {
        let world = Oscillator::new().unwrap();
        Coevolution::new(plan(changes).unwrap(), 1, &world).unwrap_err().to_string()
    };
    let swapped = |before: &str, after: &str| refused(&MAP.replace(before, after));
    assert_eq!(refused("method = 'quality_diversity'"), "the method `quality_diversity` needs [coevolve.map]");
    assert!(refused("method = 'quality_diversity'\nmap = {}").contains("at least one descriptor"));
    assert_eq!(swapped("phase =", "phse ="), "there is no descriptor `phse`");
    assert!(swapped("[-3.0, 3.0]", "[3.0, 3.0]").contains("least < most"));
    let posterior = MAP.replace("[map]", "posterior = {}\n[map]").replace("method", "distance = 'whitened'\nmethod");
    assert!(refused(&posterior).contains("does not use [coevolve.posterior]"));
    for wrong in
        ["enough = 1.5", "noise = -1.0", "cells = 0", "cells = 5_000_000_000", "length_scale = 0.0", "zebra = 1"]
    {
        assert!(plan(&MAP.replace("cells = 10", wrong)).is_err(), "{wrong}");
    }
}
