//! A diagnosis of an industrial arm without a load, where its public log is there: `BTR_DATA`, or `shared/data` beside
//! the workspace.

use crate::lab::Lab;
use serde_json::Value;
use std::fmt::Write;
use std::path::{Path, PathBuf};

const JOINTS: usize = 6;
/// Share of the log to learn from.
const LEARNT: f64 = 0.65;

/// A Staubli TX40 whose motion is prescribed, so that torques are compared, and nothing is known but its URDF.
const MODEL: &str = r#"name = "tx40"
[robot]
urdf = "URDF"
base = "fixed"
[actuators."*"]
kind = "prescribed"
"#;

/// Each joint has friction and a rotor, and two wrist motors are coupled. Nothing is held: no payload may stand in for
/// that, no inertia beyond reason, and no cogging whose order is no number of poles. The coupling is found at both
/// joints, although what the training part shows of joint 5 is friction, which the held-out part contradicts.
#[test]
fn what_an_unloaded_arm_lacks_is_no_payload() {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let data = std::env::var_os("BTR_DATA").map_or_else(beside, PathBuf::from).join("staubli_tx40");
    if !data.is_dir() {
        println!("skipped: data not there ({})", data.display());
        return;
    }
    let lab = Lab::new();
    lab.write("tx40.toml", &MODEL.replace("URDF", &data.join("tx40_mdh_modified.urdf").display().to_string()));
    let recorded = std::fs::read_to_string(data.join("episodes/joint_side_1kHz.csv")).unwrap();
    let rows: Vec<&str> = recorded.lines().skip(1).collect();
    let (learnt, held_out) = rows.split_at((LEARNT * rows.len() as f64) as usize);
    lab.write("learnt.csv", &log(learnt));
    lab.write("held_out.csv", &log(held_out));
    let answer = lab.json("diagnose tx40.toml learnt.csv --held-out held_out.csv -q");
    assert_eq!(answer["verdict"], "partly_explained", "{answer}");
    let ladder = answer["error_ladder"].as_array().unwrap();
    let held_out = |step: usize| ladder[step]["held_out"].as_f64().unwrap();
    assert!(held_out(ladder.len() - 1) < 0.15 * held_out(0), "{answer}");
    let sites = |effect: &Value| match &effect["site"] {
        Value::Array(sites) => sites.clone(),
        site => vec![site.clone()],
    };
    let mut named: Vec<String> = Vec::new();
    for effect in answer["effects"].as_array().unwrap() {
        let name = effect["effect"].as_str().unwrap();
        let of_a_drive = ["friction", "armature", "coupling", "spring"];
        assert!(of_a_drive.iter().any(|of| name.contains(of)), "{answer}");
        assert!(effect["probability"].as_f64().unwrap() <= 0.90, "{answer}");
        assert!(effect["parameters"].as_array().unwrap().iter().all(|p| p["ci95"].is_null()), "{answer}");
        assert!(effect["established"] != true || !name.contains("spring"), "{answer}");
        named.extend(sites(effect).iter().map(|site| format!("{name}@{}", site.as_str().unwrap())));
    }
    let couplings: Vec<&String> = named.iter().filter(|name| name.contains("coupling")).collect();
    assert_eq!(couplings.len(), 2, "{named:?}");
    for found in ["parent_coupling@joint_6", "child_coupling@joint_5"] {
        assert!(named.iter().any(|name| name == found), "{named:?}");
    }
    assert!((1..=6).all(|joint| named.contains(&format!("viscous_friction@joint_{joint}"))), "{named:?}");
    assert!(answer["wrong_values"].as_array().unwrap().is_empty(), "{answer}");
}

/// Rows of the data set, which has the same columns, as a log of btr's that begins at 0 s.
fn log(rows: &[&str]) -> String {
    let mut text = "t".to_owned();
    for channel in ["q", "tau"] {
        (1..=JOINTS).for_each(|joint| write!(text, ",{channel}_joint_{joint}").unwrap());
    }
    let parts = |row: &&str| row.split_once(',').map(|(t, rest)| (t.parse::<f64>().unwrap(), rest.to_owned())).unwrap();
    let began = parts(&rows[0]).0;
    for (t, rest) in rows.iter().map(parts) {
        write!(text, "\n{:.3},{rest}", t - began).unwrap();
    }
    text + "\n"
}
