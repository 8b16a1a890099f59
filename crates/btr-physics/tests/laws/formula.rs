//! User-defined laws.

use crate::scene::{Told, arm, fast, fast_weightless, hold, last, placed, run, run_with};
use btr_core::log::Log;
use btr_core::world::WorldError;
use btr_physics::effects::{
    Effect, FormulaError, FormulaTarget, LawFunction, LawInputs, Laws, Param, PlacedEffect, formula,
    formula_or_function,
};
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::Actuator;
use btr_physics::rollout::{RolloutRequest, simulate};
use proptest::prelude::*;
use std::sync::Arc;

fn law(on: FormulaTarget, text: &str, params: &[(&str, f64)]) -> PlacedEffect {
    let names: Vec<&str> = params.iter().map(|(name, _)| *name).collect();
    let values = params.iter().map(|(_, value)| *value).collect();
    PlacedEffect { effect: formula(on, text, &names).unwrap(), site: "elbow".to_owned(), values }
}

fn run_arm(effects: &[PlacedEffect]) -> Log {
    run_with(&arm(), effects, &fast(0.001, 1.0), &Told(|t: f64| 0.4 * (5.0 * t).sin()))
}

fn apart(a: &Log, b: &Log, channel: &str) -> f64 {
    let pairs = a.values(channel).unwrap().iter().zip(b.values(channel).unwrap());
    pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn formulas_equal_the_librarys_effects_of_the_same_law() {
    let same = [
        (law(FormulaTarget::Torque, "-c*dq", &[("c", 0.3)]), placed("viscous_friction", "elbow", &[0.3])),
        (law(FormulaTarget::Torque, "-c*dq*abs(dq)", &[("c", 0.2)]), placed("quadratic_drag", "elbow", &[0.2])),
        (law(FormulaTarget::Torque, "a*sin(5*q + 0.3)", &[("a", 0.4)]), placed("cogging", "elbow", &[0.4, 5.0, 0.3])),
        (law(FormulaTarget::Reading, "q + o", &[("o", 0.05)]), placed("encoder_offset", "elbow", &[0.05])),
        (
            law(FormulaTarget::Command, "cmd - min(max(cmd - q, -0.03), 0.03)", &[]),
            placed("command_deadband", "elbow", &[0.03]),
        ),
    ];
    let plain = run_arm(&[]);
    for (formula, library) in same {
        let (name, formula, library) = (formula.effect.spec().law, run_arm(&[formula]), run_arm(&[library]));
        let (visible, error) = (apart(&plain, &library, "q_elbow"), apart(&formula, &library, "q_elbow"));
        assert!(error < 0.03 * visible, "{name}: {error} of {visible} rad");
    }
}

#[test]
fn friction_that_grows_with_the_speed_is_stable_at_any_step() {
    let fastest = |effects: &[PlacedEffect]| {
        let log = run_with(&arm(), effects, &fast(0.008, 2.0), &Told(|t: f64| 0.4 * (5.0 * t).sin()));
        log.values("dq_elbow").unwrap().iter().fold(0.0, |a: f64, b| a.max(b.abs()))
    };
    let plain = fastest(&[]);
    for text in ["-50*dq", "-5*dq*abs(dq)", "-50*dq^3"] {
        let braked = fastest(&[law(FormulaTarget::Torque, text, &[])]);
        assert!(braked < 1.001 * plain, "{text}: {braked} rad/s, without it {plain}");
    }
}

#[test]
fn a_law_knows_time_torque_command_and_acceleration() {
    let robot = pendulum(1.0, 1.0, Actuator::Torque { max_torque: f64::INFINITY });
    let end = |text: &str| {
        let effects = [PlacedEffect { site: "hinge".to_owned(), ..law(FormulaTarget::Torque, text, &[]) }];
        last(&run_with(&robot, &effects, &fast_weightless(0.0005, 1.0), &hold(2.0)), "dq_hinge")
    };
    assert!((end("t") - 2.5).abs() < 1e-3, "{}", end("t"));
    assert!((end("tau") - 4.0).abs() < 1e-2, "{}", end("tau"));
    assert!((end("cmd") - 4.0).abs() < 1e-9, "{}", end("cmd"));
    assert!((end("-0.5*ddq") - 4.0 / 3.0).abs() < 1e-2, "as with half a kg·m² more: {}", end("-0.5*ddq"));
}

#[test]
fn a_law_that_adds_nothing_changes_little() {
    for (on, text) in [(FormulaTarget::Torque, "0*q"), (FormulaTarget::Command, "cmd"), (FormulaTarget::Reading, "q")] {
        let error = apart(
            &run(&arm(), &fast(0.001, 1.0), &hold(0.2)),
            &run_with(&arm(), &[law(on, text, &[])], &fast(0.001, 1.0), &hold(0.2)),
            "q_elbow",
        );
        assert!(error < 1e-12, "{text} on {on:?}: {error}");
    }
}

#[test]
fn the_same_law_is_compiled_once() {
    let [one, two] = [(); 2].map(|()| formula(FormulaTarget::Torque, "-k*q", &["k"]).unwrap());
    assert!(std::ptr::eq(one.spec(), two.spec()));
    assert!(!std::ptr::eq(one.spec(), formula(FormulaTarget::Command, "-k*q", &["k"]).unwrap().spec()));
}

/// A function under a name, as the effect of its law.
fn function(on: FormulaTarget, name: &str, call: Arc<LawFunction>) -> Result<&'static dyn Effect, FormulaError> {
    formula_or_function(on, name, &["a"], &Laws::new([("test:law".to_owned(), call)]))
}

#[test]
fn a_function_is_bit_identical_to_the_same_expression() {
    let cases: [(FormulaTarget, &str, Arc<LawFunction>); 3] = [
        (
            FormulaTarget::Torque,
            "-a*dq*abs(dq)",
            Arc::new(|s: &LawInputs, _: &[Param], p: &[f64]| -p[0] * s[1] * s[1].abs()),
        ),
        (FormulaTarget::Command, "cmd + a*q", Arc::new(|s: &LawInputs, _: &[Param], p: &[f64]| s[3] + p[0] * s[0])),
        (FormulaTarget::Reading, "q + a*t", Arc::new(|s: &LawInputs, _: &[Param], p: &[f64]| s[0] + p[0] * s[5])),
    ];
    for (on, text, call) in cases {
        let effect = function(on, "test:law", call).unwrap();
        assert_eq!((effect.spec().law, effect.spec().params[0].name), ("test:law", "a"));
        let called = run_arm(&[PlacedEffect { effect, site: "elbow".to_owned(), values: vec![0.2] }]);
        assert_eq!(called, run_arm(&[law(on, text, &[("a", 0.2)])]), "{text}");
        assert_ne!(called, run_arm(&[]), "{text}");
    }
}

#[test]
fn functions_of_one_name_are_distinguished_and_absent_ones_refused() {
    let [one, other]: [Arc<LawFunction>; 2] = [
        Arc::new(|_: &LawInputs, _: &[Param], p: &[f64]| p[0]),
        Arc::new(|_: &LawInputs, _: &[Param], p: &[f64]| -p[0]),
    ];
    let spec = |call: &Arc<LawFunction>| function(FormulaTarget::Torque, "test:law", call.clone()).unwrap().spec();
    assert!(std::ptr::eq(spec(&one), spec(&one)));
    assert!(!std::ptr::eq(spec(&one), spec(&other)));
    assert_eq!(
        function(FormulaTarget::Torque, "test:lore", one).unwrap_err(),
        FormulaError::Absent("test:lore".to_owned())
    );
}

#[test]
fn a_law_that_returns_no_finite_number_is_reported() {
    let ended = |on, text: &str, params: &[(&str, f64)], duration_s| {
        simulate(
            RolloutRequest::new(&arm(), &hold(0.2)).setup(&fast(0.001, duration_s)).effects(&[law(on, text, params)]),
        )
    };
    let cases = [
        (
            FormulaTarget::Torque,
            "a/(t - t)",
            "the law `a/(t - t)` on the torque of `elbow` gave inf at q=0.3, dq=0, ddq=0, cmd=0.2, ",
        ),
        (FormulaTarget::Torque, "a*sqrt(0.1 - t)", "the law `a*sqrt(0.1 - t)` on the torque of `elbow` gave NaN at q="),
        // NaN also means a motor that is switched off, and a reading may be unused: both must still be reported.
        (FormulaTarget::Command, "a*ln(q - 9)", "the law `a*ln(q - 9)` on the command of `elbow` gave NaN at q=0.3, "),
        (FormulaTarget::Reading, "q/(a - a)", "the law `q/(a - a)` on the reading of `elbow` gave inf at q=0.3, "),
    ];
    for (on, text, begins) in cases {
        let error = ended(on, text, &[("a", 2.0)], 0.5).unwrap_err();
        let what = error.to_string();
        assert!(matches!(error, WorldError::Law { .. }) && what.starts_with(begins), "{what}");
        assert!(what.ends_with(" with a=2"), "{what}");
    }
    assert!(ended(FormulaTarget::Torque, "a*sqrt(0.1 - t)", &[("a", 2.0)], 0.05).is_ok(), "not before it happens");
    let wild = ended(FormulaTarget::Torque, "a*q", &[("a", 1e9)], 0.5).unwrap_err().to_string();
    assert!(wild.contains("diverged") && wild.contains("joint `"), "a finite value is not the law's fault: {wild}");
}

#[test]
fn wrong_laws_are_refused() {
    let refused = |text: &str, params: &[&str]| formula(FormulaTarget::Torque, text, params).unwrap_err();
    for text in ["", "-q*", "sin(", "q q", ")q", "1..2", "q +* 2"] {
        assert!(matches!(refused(text, &[]), FormulaError::Syntax(_)), "{text}");
    }
    assert!(matches!(refused("-a*q", &[]), FormulaError::Unknown { name, .. } if name == "a"));
    assert_eq!(refused("q", &["a"]), FormulaError::Unused("a".to_owned()));
    assert_eq!(refused("q", &["q"]), FormulaError::Taken("q".to_owned()));
    assert_eq!(refused("sin", &["sin"]), FormulaError::Taken("sin".to_owned()));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]
    /// Any text is refused, or runs, or ends the simulation with an error.
    #[test]
    fn no_text_makes_it_panic(text in "(q|dq|cmd|t|sin|max|sign|abs|[-+*/^(), {}.0-9eE]|PI|é){0,12}") {
        if let Ok(effect) = formula(FormulaTarget::Torque, &text, &[]) {
            let placed = PlacedEffect { effect, site: "*".to_owned(), values: vec![] };
            let _ = simulate(RolloutRequest::new(&arm(), &hold(0.1)).setup(&fast(0.001, 0.01)).effects(&[placed]));
        }
    }
}
