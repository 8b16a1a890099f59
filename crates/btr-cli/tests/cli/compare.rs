//! Where a model fails, and what logs are worth: `btr compare` and `btr check`.

use crate::lab::Lab;
use btr_io::{Mapping, Meta, is_overlay, read_log, write_log};
use serde_json::Value;
use std::path::Path;

/// A servo that swings a pendulum, with a sensor that errs.
const SWING: &str = r#"name = "swing"
[robot]
builtin = "pendulum"
length_m = 0.5
[actuators.hinge]
kind = "position"
kp = 60.0
kd = 4.0
[simulation]
control_s = 0.01
steps_per_control = 40
sample_every = 40
duration_s = 8.0
[noise]
position_rad = 0.0005
position_quantum_rad = 0.0015
velocity_rad_s = 0.02
torque_n_m = 0.02
[drive]
kind = "sine"
omega_rad_s = 4.0
set = { "amplitude@hinge" = 0.6, "phase@hinge" = 0.0 }
"#;

/// A lab with `swing.toml`, and `log.csv` of a robot that has this effect as well.
pub(crate) fn lab(effect: &str) -> Lab {
    let lab = Lab::new();
    lab.write("swing.toml", SWING);
    lab.write("robot.toml", &format!("{SWING}[[effects]]\n{effect}\n"));
    lab.ok("simulate robot.toml --seed 7 -q -o log.csv");
    lab
}

pub(crate) const FRICTION: &str = "effect = \"coulomb_friction\"\ntorque = 0.5";
pub(crate) const NONE: &str = "effect = \"coulomb_friction\"\ntorque = 0.0";

#[test]
fn a_right_model_leaves_noise() {
    let lab = lab(NONE);
    let found = lab.json("compare swing.toml log.csv --max-chi 1.3");
    for channel in found["channels"].as_array().unwrap() {
        let chi = channel["chi"].as_f64().unwrap();
        assert!((0.9..1.3).contains(&chi), "{channel}");
    }
    assert!(found["channels"][0]["fit_percent"].as_f64().unwrap() > 99.0);
    assert!(found["integrator_error"].as_f64().unwrap() < 1.0, "{found}");
}

#[test]
fn both_robots_are_written_for_viewers_and_no_recording_is_overwritten() {
    let lab = lab(FRICTION);
    lab.ok("convert log.csv log.mcap");
    lab.ok("compare swing.toml log.csv -o overlay.mcap -q");
    assert!(is_overlay(&lab.path("overlay.mcap")) && !is_overlay(&lab.path("log.mcap")));
    let said = lab.ok("compare swing.toml log.csv -o overlay.mcap");
    insta::assert_snapshot!("overlay_opened", said.split_once("\noverlay.mcap").map_or("", |(_, told)| told));
    // An earlier one may be replaced; a recording may not, nor what is no MCAP file by its name.
    lab.ok("compare swing.toml log.csv log.csv -o overlay.mcap -q");
    let before = std::fs::read(lab.path("log.mcap")).unwrap();
    let refused = |output: &str| lab.complaint(&format!("compare swing.toml log.csv -o {output}"));
    assert!(refused("log.mcap").contains("may be a recording, which would be lost"));
    assert_eq!(std::fs::read(lab.path("log.mcap")).unwrap(), before);
    assert!(refused("overlay.csv").contains("must end in .mcap"));
}

#[test]
fn what_a_diagnosis_finds_is_kept_and_a_fit_goes_on_from_there() {
    let lab = lab(FRICTION);
    let found = lab.json("diagnose swing.toml log.csv -o found.toml");
    assert_eq!((&found["verdict"], &found["cut_short"]), (&"effect_missing".into(), &false.into()));
    let last = |document: &serde_json::Value, k: usize| document["error_ladder"][k]["train"].as_f64().unwrap();
    let reached = last(&found, found["error_ladder"].as_array().unwrap().len() - 1);
    let fitted = lab.json("fit found.toml log.csv");
    assert!((last(&fitted, 0) / reached - 1.0).abs() < 0.01, "{reached}: {fitted}");
    // A model that has what was found lacks nothing.
    assert_eq!(lab.json("diagnose found.toml log.csv")["verdict"], "nothing_missing");
}

#[test]
fn a_wrong_value_is_told_kept_and_fitted() {
    let lab = Lab::new();
    let rotor = |inertia: f64| format!("{SWING}[[effects]]\neffect = \"armature\"\ninertia = {inertia}\n");
    lab.write("swing.toml", &rotor(0.03));
    lab.write("robot.toml", &rotor(0.09));
    lab.ok("simulate robot.toml --seed 7 -q -o log.csv");
    let found = lab.json("diagnose swing.toml log.csv -o found.toml");
    let value = &found["wrong_values"][0];
    assert_eq!((&found["verdict"], &found["effects"]), (&"value_wrong".into(), &serde_json::json!([])), "{found}");
    let corrected = &value["parameters"][0];
    assert_eq!((&value["value"], &corrected["in_model"]), (&"armature".into(), &0.03.into()), "{value}");
    let near = |estimate: &Value| (estimate["value"].as_f64().unwrap() / 0.09 - 1.0).abs() < 0.05;
    assert!(near(corrected), "{corrected}");
    // The model that was kept lacks nothing, and a fit of the value alone ends there as well.
    assert_eq!(lab.json("diagnose found.toml log.csv")["verdict"], "nothing_missing");
    let name = corrected["name"].as_str().unwrap();
    let fitted = lab.json(&format!("fit swing.toml log.csv --add {name}"));
    assert!(near(&fitted["parameters"][0]), "{fitted}");
    let wrong = lab.complaint("fit swing.toml log.csv --add kp@hing");
    assert!(wrong.contains("no movable joint `hing`; did you mean `hinge`?"), "{wrong}");
}

#[test]
fn a_joint_that_counts_the_other_way_round_is_told_and_kept() {
    let lab = Lab::new();
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let read = |name: &str| std::fs::read_to_string(robots.join(name)).unwrap();
    let arm = read("arm.toml");
    let reversed = "[parameters]\n\"direction@elbow\" = { bounds = [-1, 1], value = -1 }\n";
    lab.write("arm.urdf", &read("arm.urdf"));
    lab.write("arm.toml", &arm);
    lab.write("robot.toml", &arm.replace("[parameters]\n", reversed));
    for log in ["learn_1", "learn_2"] {
        let commands = robots.join(format!("arm/{log}.csv"));
        lab.ok(&format!("simulate robot.toml --log {} --seed 7 -q -o {log}.csv", commands.display()));
    }
    let told = lab.ok("diagnose arm.toml learn_1.csv learn_2.csv -o found.toml");
    for part in ["wrong in the model: direction of elbow", "turn its axis round in the robot's file", "factor -1"] {
        assert!(told.contains(part), "{told}");
    }
    assert_eq!(lab.json("diagnose found.toml learn_1.csv learn_2.csv")["verdict"], "nothing_missing");
    let fitted = lab.json("fit arm.toml learn_1.csv --add direction@elbow -o fitted.toml");
    assert!(!fitted["null_directions"].to_string().contains("direction@elbow is dead"), "{fitted}");
    let refused = lab.complaint("export fitted.toml --to ros2 -o limits.yaml");
    assert!(refused.contains("elbow counts the other way round") && refused.contains("turn the axis"), "{refused}");
}

#[test]
fn a_diagnosis_out_of_time_reports_and_keeps_the_best_so_far() {
    let lab = lab(FRICTION);
    let found = lab.json("diagnose swing.toml log.csv --max-time 0.000001 -o found.toml");
    assert_eq!((&found["cut_short"], &found["verdict"]), (&true.into(), &"unexplained".into()), "{found}");
    assert_eq!(found["effects"].as_array().unwrap().len(), 0);
    assert!(lab.exists("found.toml"));
    assert!(
        lab.ok("diagnose swing.toml log.csv --max-time 0.000001")
            .contains("cut short; so far: unexplained: nothing that was tried helps")
    );
    // The limit is named, and the next command goes on with the diagnosis.
    let told = lab.ok("diagnose swing.toml log.csv --max-time 0.000001 -o found.toml");
    assert!(
        told.contains("stopped at --max-time") && told.contains("next: btr diagnose found.toml log.csv\n"),
        "{told}"
    );
    let told = lab.ok("diagnose swing.toml log.csv --max-rollouts 1");
    assert!(told.contains("stopped at --max-rollouts 1") && told.contains("log.csv --max-rollouts "), "{told}");
    for wrong in ["0", "-1", "inf", "soon"] {
        assert!(
            lab.complaint(&format!("diagnose swing.toml log.csv --max-time={wrong}")).contains("above 0"),
            "{wrong}"
        );
    }
}

#[test]
fn friction_is_seen_at_its_joint_and_follows_the_sign_of_the_velocity() {
    let lab = lab(FRICTION);
    let found = lab.json("compare swing.toml log.csv");
    let failures = found["failures"].as_array().unwrap();
    assert!(failures[0]["joint"] == "hinge" && failures[0]["follows"] == "sign_of_velocity", "{}", failures[0]);
    let throughout = failures.iter().find(|f| f["regime"] == "throughout").unwrap();
    assert!(throughout["hint"].as_str().unwrap().contains("the sign of the velocity"), "{throughout}");
    insta::assert_snapshot!("compare_table", lab.ok("compare swing.toml log.csv"));
}

#[test]
fn late_is_said_where_a_shift_in_time_removes_most_of_the_error() {
    let late = lab("effect = \"encoder_delay\"\ndelay = 0.042");
    let verdict = &late.json("compare swing.toml log.csv")["verdict"];
    let hinge = &verdict["joints"][0];
    assert_eq!((&hinge["joint"], &hinge["cause"]["kind"]), (&"hinge".into(), &"late".into()), "{verdict}");
    assert!((hinge["cause"]["lag_s"].as_f64().unwrap() - 0.042).abs() < 0.002, "{verdict}");
    assert!(hinge["cause"]["share"].as_f64().unwrap() > 0.9, "{verdict}");
    let said = verdict["sentences"][0].as_str().unwrap();
    assert!(said.starts_with("hinge: ") && said.contains("it arrives 42 ms late: "), "{said}");
    assert!(late.ok("compare swing.toml log.csv").starts_with(said));
    // Friction shifts the motion as well, but that is not most of its error.
    let rubs = &lab(FRICTION).json("compare swing.toml log.csv")["verdict"]["joints"][0];
    assert_eq!((&rubs["cause"]["kind"], &rubs["cause"]["follows"]), (&"follows".into(), &"sign_of_velocity".into()));
    assert!(rubs["x_noise_floor"].as_f64().unwrap() > 10.0, "{rubs}");
    let fine = &lab(NONE).json("compare swing.toml log.csv")["verdict"];
    let said = fine["sentences"][0].as_str().unwrap();
    assert!(said.starts_with("every joint is within 1.02 x") && said.contains("nothing is left"), "{said}");
    assert!(!said.contains("not white"), "{said}");
    assert!(fine["joints"][0]["sentence"].is_null() && fine["joints"][0]["cause"].is_null(), "{fine}");
}

/// The sentence and the column `white` of the table below it must not contradict each other.
#[test]
fn an_error_as_small_as_noise_that_is_not_white_is_told() {
    let lab = lab("effect = \"coulomb_friction\"\ntorque = 0.006");
    let document = lab.json("compare swing.toml log.csv");
    let said = document["verdict"]["sentences"][0].as_str().unwrap();
    let names = |white: bool| {
        let channels = document["channels"].as_array().unwrap().iter();
        channels.filter(|channel| channel["white"] == white).map(|c| c["name"].as_str().unwrap()).collect::<Vec<_>>()
    };
    assert!(said.contains("nothing is left to explain") && !names(false).is_empty(), "{document}");
    assert!(names(false).iter().all(|name| said.contains(name)) && said.contains("not white"), "{said}");
}

#[test]
fn joints_that_are_late_alike_share_a_sentence() {
    let lab = Lab::new();
    let robot = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let model = std::fs::read_to_string(robot.join("arm.toml")).unwrap();
    lab.write("arm.urdf", &std::fs::read_to_string(robot.join("arm.urdf")).unwrap());
    lab.write("arm.toml", &model);
    lab.write("late.toml", &format!("{model}\n[[effects]]\neffect = \"encoder_delay\"\nsite = \"*\"\ndelay = 0.04\n"));
    std::fs::copy(robot.join("arm/learn_1.csv"), lab.path("commands.csv")).unwrap();
    lab.ok("simulate late.toml --log commands.csv --seed 3 -q -o log.csv");
    let verdict = &lab.json("compare arm.toml log.csv")["verdict"];
    assert_eq!(verdict["sentences"].as_array().unwrap().len(), 1, "{verdict}");
    let said = verdict["sentences"][0].as_str().unwrap();
    assert!(said.contains(" arrive 40 ms late: ") && said.contains("is worst"), "{said}");
}

#[test]
fn the_documents_have_the_keys_that_others_rely_on() {
    let lab = lab(FRICTION);
    let found = lab.json("compare swing.toml log.csv");
    let has = |value: &Value, keys: &[&str]| {
        let object = value.as_object().unwrap();
        keys.iter().for_each(|key| assert!(object.contains_key(*key), "{key} is not in {value}"));
    };
    has(&found, &["ok", "verdict", "channels", "failures", "integrator_error"]);
    has(
        &found["channels"][0],
        &["name", "unit", "rmse", "fit_percent", "bias", "lag_s", "noise_floor", "chi", "white"],
    );
    has(&found["failures"][0], &["joint", "regime", "t0", "t1", "rmse", "hint"]);
    let checked = lab.json("check swing.toml log.csv");
    has(&checked["logs"][0], &["log", "verdict", "clock", "channels", "joints", "findings"]);
    has(&checked["logs"][0]["findings"][0], &["topic", "severity", "channel", "sentence"]);
}

#[test]
fn a_missed_gate_and_a_mistake_have_their_own_exit_codes() {
    let lab = lab(FRICTION);
    lab.exits("compare swing.toml log.csv --max-chi 2", 1);
    lab.exits("compare swing.toml log.csv --max-chi 500", 0);
    assert!(lab.complaint("compare swing.toml log.csv --max-chi -1").contains("--max-chi"));
    assert!(lab.complaint("compare swing.toml no.csv").contains("no.csv"));
    assert!(lab.complaint("compare swing.toml").contains("LOG"));
    lab.write("blind.csv", "t,cmd_hinge\n0,0\n0.01,0.1\n0.02,0.2\n");
    assert!(lab.complaint("compare swing.toml blind.csv").contains("q_hinge"));
}

#[test]
fn check_tells_what_logs_are_worth() {
    let lab = lab(FRICTION);
    let told = lab.ok("check swing.toml log.csv");
    assert!(told.starts_with("log.csv: fine") && told.contains("hinge follows its command after"), "{told}");
    let text = lab.read("log.csv");
    // A fifth of the positions is lost.
    let holed: Vec<String> = text
        .lines()
        .enumerate()
        .map(|(k, line)| {
            let mut cells: Vec<&str> = line.split(',').collect();
            cells[2] = if k > 0 && k % 5 == 0 { "" } else { cells[2] };
            cells.join(",")
        })
        .collect();
    lab.write("holed.csv", &holed.join("\n"));
    let told = lab.ok("check swing.toml holed.csv");
    assert!(told.contains("doubtful") && told.contains("q_hinge lacks 20.0 % of its samples"), "{told}");
    lab.ok("compare swing.toml holed.csv log.csv");
}

#[test]
fn nothing_is_written_over_what_is_read() {
    let lab = lab(FRICTION);
    let (model, log) = (lab.read("swing.toml"), lab.read("log.csv"));
    for arguments in [
        "compare swing.toml log.csv --report log.csv",
        "compare swing.toml log.csv --report ./swing.toml",
        "simulate swing.toml --log log.csv -o log.csv",
        "fit swing.toml log.csv -o swing.toml",
        "diagnose swing.toml log.csv --next log.csv",
        "convert log.csv log.csv",
    ] {
        assert!(lab.complaint(arguments).contains("would be overwritten"), "{arguments}");
    }
    assert!(lab.read("swing.toml") == model && lab.read("log.csv") == log);
}

#[test]
fn an_output_takes_the_place_of_nothing_but_its_own_kind_and_is_refused_before_anything_is_computed() {
    let lab = lab(FRICTION);
    lab.write("other.csv", &lab.read("log.csv"));
    lab.write("foreign.csv", "t,hinge_position\n0,0\n0.01,0\n");
    lab.write("told.csv", "t,cmd_hinge\n0,0\n0.01,0\n0.02,0\n");
    lab.write("index.csv", "file,mass\nlog.csv,1\n");
    lab.write("arm.html", "<robot/>");
    let named = "[logs]\nindex = \"index.csv\"\n[drive]\nlog = \"told.csv\"\n";
    lab.write(
        "named.toml",
        &lab.read("swing.toml").replace("[drive]\n", named).replace("[robot]", "[robot]\nurdf = \"arm.html\""),
    );
    let before: Vec<String> = ["other.csv", "foreign.csv", "told.csv", "arm.html"].map(|name| lab.read(name)).into();
    for (arguments, why) in [
        ("fit swing.toml log.csv -o other.csv", "the name of a model must end in .toml"),
        ("add swing.toml coulomb_friction -o other.csv", "the name of a model must end in .toml"),
        ("compare swing.toml log.csv --report other.csv", "the name of a report must end in .html"),
        ("diagnose swing.toml log.csv -o other.csv", "the name of a model must end in .toml"),
        ("diagnose swing.toml log.csv --report robot.toml", "the name of a report must end in .html"),
        ("diagnose swing.toml log.csv --next other.csv", "contains more than commands"),
        ("diagnose swing.toml log.csv --next foreign.csv", "contains more than commands"),
        ("diagnose swing.toml log.csv --next drive.txt", "not a log format that btr reads"),
        ("convert log.csv other.csv", "contains more than commands"),
        ("simulate swing.toml -o other.csv", "contains more than commands"),
        ("compare named.toml log.csv --report arm.html", "is an input"),
        ("diagnose named.toml log.csv --next told.csv", "is an input"),
        ("simulate named.toml -o index.csv --overwrite", "is an input"),
        ("fit swing.toml log.csv -o no/such/folder.toml", "folder.toml: No such file"),
        ("diagnose swing.toml log.csv --next no/such/drive.csv", "drive.csv: No such file"),
    ] {
        let said = lab.complaint(arguments);
        assert!(said.contains(why) && !said.contains("noise floor"), "{arguments}: {said}");
    }
    let after: Vec<String> = ["other.csv", "foreign.csv", "told.csv", "arm.html"].map(|name| lab.read(name)).into();
    assert_eq!(before, after);
    lab.ok("simulate swing.toml -q -o other.csv --overwrite");
    lab.ok("convert other.csv new.mcap -q");
    assert_ne!(lab.read("other.csv"), before[0]);
}

#[test]
fn steps_that_are_too_coarse_are_halved_and_that_is_said() {
    let lab = lab(NONE);
    lab.write(
        "coarse.toml",
        &SWING.replace("steps_per_control = 40", "steps_per_control = 1").replace("sample_every = 40", ""),
    );
    let found = lab.json("compare coarse.toml log.csv");
    assert_eq!(found["time_step_s"], 0.005);
    let said = lab.ok("compare coarse.toml log.csv");
    assert!(
        said.contains(
            "Simulated in steps of 5.000 ms: with the model's 10.00 ms the integrator's error exceeds a fifth"
        ),
        "{said}"
    );
    assert!(!lab.ok("compare swing.toml log.csv").contains("Simulated in steps"));
}

/// Two fingers, of which the right one follows the left one.
const GRIPPER: &str = r#"<robot name="gripper"><link name="palm"/>
<link name="left"><inertial><origin xyz="0 0 0.1"/><mass value="0.2"/>
  <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="right"><inertial><origin xyz="0 0 0.1"/><mass value="0.2"/>
  <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="left" type="continuous"><parent link="palm"/><child link="left"/><axis xyz="1 0 0"/></joint>
<joint name="right" type="continuous"><parent link="palm"/><child link="right"/><axis xyz="1 0 0"/>
  <mimic joint="left" multiplier="-1"/></joint>
</robot>"#;

#[test]
fn nobody_has_to_tell_a_finger_that_follows_another_one() {
    let lab = Lab::new();
    lab.write("gripper.urdf", GRIPPER);
    let model = SWING.replace("builtin = \"pendulum\"\nlength_m = 0.5", "urdf = \"gripper.urdf\"\nbase = \"fixed\"");
    lab.write("gripper.toml", &model.replace("actuators.hinge", "actuators.\"*\"").replace("@hinge", "@left"));
    lab.ok("simulate gripper.toml --seed 7 -q -o log.csv");
    let log = lab.read("log.csv");
    let mut rows = log.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let header = rows.next().unwrap();
    let kept = |name: &str| name == "t" || name.ends_with("_left") || name == "q_right";
    let few = |row: &[&str]| {
        let cells = row.iter().zip(&header).filter(|(_, name)| kept(name)).map(|(cell, _)| *cell);
        cells.collect::<Vec<_>>().join(",") + "\n"
    };
    lab.write("few.csv", &(few(&header) + &rows.map(|row| few(&row)).collect::<String>()));
    let found = lab.json("compare gripper.toml few.csv --max-chi 1.3");
    let right = found["channels"].as_array().unwrap().iter().find(|channel| channel["name"] == "q_right").unwrap();
    assert!(right["fit_percent"].as_f64().unwrap() > 99.0, "{right}");
    let checked = lab.run("check gripper.toml few.csv");
    assert!(checked.status.success(), "{checked:?}");
}

#[test]
fn what_led_a_joint_from_one_reference_to_the_next_is_followed_as_it_was_logged() {
    let lab = Lab::new();
    let led = SWING.replace(
        "control_s = 0.01\nsteps_per_control = 40\nsample_every = 40",
        "control_s = 0.08\nsteps_per_control = 80\ninterpolate = true",
    );
    lab.write("led.toml", &led);
    lab.ok("simulate led.toml --seed 7 -q -o log.csv");
    follows(&lab, "log.csv");
    // References that were logged as they were sent, and held since, are led as the model has it.
    let (mut log, _) = read_log(&lab.path("log.csv"), &Mapping::default()).unwrap();
    let told = log.values_mut("cmd_hinge").unwrap();
    (0..told.len()).for_each(|sample| told[sample] = told[sample - sample % 80]);
    write_log(&lab.path("sent.csv"), &log, &Meta::default()).unwrap();
    follows(&lab, "sent.csv");
}

/// The swing of a log is that of the model `led.toml` but for its sensor's noise.
fn follows(lab: &Lab, log: &str) {
    let found = lab.json(&format!("compare led.toml {log}"));
    assert_eq!(found["warnings"], serde_json::json!([]));
    let moves = |channel: &&Value| channel["name"] != "tau_hinge";
    for channel in found["channels"].as_array().unwrap().iter().filter(moves) {
        assert!(channel["chi"].as_f64().unwrap() < 1.1, "{channel}");
    }
}

/// A joint with a small share of the error of all joints has a sentence, and is in the map as well.
#[test]
fn every_joint_that_is_off_is_in_the_map() {
    let lab = lab(FRICTION);
    for (name, by) in [("arm.urdf", "arm.urdf"), ("arm.toml", "arm.toml"), ("arm/learn_1.csv", "arm_1.csv")] {
        std::fs::copy(crate::lab::robots().join(name), lab.path(by)).unwrap();
    }
    let mut column = None;
    lab.edit("arm_1.csv", "arm_2.csv", |row, cells| {
        let place = *column.get_or_insert_with(|| cells.iter().position(|name| name == "q_elbow").unwrap());
        if row > 0 {
            let time: f64 = cells[0].parse().unwrap();
            let moved = cells[place].parse::<f64>().unwrap() + 0.003 * (2.0 * time).sin();
            cells[place] = moved.to_string();
        }
        true
    });
    let said = lab.ok("compare arm.toml arm_2.csv");
    let (sentences, map) = said.split_once("Where it fails").unwrap();
    let off: Vec<&str> = sentences.lines().take_while(|line| !line.is_empty()).collect();
    assert!(off.len() >= 2 && off.iter().any(|line| line.starts_with("elbow: ")), "{said}");
    for line in off {
        let joint = line.split(':').next().unwrap();
        let first =
            map.lines().find(|line| line.starts_with(&format!("  {joint}, "))).unwrap_or_else(|| panic!("{said}"));
        let largest = line.split_once("largest ").map_or("", |(_, regime)| regime.split(',').next().unwrap());
        assert!(first.contains(largest), "{line}\n{first}");
    }
}

/// What the model states of repeatability counts where little is left.
#[test]
fn what_runs_differ_by_is_not_left_to_be_explained() {
    let lab = lab("effect = \"coulomb_friction\"\ntorque = 0.04");
    let said = |model: &str| lab.ok(&format!("compare {model} log.csv")).lines().next().unwrap().to_owned();
    let swing = SWING.replace("torque_n_m = 0.02", "torque_n_m = 0.2");
    lab.write("bare.toml", &swing);
    let bare = said("bare.toml");
    assert!(bare.contains("little is left to explain"), "{bare}");
    lab.write("known.toml", &swing.replace("[noise]\n", "[noise]\nmodel_rad = 0.001\n"));
    let known = said("known.toml");
    assert!(known.contains("no more than runs of the same command differ by: nothing is left"), "{known}");
}
