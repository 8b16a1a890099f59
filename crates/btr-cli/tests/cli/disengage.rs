//! What happens when S lacks something: the cause is named from the real tests, and S grows.

use crate::lab::{Lab, robots};
use serde_json::Value;

/// The shipped experiment in a folder of its own; a little shorter.
fn lab() -> Lab {
    let lab = Lab::new();
    let text = std::fs::read_to_string(robots().join("disengage.toml")).unwrap();
    lab.write(
        "rubs.toml",
        &text.replace("iterations = 7", "iterations = 5").replace("duration_s = 3.0", "duration_s = 1.5"),
    );
    lab
}

fn history(lab: &Lab, out: &str) -> Value {
    serde_json::from_str(&lab.read(&format!("{out}/history.json"))).unwrap()
}

/// The last estimate of the added friction; the robot has 0.4 N·m.
fn friction(history: &Value) -> f64 {
    let last = history["iterations"].as_array().unwrap().last().unwrap();
    last["parameters"]["coulomb_friction.torque@hinge"].as_f64().unwrap()
}

fn real_tests(lab: &Lab, out: &str) -> Vec<Vec<u8>> {
    (0..).map_while(|k| std::fs::read(lab.path(&format!("{out}/transfers/{k:04}/log.mcap"))).ok()).collect()
}

#[test]
fn the_cause_is_named_and_the_command_that_is_told_goes_on_with_the_same_real_tests() {
    let lab = lab();
    let told = lab.exits("coevolve rubs.toml --out run -q", 1);
    assert!(told.contains("the cause: S lacks coulomb_friction on hinge"), "{told}");
    let before = history(&lab, "run");
    assert_eq!((&before["stop_reason"], &before["disengaged"]), (&"disengaged".into(), &true.into()));
    let diagnosis = &before["diagnosis"];
    assert_eq!((&diagnosis["verdict"], &diagnosis["effects"][0]["site"]), (&"effect_missing".into(), &"hinge".into()));
    assert!(!diagnosis["held_out"].as_array().unwrap().is_empty());
    let conclusions: Vec<&str> = before["conclusions"].as_array().unwrap().iter().filter_map(Value::as_str).collect();
    let lines: Vec<&str> = told.lines().map(str::trim).collect();
    assert!(conclusions.len() > 8 && conclusions.iter().all(|said| lines.contains(said)), "{conclusions:#?} {told}");
    let tested = real_tests(&lab, "run");

    let next = told.lines().find_map(|line| line.trim().strip_prefix("next: ")).unwrap();
    for command in next.split(" && ") {
        let output = lab.run(&command.replace("btr ", ""));
        assert!(output.status.success(), "{command}: {}", crate::lab::text(&output.stderr));
    }
    let after = history(&lab, "run");
    assert_eq!(after["iterations"][0]["i"], before["iterations"][0]["i"]);
    assert!(after["iterations"].as_array().unwrap().len() > before["iterations"].as_array().unwrap().len());
    assert_eq!(after["iterations"][0]["parameters"]["coulomb_friction.torque@hinge"], 0.0);
    assert_eq!(after["augmentations"][0]["parameters"][0], "coulomb_friction.torque@hinge");
    assert_eq!(after["tests"].as_array().unwrap()[..tested.len()], before["tests"].as_array().unwrap()[..]);
    assert!(real_tests(&lab, "run").starts_with(&tested), "nothing that the robot did is repeated or lost");
    assert!((friction(&after) - 0.4).abs() < 0.02, "{after:#}");
    assert!(lab.read("run/adapted.toml").contains("coulomb_friction.torque@hinge"));
    // Both files are the run's own now; a third one is not.
    for file in ["rubs.toml", "rubs.larger.toml"] {
        lab.ok(&format!("coevolve {file} --out run -q --resume"));
    }
    assert_eq!(history(&lab, "run"), after);
    lab.ok("add rubs.toml viscous_friction@hinge -o other.toml -q");
    assert!(lab.complaint("coevolve other.toml --out run --resume").contains("differs from the one"));
}

#[test]
fn a_run_that_augments_itself_ends_the_same_when_it_is_killed() {
    let lab = lab();
    let arguments = "coevolve rubs.toml -q --set coevolve.self_augment=true";
    lab.ok(&format!("{arguments} --out whole -j 1"));
    let whole = history(&lab, "whole");
    assert_eq!((&whole["stop_reason"], &whole["disengaged"]), (&"iterations_done".into(), &false.into()));
    assert_eq!(whole["diagnosis"]["added"], serde_json::json!(["coulomb_friction@hinge"]));
    assert!((friction(&whole) - 0.4).abs() < 0.02, "{whole:#}");

    let (mut patience_ms, mut kills) = (300.0, 0);
    loop {
        let resume = if lab.exists("killed/checkpoint.bin") { "--resume" } else { "" };
        let mut child = lab.start(&format!("{arguments} --out killed -j 2 {resume}"));
        std::thread::sleep(std::time::Duration::from_millis(patience_ms as u64));
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success(), "{status}");
            break;
        }
        child.kill().unwrap();
        child.wait().unwrap();
        kills += 1;
        patience_ms *= 1.6;
    }
    assert!(kills > 1);
    for name in ["history.json", "adapted.toml", "checkpoint.bin"] {
        let read = |out: &str| std::fs::read(lab.path(&format!("{out}/{name}"))).unwrap();
        assert!(read("whole") == read("killed"), "{name} differs after {kills} kills");
    }
}
