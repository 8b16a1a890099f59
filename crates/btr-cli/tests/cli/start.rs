//! Where a fit begins: effects that are added begin where a diagnosis would begin them, and `--from` begins at the
//! values of another model.

use crate::freeze::estimate;
use crate::lab::{Lab, robots, text};
use serde_json::Value;
use std::fmt::Write;

/// A pendulum with a servo.
const MODEL: &str = r#"name = "swing"

[robot]
builtin = "pendulum"
length_m = 0.5

[actuators.hinge]
kind = "position"
kp = 25.0
kd = 0.6

[simulation]
control_s = 0.01
steps_per_control = 5
sample_every = 5

[noise]
position_rad = 0.0005

[parameters]
"mass@bob" = { relative = [0.75, 1.33] }
"kp@hinge" = { relative = [0.85, 1.18] }
"kd@hinge" = { relative = [0.85, 1.18] }
"#;

/// What the real one has beyond it. From a usual start, the order of the cogging is not found.
const EFFECTS: &str = r#"
[[effects]]
effect = "command_rate_limit"
site = "hinge"
rate = 1.2

[[effects]]
effect = "cogging"
site = "hinge"
amplitude = 0.27
order = 12.65
phase = -2.27
"#;

const LOGS: &str = "log_0.csv log_1.csv --held-out log_2.csv";
const ADDED: &str = "--add command_rate_limit@hinge --add cogging@hinge";

/// The model, and three logs of the real pendulum.
fn lab() -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", MODEL);
    lab.write("real.toml", &format!("{MODEL}{EFFECTS}"));
    for k in 0..3 {
        let mut commands = "t,cmd_hinge\n".to_owned();
        for i in 0..600 {
            let (t, k) = (0.01 * f64::from(i), f64::from(k));
            let waves = [(0.4, 1.1 + 0.2 * k), (0.3, 3.1 + 0.3 * k), (0.2, 5.7 - 0.4 * k)];
            let command: f64 = waves.iter().map(|(amplitude, rate)| amplitude * (rate * t).sin()).sum();
            writeln!(commands, "{t:.3},{command:.6}").unwrap();
        }
        lab.write(&format!("commands_{k}.csv"), &commands);
        let set = "--set parameters.mass@bob.value=1.1";
        lab.ok(&format!("simulate real.toml --log commands_{k}.csv -q --seed {k} {set} -o log_{k}.csv"));
    }
    lab
}

fn held_out(document: &Value) -> f64 {
    document["held_out"].as_f64().unwrap()
}

#[test]
fn effects_that_are_added_begin_where_a_diagnosis_would_begin_them() {
    let lab = lab();
    let fitted = lab.json(&format!("fit swing.toml {LOGS} {ADDED} -o fitted.toml"));
    assert!(held_out(&fitted) < 1.1, "{fitted}");
    let value = |name: &str| estimate(&fitted, name).unwrap()["value"].as_f64().unwrap();
    assert!((value("cogging.order@hinge") - 12.65).abs() < 0.03, "{fitted}");
    assert!((value("command_rate_limit.rate@hinge") - 1.2).abs() < 0.01, "{fitted}");
    let steps = fitted["error_ladder"].as_array().unwrap();
    assert!(steps.iter().any(|step| step["step"] == "added effects searched"), "{fitted}");
    // A model that has the effects already says where they begin, so that nothing is searched.
    lab.ok("add swing.toml command_rate_limit@hinge cogging@hinge -o has.toml");
    assert!(held_out(&lab.json(&format!("fit has.toml {LOGS}"))) > 10.0);
    // What is frozen stays frozen during the search.
    let frozen = lab.json(&format!("fit swing.toml {LOGS} {ADDED} --freeze k*@hinge"));
    assert!(held_out(&frozen) < 1.1 && estimate(&frozen, "kp@hinge").is_none(), "{frozen}");
}

#[test]
fn a_fit_begins_at_what_another_model_states() {
    let lab = lab();
    // About where a diagnosis ends; the mass is left to the model, and the gain is frozen there.
    let entries = "\"command_rate_limit.rate@hinge\" = { bounds = [0.1, 30.0], value = 1.21, sd = 0.001 }\n\
                   \"cogging.amplitude@hinge\" = { bounds = [0.0, 2.0], value = 0.26 }\n\
                   \"cogging.order@hinge\" = { bounds = [2.0, 200.0], value = 12.6 }\n\
                   \"cogging.phase@hinge\" = { bounds = [-3.2, 3.2], value = -2.2 }\n";
    lab.write("found.toml", &format!("{}{entries}", MODEL.replace("kp = 25.0", "kp = 27.0")));
    let fitted = lab.json(&format!("fit swing.toml {LOGS} --from found.toml --freeze kp@* -o fitted.toml"));
    assert!(held_out(&fitted) < 1.1, "{fitted}");
    let steps = fitted["error_ladder"].as_array().unwrap();
    assert_eq!(steps[1]["step"], "at the other model's values");
    assert!(steps.iter().all(|step| step["step"] != "added effects searched"), "{fitted}");
    let text = lab.read("fitted.toml");
    assert!(text.contains("kp = 25.0") && text.contains("\"kp@hinge\" = { relative = [0.85, 1.18] }"), "{text}");
    assert!(!text.contains("sd = 0.001 }"), "{text}");
    // What the other model found is kept where further effects are added, too.
    let more = lab.json(&format!("fit swing.toml {LOGS} --from found.toml --add viscous_friction@hinge"));
    assert!(held_out(&more) < 1.1, "{more}");
    // Effects of --add have the values that it states.
    let same = lab.json(&format!("fit fitted.toml {LOGS} --from found.toml"));
    assert!((held_out(&same) - held_out(&fitted)).abs() < 0.01, "{same}");
}

#[test]
fn a_fit_keeps_what_a_diagnosis_reached() {
    let lab = lab();
    let found = lab.json(&format!("diagnose swing.toml {LOGS} -o found.toml"));
    let reached = found["error_ladder"].as_array().unwrap().last().unwrap()["held_out"].as_f64().unwrap();
    let fitted = lab.json(&format!("fit swing.toml {LOGS} --from found.toml"));
    assert!(reached < 1.1 && held_out(&fitted) < 1.02 * reached, "{reached}: {fitted}");
}

#[test]
fn a_start_that_says_nothing_about_the_model_is_refused() {
    let lab = lab();
    let refused = |model: &str, from: &str, words: &[&str]| {
        let told = lab.complaint(&format!("fit {model} {LOGS} --from {from} -o out.toml"));
        assert!(words.iter().all(|word| told.contains(word)), "{told}");
        assert!(!lab.exists("out.toml"));
    };
    let arm = robots().join("arm.toml").display().to_string();
    refused("swing.toml", &arm, &["another robot than swing.toml", "help: begin with a model of the same robot"]);
    refused(
        "swing.toml",
        "real.toml",
        &["real.toml has `command_rate_limit@hinge` with values of its own", "[[effects]]"],
    );
    refused("swing.toml", "missing.toml", &["missing.toml"]);
    let (bare, _) = MODEL.split_once("[parameters]").unwrap();
    lab.write("bare.toml", bare);
    lab.write(
        "only.toml",
        &format!("{bare}[parameters]\n\"coulomb_friction.torque@hinge\" = {{ bounds = [0.0, 1.0] }}\n"),
    );
    refused("only.toml", "bare.toml", &["bare.toml states no value of any parameter that is fitted"]);
    let told = lab.complaint(&format!("fit swing.toml {LOGS} --from bare.toml -o bare.toml"));
    assert!(told.contains("bare.toml is an input and would be overwritten"), "{told}");
    // What it states outside of [parameters] counts as well; what it does not state is told.
    lab.write("gain.toml", &bare.replace("kp = 25.0", "kp = 26.0"));
    let output = lab.run(&format!("fit swing.toml {LOGS} --from gain.toml --add coulomb_friction@hinge"));
    let told = text(&output.stderr);
    assert!(told.contains("gain.toml does not state coulomb_friction.torque@hinge: begun as without it"), "{told}");
    assert!(told.contains("at the other model's values"), "{told}");
}
