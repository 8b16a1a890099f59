//! Requirements on every registered effect.

use crate::scene::arm;
use btr_core::log::Log;
use btr_core::random::stream;
use btr_physics::drive::Drive;
use btr_physics::effects::{DryFriction, EFFECTS, Effect, EffectSpec, PlacedEffect, SiteKind, find};
use btr_physics::presets::ant;
use btr_physics::robot::Robot;
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{Sensors, Setup};
use rand::RngExt;

/// A motion that excites every effect: joints reverse, start, stop and carry high torque.
struct Exercise;

impl Drive for Exercise {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        for (i, command) in command.iter_mut().enumerate() {
            let beat = 1.0 + 0.3 * i as f64;
            let step = if ((2.0 * beat * time_s) as usize).is_multiple_of(2) { 0.1 } else { -0.1 };
            *command = step + 0.4 * (4.0 * beat * time_s).sin() + 0.05 * (11.0 * time_s + i as f64).sin();
        }
    }
}

/// The effects on simulated motions.
fn simulated() -> impl Iterator<Item = &'static dyn Effect> {
    EFFECTS.iter().copied().filter(|effect| !effect.is_for_prescribed_motion())
}

/// Runs an effect: effects on the floor or the base on a walking ant, all others on a fixed arm; beside dry friction
/// where it changes that.
fn run(effect: &dyn Effect, effects: &[PlacedEffect], duration_s: f64) -> Log {
    let friction = find("coulomb_friction").filter(|_| effect.dry_friction() == DryFriction::Changes);
    let beside = friction.map(|effect| PlacedEffect { effect, site: "*".to_owned(), values: vec![0.3] });
    let effects: Vec<PlacedEffect> = beside.into_iter().chain(effects.iter().cloned()).collect();
    match effect.spec().site {
        SiteKind::Ground | SiteKind::Base => {
            let sensors = Sensors { velocities: true, torques: true, imu: true, feet: true };
            let setup = Setup { dt_s: 0.002, control_s: 0.01, duration_s, sensors, ..Setup::default() };
            logged(&ant::ant(), &effects, &setup, &ant::tripod())
        }
        SiteKind::Joint | SiteKind::Link | SiteKind::Robot => {
            let setup = Setup { dt_s: 0.001, control_s: 0.002, duration_s, ground: None, ..Setup::default() };
            logged(&arm(), &effects, &setup, &Exercise)
        }
    }
}

fn logged(robot: &Robot, effects: &[PlacedEffect], setup: &Setup, drive: &dyn Drive) -> Log {
    simulate(RolloutRequest::new(robot, drive).setup(setup).effects(effects))
        .unwrap_or_else(|e| panic!("{effects:?}: {e}"))
}

/// Bit patterns of every channel; missing values compare equal.
fn bits(log: &Log) -> Vec<(String, Vec<u64>)> {
    log.channels().map(|(n, c)| (n.to_owned(), c.values.iter().map(|v| v.to_bits()).collect())).collect()
}

/// The largest difference among the selected channels.
fn apart(a: &Log, b: &Log, is_selected: impl Fn(&str) -> bool) -> f64 {
    let pairs =
        a.channels().filter(|(name, _)| is_selected(name)).map(|(name, channel)| (channel, b.values(name).unwrap()));
    let differences = pairs.flat_map(|(channel, other)| channel.values.iter().zip(other).map(|(a, b)| (a - b).abs()));
    differences.fold(0.0, f64::max)
}

#[test]
fn off_changes_no_bit() {
    for effect in simulated() {
        let off = PlacedEffect::off(effect, "*");
        assert!(off.is_off());
        let (plain, off) = (run(effect, &[], 0.4), run(effect, &[off], 0.4));
        assert!(bits(&plain) == bits(&off), "`{}` acts although it is off", effect.spec().name);
    }
}

#[test]
fn at_its_hint_an_effect_is_visible_but_moderate() {
    for effect in simulated() {
        let name = effect.spec().name;
        let plain = run(effect, &[], 2.0);
        let planted = run(effect, &[PlacedEffect::hinted(effect, "*")], 2.0);
        let joints = apart(&plain, &planted, |channel| channel.starts_with("q_"));
        let inertial = apart(&plain, &planted, |channel| channel.starts_with("imu_"));
        // The resolution of encoders is about a milliradian.
        assert!(joints.max(inertial) > 5e-3, "`{name}` at its hint moves joints by no more than {joints} rad");
        assert!(joints < 0.8, "`{name}` at its hint moves joints by {joints} rad");
    }
}

#[test]
fn a_repeated_run_is_bit_identical() {
    for effect in simulated() {
        let [once, twice] = [(); 2].map(|()| bits(&run(effect, &[PlacedEffect::hinted(effect, "*")], 0.4)));
        assert!(once == twice, "`{}`", effect.spec().name);
    }
}

#[test]
fn no_value_within_the_bounds_breaks_a_run() {
    for (key, effect) in simulated().enumerate() {
        let spec = effect.spec();
        let at = |value: &mut dyn FnMut(f64, f64) -> f64| {
            let values = spec.params.iter().map(|param| value(param.bounds.0, param.bounds.1)).collect();
            let log = run(effect, &[PlacedEffect { effect, site: "*".to_owned(), values }], 0.2);
            let finite = log.channels().all(|(_, channel)| channel.values.iter().all(|x| x.is_finite()));
            assert!(finite, "`{}` leaves values that are not finite", spec.name);
        };
        at(&mut |min, _| min);
        at(&mut |_, max| max);
        let mut rng = stream(7, &[key as u64]);
        for _ in 0..100 {
            at(&mut |min, max| min + (max - min) * rng.random::<f64>());
        }
    }
}

#[test]
fn specifications_are_complete() {
    for effect in simulated() {
        let spec = effect.spec();
        let named = spec.name.chars().all(|c| c.is_ascii_lowercase() || c == '_');
        assert!(named && !spec.name.is_empty(), "`{}`", spec.name);
        for (what, text) in [("law", spec.law), ("cite", spec.cite), ("symptom", spec.symptom)] {
            assert!(text.len() > 5, "`{}` has no {what}", spec.name);
        }
        assert!(spec.params.iter().any(|param| !param.shape), "`{}` cannot be switched on", spec.name);
        for param in spec.params {
            let (min, max) = param.bounds;
            assert!(min < max && min.is_finite() && max.is_finite(), "`{}.{}`: bounds", spec.name, param.name);
            assert!((min..=max).contains(&param.hint), "`{}.{}`: hint", spec.name, param.name);
            let off_is_special = !param.off.is_finite();
            assert!(off_is_special || (min..=max).contains(&param.off), "`{}.{}`: off", spec.name, param.name);
            assert!(!param.unit.is_empty(), "`{}.{}`: unit", spec.name, param.name);
        }
        assert!(!PlacedEffect::hinted(effect, "*").is_off(), "`{}` is off at its hint", spec.name);
        starts_fit(spec);
        for other in spec.similar {
            assert!(*other != spec.name && find(other).is_some(), "`{}` is like `{other}`?", spec.name);
        }
    }
}

#[test]
fn an_effect_that_contains_another_equals_it() {
    for effect in simulated() {
        for (name, values) in effect.spec().nested {
            let other = find(name).unwrap();
            assert!(effect.spec().similar.contains(name), "`{}` contains `{name}`", effect.spec().name);
            let inside = PlacedEffect { effect, site: "*".to_owned(), values: values.to_vec() };
            let (larger, contained) =
                (run(effect, &[inside], 0.4), run(other, &[PlacedEffect::hinted(other, "*")], 0.4));
            let apart = apart(&larger, &contained, |channel| channel.starts_with("q_"));
            assert!(apart < 1e-3 * 0.2, "`{}` at {values:?} is {apart} rad from `{name}`", effect.spec().name);
        }
    }
}

/// Checks that the starts of a search are within the bounds.
fn starts_fit(spec: &EffectSpec) {
    let shapes: Vec<_> = spec.params.iter().filter(|param| param.shape).collect();
    assert_eq!(shapes.is_empty(), spec.starts.is_empty(), "`{}`: shapes need starts", spec.name);
    for start in spec.starts {
        assert_eq!(start.len(), shapes.len(), "`{}`", spec.name);
        for (value, shape) in start.iter().zip(&shapes) {
            assert!((shape.bounds.0..=shape.bounds.1).contains(value), "`{}.{}`: {value}", spec.name, shape.name);
        }
    }
}

#[test]
fn names_find_their_effects() {
    for (i, &effect) in EFFECTS.iter().enumerate() {
        let name = effect.spec().name;
        assert_eq!(find(name).map(|found| found.spec().name), Some(name));
        assert!(EFFECTS[..i].iter().all(|other| other.spec().name != name), "`{name}` is registered twice");
    }
    assert!(find("phlogiston").is_none());
}

#[test]
fn the_order_in_a_file_does_not_matter() {
    let mut all: Vec<PlacedEffect> = simulated().map(|effect| PlacedEffect::hinted(effect, "*")).collect();
    let setup = Setup { dt_s: 0.001, control_s: 0.002, duration_s: 0.5, ground: None, ..Setup::default() };
    let forward = bits(&logged(&arm(), &all, &setup, &Exercise));
    all.reverse();
    assert!(forward == bits(&logged(&arm(), &all, &setup, &Exercise)));
}
