//! `sd` in a model file: what earlier logs left of a parameter is the prior of the next fit.

use crate::freeze::{MODEL, estimate, planted};
use crate::lab::Lab;
use serde_json::{Value, json};

const FRICTION: &str = "viscous_friction.coefficient@hinge";
/// The true mass and friction.
const TRUTH: [(&str, f64); 2] = [("mass@bob", 1.3), (FRICTION, 0.3)];

/// The model, and two logs of one pendulum with different noise.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", MODEL);
    planted(&lab, "swing.toml", "a.csv", 1, TRUTH[0].1, TRUTH[1].1);
    planted(&lab, "swing.toml", "b.csv", 2, TRUTH[0].1, TRUTH[1].1);
    lab
}

/// A parameter's estimate and the standard deviation by its interval.
fn fitted(document: &Value, name: &str) -> (f64, f64) {
    let number = |value: &Value| value.as_f64().unwrap();
    let parameter = estimate(document, name).unwrap();
    let [low, high] = [0, 1].map(|end| number(&parameter["ci95"][end]));
    (number(&parameter["value"]), (high - low) / (2.0 * 1.96))
}

/// The `sd` of a parameter in a model file.
fn sd_in(text: &str, name: &str) -> Option<f64> {
    let file: toml::Table = toml::from_str(text).unwrap();
    file["parameters"][name].get("sd").map(|sd| sd.as_float().unwrap())
}

#[test]
fn one_log_after_the_other_tells_what_both_tell_together() {
    let lab = lab();
    let first = lab.json("fit swing.toml a.csv -o a.toml");
    assert_eq!(first["with_prior"], Value::Null);
    let told = lab.ok("fit a.toml b.csv -o ab.toml");
    assert!(told.contains("prior from earlier logs") && told.contains("must not be among these"), "{told}");
    let after = lab.json("fit a.toml b.csv");
    assert_eq!(after["with_prior"], json!(["mass@bob", FRICTION]));
    let (alone, both) = (lab.json("fit swing.toml b.csv"), lab.json("fit swing.toml a.csv b.csv"));
    for (name, truth) in TRUTH {
        let [first, after, alone, both] = [&first, &after, &alone, &both].map(|document| fitted(document, name));
        let kept = sd_in(&lab.read("a.toml"), name).unwrap();
        // Mass and friction are correlated, and a file holds no correlation: what is kept is wider.
        assert!((1.0..1.42).contains(&(kept / first.1)), "{name}: {kept} is kept of {first:?}");
        assert!((after.0 - both.0).abs() < 0.5 * both.1, "{name}: {after:?}, together {both:?}");
        assert!((0.93..1.2).contains(&(after.1 / both.1)), "{name}: {after:?}, together {both:?}");
        assert!(after.1 < 0.85 * alone.1, "{name}: {after:?}, alone {alone:?}");
        assert!((after.0 - truth).abs() < 3.0 * after.1, "{name}: {after:?} of {truth}");
    }
    let renewed = sd_in(&lab.read("ab.toml"), FRICTION).unwrap() / fitted(&after, FRICTION).1;
    assert!((1.0..1.42).contains(&renewed), "{renewed}");
}

#[test]
fn a_prior_holds_a_parameter_that_the_next_log_does_not_tell() {
    const LIMIT: &str = "max_torque@hinge";
    let lab = Lab::new();
    let model = MODEL.replace("[drive]", "\"max_torque@hinge\" = { bounds = [0.4, 2.0], value = 0.75 }\n\n[drive]");
    lab.write("swing.toml", &model);
    // Only the first log reaches the limit.
    let truth = model.replace("value = 0.75", "value = 0.7");
    lab.write("strong.toml", &truth);
    lab.write("gentle.toml", &truth.replace("= 0.8 }", "= 0.3 }"));
    planted(&lab, "strong.toml", "a.csv", 1, TRUTH[0].1, TRUTH[1].1);
    planted(&lab, "gentle.toml", "b.csv", 2, TRUTH[0].1, TRUTH[1].1);
    lab.ok("fit swing.toml a.csv -q -o a.toml");
    let without = lab.json("fit swing.toml b.csv");
    assert!(without["null_directions"][0]["sentence"].as_str().unwrap().starts_with("max_torque@hinge is dead"));
    assert_eq!(estimate(&without, LIMIT).unwrap()["by_bounds"], true);
    let with = lab.json("fit a.toml b.csv -o after.toml");
    assert_eq!((&with["null_directions"], &estimate(&with, LIMIT).unwrap()["by_bounds"]), (&json!([]), &json!(false)));
    let [first, after] = ["a.toml", "after.toml"].map(|model| sd_in(&lab.read(model), LIMIT).unwrap());
    assert!((fitted(&with, LIMIT).0 - 0.7).abs() < 3.0 * after, "{with}");
    assert!((after / first - 1.0).abs() < 0.1, "{first}, then {after}");
}

#[test]
fn no_sd_is_written_where_there_is_no_honest_interval() {
    let lab = lab();
    lab.ok("fit swing.toml a.csv -q -o a.toml");
    // A wrong length, frozen into the model: the intervals are withheld, and what was known before goes as well.
    lab.write("wrong.toml", &lab.read("a.toml").replace("length_m = 0.5", "length_m = 0.3"));
    let wrong = lab.json("fit wrong.toml b.csv -o none.toml");
    assert!(wrong["withheld"].is_string(), "{wrong}");
    assert_eq!(TRUTH.map(|(name, _)| sd_in(&lab.read("none.toml"), name)), [None, None]);
    // At a bound.
    lab.write("low.toml", &MODEL.replace("bounds = [0.0, 1.0]", "bounds = [0.29999, 1.0]").replace("0.1 }", "0.4 }"));
    planted(&lab, "swing.toml", "slack.csv", 3, TRUTH[0].1, 0.29);
    let low = lab.json("fit low.toml slack.csv -o low_fitted.toml");
    assert_eq!(estimate(&low, FRICTION).unwrap()["at_bound"], true, "{low}");
    assert_eq!(sd_in(&lab.read("low_fitted.toml"), FRICTION), None);
}

#[test]
fn a_frozen_parameter_and_a_diagnosis_keep_what_earlier_logs_left() {
    let lab = lab();
    lab.ok("fit swing.toml a.csv -q -o a.toml");
    let kept = TRUTH.map(|(name, _)| sd_in(&lab.read("a.toml"), name));
    lab.ok("fit a.toml b.csv -q --freeze mass@bob -o frozen.toml");
    assert_eq!(sd_in(&lab.read("frozen.toml"), "mass@bob"), kept[0]);
    let found = lab.json("diagnose a.toml b.csv -o found.toml");
    assert_eq!((&found["verdict"], &found["with_prior"]), (&json!("nothing_missing"), &json!(["mass@bob", FRICTION])));
    // The logs of a diagnosis are fitted next, so they must not be in the prior.
    assert_eq!(TRUTH.map(|(name, _)| sd_in(&lab.read("found.toml"), name)), kept);
}

#[test]
fn an_sd_must_be_that_of_a_value() {
    let with = |entry: &str| {
        let lab = lab();
        lab.write("wrong.toml", &MODEL.replace("value = 1.0 }", entry));
        lab.complaint("fit wrong.toml a.csv")
    };
    assert!(with("value = 1.0, sd = 0.0 }").contains("sd = 0 must be a positive number"));
    let alone = with("sd = 0.1 }");
    assert!(alone.contains("wrong.toml:18") && alone.contains("give value = ... beside it"), "{alone}");
}
