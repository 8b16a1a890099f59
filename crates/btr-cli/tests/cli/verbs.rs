//! The verbs beside `coevolve`: simulate, info, convert, effects, schema, completions.

use crate::lab::{Lab, robots};
use std::process::Command;

#[test]
fn simulate_writes_what_the_sensors_say_as_csv_and_mcap() {
    let lab = Lab::new();
    let told = lab.ok("simulate small.toml -o walk.csv");
    assert!(told.contains("walk.csv: 51 samples") && told.contains("energy"), "{told}");
    let csv = lab.read("walk.csv");
    assert_eq!(csv.lines().next(), Some("t,cmd_hinge,q_hinge,dq_hinge,tau_hinge"));
    assert_eq!(csv.lines().count(), 52);

    let document = lab.json("simulate small.toml -o walk.mcap");
    assert_eq!((&document["ok"], &document["samples"]), (&true.into(), &51.into()));
    assert!(document["fitness"]["energy"].as_f64().unwrap() > 0.0);
    let info = lab.json("info walk.mcap");
    let names: Vec<&str> = info["channels"].as_array().unwrap().iter().map(|c| c["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["cmd_hinge", "q_hinge", "dq_hinge", "tau_hinge"]);
    assert_eq!((&info["samples"], info["channels"][1]["unit"].as_str()), (&51.into(), Some("rad")));
}

#[test]
fn simulate_replays_a_log_and_takes_another_files_drive_from_where_that_file_is() {
    let lab = Lab::new();
    lab.ok("simulate small.toml -q -o first.csv");
    lab.ok("simulate small.toml -q -o again.csv --log first.csv");
    assert_eq!(lab.read("first.csv"), lab.read("again.csv"));
    std::fs::create_dir(lab.path("drives")).unwrap();
    std::fs::rename(lab.path("again.csv"), lab.path("drives/told.csv")).unwrap();
    lab.write("drives/replay.toml", "[drive]\nkind = \"replay\"\nlog = \"told.csv\"\n");
    lab.ok("simulate small.toml -q -o third.csv --drive drives/replay.toml");
    assert_eq!(lab.read("first.csv"), lab.read("third.csv"));
}

#[test]
fn a_floating_robot_has_an_imu_and_a_place_for_robot_viewers() {
    let lab = Lab::new();
    let ant = robots().join("ant.toml");
    lab.ok(&format!("simulate {} --set simulation.duration_s=0.1 -q -o ant.mcap", ant.display()));
    let bytes = std::fs::read(lab.path("ant.mcap")).unwrap();
    for topic in ["/imu", "/tf", "/joint_states", "/robot_description"] {
        assert!(bytes.windows(topic.len()).any(|window| window == topic.as_bytes()), "no {topic}");
    }
}

#[test]
fn convert_to_mcap_and_back_changes_nothing() {
    let lab = Lab::new();
    lab.ok("simulate small.toml -q -o a.csv");
    assert_eq!(lab.json("convert a.csv b.mcap")["samples"], 51);
    lab.ok("convert b.mcap c.csv -q");
    assert_eq!(lab.read("a.csv"), lab.read("c.csv"));
}

#[test]
fn effects_are_listed_and_told() {
    let lab = Lab::new();
    let all = lab.json("effects");
    let list = lab.ok("effects");
    let effects = all["effects"].as_array().unwrap();
    assert!(effects.len() >= 31);
    for effect in effects {
        let name = effect["effect"].as_str().unwrap();
        assert!(list.contains(name), "{name}");
        let one = lab.ok(&format!("effects {name}"));
        assert!(one.contains(effect["law"].as_str().unwrap()) && one.contains("source"), "{one}");
    }
    insta::assert_snapshot!("effects_list", list);
    insta::assert_snapshot!("effects_cogging", lab.ok("effects cogging"));
    insta::assert_snapshot!("effects_formula", lab.ok("effects formula"));
}

#[test]
fn a_formula_does_what_the_effect_of_that_law_does_and_its_parameter_can_be_in_doubt() {
    let effect = |text: &str| format!("[[effects]]\nsite = \"hinge\"\n{text}\n\n[drive]");
    let mine = effect("effect = \"formula\"\non = \"torque\"\nlaw = \"-c*dq\"\nc = 0.1");
    let library = effect("effect = \"viscous_friction\"\ncoefficient = 0.1");
    let told = |name: &str, text: &str, parameter: &str| {
        let lab = Lab::with(&[("[drive]", text), ("\"mass@bob\"", parameter)]);
        lab.ok(&format!("simulate small.toml -q -o {name}.csv"));
        lab.read(&format!("{name}.csv"))
    };
    let last = |csv: &str| csv.lines().last().unwrap().split(',').nth(2).unwrap().parse::<f64>().unwrap();
    let [plain, oil, formula] = [
        told("plain", "[drive]", "\"mass@bob\""),
        told("oil", &library, "\"mass@bob\""),
        told("formula", &mine, "\"mass@bob\""),
    ]
    .map(|csv| last(&csv));
    assert!((formula - oil).abs() < 1e-6 * (oil - plain).abs(), "{plain} {oil} {formula}");
    let doubted = last(&told("doubt", &mine, "\"formula.c@hinge\""));
    assert_eq!(doubted.to_bits(), formula.to_bits());
}

#[test]
fn what_can_stand_in_a_file_is_listed() {
    let lab = Lab::new();
    let (text, document) = (lab.ok("info"), lab.json("info"));
    for kind in ["drives", "distances", "searches", "fitness"] {
        for entry in document[kind].as_array().unwrap() {
            assert!(text.contains(entry["name"].as_str().unwrap()), "{entry}");
        }
    }
}

#[test]
fn the_schema_is_json_and_knows_every_section() {
    let schema: serde_json::Value = serde_json::from_str(&Lab::new().ok("schema")).unwrap();
    let file: toml::Table = toml::from_str(crate::lab::SMALL).unwrap();
    for section in file.keys() {
        assert!(schema["properties"][section].is_object(), "{section}");
    }
    assert_eq!(schema["additionalProperties"], false);
    let kept = std::fs::read_to_string(robots().join("../btr.schema.json")).unwrap();
    let kept: serde_json::Value = serde_json::from_str(&kept).unwrap();
    assert!(kept == schema, "btr.schema.json is not what `btr schema` says: write it anew");
}

#[test]
fn every_shipped_model_and_experiment_is_sound() {
    let lab = Lab::new();
    let files = std::fs::read_dir(robots()).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<_> = files.filter(|path| path.extension().is_some_and(|end| end == "toml")).collect();
    assert!(files.len() >= 2);
    for file in files {
        if !std::fs::read_to_string(&file).unwrap().contains("[coevolve") {
            // A model alone: every verb that reads one builds it first.
            let output = lab.run(&format!("add {} coulomb_friction -o model.toml", file.display()));
            assert!(output.status.success(), "{}: {}", file.display(), crate::lab::text(&output.stderr));
            continue;
        }
        // Recorded data does not come with the program: a file that needs some may say so, and how to get it.
        let output = lab.run(&format!("coevolve {} --out run --dry-run", file.display()));
        let stderr = crate::lab::text(&output.stderr);
        let lacks_data = stderr.contains("reality.index") && stderr.contains("help:");
        assert!(output.status.success() || lacks_data, "{}: {stderr}", file.display());
        assert!(!lab.exists("run"), "a dry run leaves nothing behind");
    }
}

#[test]
fn completions_and_the_manual_name_every_verb() {
    let lab = Lab::new();
    for arguments in ["completions bash", "completions zsh", "completions fish", "man"] {
        let text = lab.ok(arguments);
        assert!(
            ["coevolve", "simulate", "studio", "effects", "convert"].iter().all(|verb| text.contains(verb)),
            "{arguments}"
        );
    }
    let syntax = Command::new("bash").arg("-n").arg("-c").arg(lab.ok("completions bash")).status();
    assert!(syntax.is_ok_and(|status| status.success()), "bash cannot read its completions");
}

#[test]
fn every_verb_has_help_with_an_example() {
    let lab = Lab::new();
    let journey = lab.ok("--help");
    for verb in ["check", "compare", "diagnose", "fit", "coevolve"] {
        assert!(journey.contains(&format!("btr {verb} ")), "{journey}");
    }
    assert!(lab.ok("diagnose --help").contains("learn_*.csv --held-out robots/arm/held_out_*.csv"));
    for verb in [
        "coevolve",
        "simulate",
        "check",
        "compare",
        "diagnose",
        "add",
        "fit",
        "export",
        "studio",
        "effects",
        "info",
        "convert",
        "schema",
        "completions",
    ] {
        let help = lab.ok(&format!("{verb} --help"));
        assert!(help.contains("Example") && help.contains(&format!("btr {verb}")), "{help}");
    }
}
