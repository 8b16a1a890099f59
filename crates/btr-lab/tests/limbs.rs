//! Limbs on a held base: what changes in one of them shows there alone.
#![allow(clippy::unwrap_used)]

use btr_core::log::{Log, Role};
use btr_core::random::{normal, stream};
use btr_identify::fit::{LogSet, Objective, rows_near};
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_lab::experiment::{LogSource, Source};
use btr_lab::identification::VerbInput;
use std::path::PathBuf;

const JOINTS: [&str; 4] = ["left_hip", "left_knee", "right_hip", "right_knee"];

/// Two legs on a trunk that is fixed to a stand, with one dead time of the bus.
fn input(lines: &str) -> VerbInput {
    let leg = |side: &str| {
        format!(
            r#"<link name="{side}_thigh"><inertial><origin xyz="0 0 -0.1"/><mass value="1.0"/>
<inertia ixx="0.01" iyy="0.01" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="{side}_shank"><inertial><origin xyz="0 0 -0.1"/><mass value="0.4"/>
<inertia ixx="0.002" iyy="0.002" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="{side}_hip" type="revolute"><parent link="trunk"/><child link="{side}_thigh"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
<joint name="{side}_knee" type="revolute"><parent link="{side}_thigh"/><child link="{side}_shank"/>
<origin xyz="0 0 -0.2"/><axis xyz="0 1 0"/><limit lower="-2" upper="2" effort="20" velocity="20"/></joint>"#
        )
    };
    let trunk = r#"<link name="stand"/><link name="trunk"><inertial><mass value="5"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="bolts" type="fixed"><parent link="stand"/><child link="trunk"/></joint>"#;
    let model = format!(
        r#"name = "legs"
[robot]
urdf = "legs.urdf"
base = "fixed"
[actuators."*"]
kind = "position"
kp = 30.0
kd = 1.0
[simulation]
control_s = 0.01
[parameters]
"mass@left_shank" = {{ relative = [0.5, 2.0] }}
"mass@trunk" = {{ relative = [0.5, 2.0] }}
"kp@*" = {{ relative = [0.5, 2.0], shared = true }}
"coulomb_friction.torque@right_knee" = {{ bounds = [0.0, 2.0], value = 0.1 }}
"command_delay.delay@*" = {{ bounds = [0.0, 0.05], value = 0.01 }}
{lines}"#
    );
    let clock: Vec<f64> = (0..300).map(|i| 0.01 * f64::from(i)).collect();
    let (mut log, mut rng) = (Log::new(clock.clone()).unwrap(), stream(5, &[]));
    for (k, joint) in JOINTS.iter().enumerate() {
        let swing = |t: &f64| 0.5 * ((2.0 + k as f64) * t).sin();
        log.insert(format!("cmd_{joint}"), "rad", Role::Command, clock.iter().map(swing).collect()).unwrap();
        let read = clock.iter().map(|t| 0.9 * swing(&(t - 0.04)) + 0.001 * normal(&mut rng)).collect();
        log.insert(format!("q_{joint}"), "rad", Role::Measured, read).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    let urdf = format!("<robot name=\"legs\">{trunk}{}{}</robot>", leg("left"), leg("right"));
    std::fs::write(folder.path().join("legs.urdf"), urdf).unwrap();
    let source = Source::new(folder.path().join("legs.toml"), model);
    let log = LogSource::InMemory { name: PathBuf::from("swing"), log };
    VerbInput::new(source, &[log], &[]).unwrap()
}

#[test]
fn what_changes_in_a_limb_shows_there_alone() {
    let input = input("");
    let model: &dyn ResidualModel = &input.problem;
    let description = model.description();
    let of_limbs = &description.limb_parameters;
    assert!(of_limbs.iter().any(|(k, _)| description.parameters[*k].name == "mass@left_shank"));
    assert!(of_limbs.len() > 50, "{}", of_limbs.len());
    let in_all = ["mass@trunk", "kp@*", "command_delay.delay@*"];
    assert!(of_limbs.iter().all(|(k, _)| !in_all.contains(&description.parameters[*k].name.as_str())));
    let residual = |u: &[f64], moved: &[f64]| {
        let request = ResidualRequest { u, log: 0, moved };
        model.residual(request, TimeStep::USUAL).unwrap()
    };
    let origin = vec![0.0; description.parameters.len()];
    let usual = residual(&origin, &[]);
    let assert_alone = |moved: &[f64], near: &[String], what: &str| {
        assert_eq!(near.len(), 2, "{what}");
        let rows = rows_near(&description.logs[0], near);
        let outside = (0..usual.len()).filter(|row| !rows.iter().any(|rows| rows.contains(row)));
        for row in outside {
            assert_eq!(moved[row].to_bits(), usual[row].to_bits(), "{what}");
        }
    };
    let mut changed = 0;
    for (k, near) in of_limbs {
        let mut u = origin.clone();
        u[*k] = description.parameters[*k].clamp(0.7);
        let moved = residual(&u, &[]);
        changed += usize::from(moved.iter().zip(&usual).any(|(a, b)| a.to_bits() != b.to_bits()));
        assert_alone(&moved, near, &description.parameters[*k].name);
    }
    assert!(changed > 25, "{changed}");
    for (number, start) in description.starts[0].numbers.iter().enumerate() {
        let mut by = vec![0.0; description.starts[0].numbers.len()];
        by[number] = 1.0;
        assert_alone(&residual(&origin, &by), &start.channels, "a start");
    }
}

/// A supply that sags under load lets each motor feel all others.
#[test]
fn limbs_that_share_a_supply_are_not_separate() {
    let alone = input("").problem.description();
    let sagging = alone.joining.iter().map(|&k| alone.parameters[k].name.as_str()).collect::<Vec<_>>();
    assert_eq!(sagging, ["voltage_sag.sag@*"]);
    let shared = input("\"voltage_sag.sag@*\" = { bounds = [0.0, 1.0], value = 0.1 }\n").problem.description();
    assert!(shared.limb_parameters.is_empty());
    assert!(shared.starts[0].numbers.iter().all(|number| number.channels.is_empty()));
}

/// Columns that share rollouts equal those that do not.
#[test]
fn shared_rollouts_give_the_same_derivatives() {
    let input = input("");
    let model: &dyn ResidualModel = &input.problem;
    let objective = Objective::new(model);
    let free = objective.description.free.clone();
    let u = vec![0.0; objective.parameters().len()];
    let residual = objective.residuals(std::slice::from_ref(&u), LogSet::Learn).pop().unwrap().unwrap();
    let zeros = vec![0.0; residual.len()];
    let before = objective.rollouts();
    let together = btr_identify::fit::columns(&objective, &u, &free, &residual, &zeros);
    // The mass of the left shank and the friction of the right knee share one.
    assert_eq!(objective.rollouts() - before, free.len() - 1);
    for (k, column) in free.iter().zip(&together) {
        let alone = btr_identify::fit::columns(&objective, &u, &[*k], &residual, &zeros);
        assert_eq!(column, &alone[0]);
    }
}
