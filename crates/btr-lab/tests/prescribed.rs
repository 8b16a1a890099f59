//! Torques of a prescribed motion, added up from what was simulated before.
#![allow(clippy::unwrap_used)]

use btr_core::log::{Log, Role};
use btr_core::random::{Rng, stream};
use btr_identify::fit::{LogSet, Objective};
use btr_identify::residual_model::{ResidualModel, ResidualRequest, TimeStep};
use btr_lab::experiment::{LogSource, Source};
use btr_lab::identification::VerbInput;
use btr_physics::effects::{EFFECTS, SiteKind};
use rand::RngExt;
use std::path::PathBuf;

const MODEL: &str = r#"name = "leg"
[robot]
urdf = "leg.urdf"
base = "fixed"
[actuators."*"]
kind = "prescribed"
[parameters]
"mass@shank" = { relative = [0.5, 2.0] }
"viscous_friction.coefficient@hip" = { bounds = [0.0, 3.0], value = 0.2 }
[[effects]]
effect = "viscous_friction"
site = "hip"
coefficient = 0.2
"#;

const URDF: &str = r#"<robot name="leg">
<link name="base"/>
<link name="thigh"><inertial><origin xyz="0 0.02 -0.15"/><mass value="2.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="shank"><inertial><origin xyz="0.01 0 -0.1"/><mass value="1.0"/>
<inertia ixx="0.002" iyy="0.002" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="thigh"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.3"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
</robot>
"#;

fn input() -> VerbInput {
    input_with("")
}

/// The model with further lines.
fn input_with(lines: &str) -> VerbInput {
    let clock: Vec<f64> = (0..600).map(|i| 0.005 * f64::from(i)).collect();
    let mut log = Log::new(clock.clone()).unwrap();
    let mut rng: Rng = stream(5, &[]);
    for (joint, rate) in [("hip", 2.1), ("knee", 3.3)] {
        let swing = |t: &f64| 0.6 * (rate * t).sin() + 0.2 * (2.7 * rate * t).cos();
        log.insert(format!("q_{joint}"), "rad", Role::Measured, clock.iter().map(swing).collect()).unwrap();
        let torque = |t: &f64| 3.0 * (1.3 * rate * t).cos() + 0.05 * (rng.random::<f64>() - 0.5);
        log.insert(format!("tau_{joint}"), "N·m", Role::Measured, clock.iter().map(torque).collect()).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leg.urdf"), URDF).unwrap();
    let source = Source::new(folder.path().join("leg.toml"), format!("{MODEL}{lines}"));
    let log = LogSource::InMemory { name: PathBuf::from("swing"), log };
    VerbInput::new(source, &[log], &[]).unwrap()
}

/// Everything that may be varied, a few at a time, from far within the bounds.
#[test]
fn sums_equal_simulations() {
    let input = input();
    let model: &dyn ResidualModel = &input.problem;
    let (objective, description) = (Objective::new(model), model.description());
    assert!(
        description.joint_laws.iter().map(|laws| laws.proportional.len()).sum::<usize>() > 20
            && description.inertial.len() > 10
    );
    let (mut rng, mut compared) = (stream(6, &[]), 0);
    for _ in 0..150 {
        let mut u = vec![0.0; description.parameters.len()];
        for _ in 0..rng.random_range(1..6) {
            let k = rng.random_range(0..u.len());
            u[k] = description.parameters[k].clamp(4.0 * rng.random::<f64>() - 2.0);
        }
        let simulated: Result<Vec<Vec<f64>>, _> = objective
            .logs(LogSet::Learn)
            .iter()
            .map(|&log| model.residual(ResidualRequest::of(&u, log), TimeStep::USUAL))
            .collect();
        let (Ok(simulated), Ok(sum)) = (simulated, objective.residual(&u, LogSet::Learn)) else { continue };
        let simulated = simulated.concat();
        let size = simulated.iter().filter(|r| r.is_finite()).fold(1.0, |most: f64, r| most.max(r.abs()));
        let changed: Vec<&str> =
            (0..u.len()).filter(|&k| u[k] != 0.0).map(|k| description.parameters[k].name.as_str()).collect();
        for (a, b) in simulated.iter().zip(&sum).filter(|(a, _)| a.is_finite()) {
            assert!((a - b).abs() < 1e-7 * size, "{changed:?}: {a} {b}");
        }
        compared += 1;
    }
    assert!(compared > 100, "{compared}");
}

/// Friction of any size takes no simulation, and loads in one place follow from a single one.
#[test]
fn responses_are_simulated_once() {
    let input = input();
    let objective = Objective::new(&input.problem);
    let find = |name: &str| objective.parameters().iter().position(|parameter| parameter.name == name).unwrap();
    let (friction, load) = (find("coulomb_friction.torque@knee"), find("tool_load.mass@shank"));
    let at = |values: [f64; 2]| {
        let mut u = vec![0.0; objective.parameters().len()];
        (u[friction], u[load]) = (values[0], values[1]);
        objective.residual(&u, LogSet::Learn).unwrap();
        objective.rollouts()
    };
    let first = at([1.0, 1.0]);
    assert_eq!([at([0.3, 1.0]), at([2.0, 0.4]), at([0.0, 1.7])], [first; 3]);
}

/// What acts in a joint beside creep is not a sum of its parts, and has no part of the links.
#[test]
fn laws_that_depend_on_each_other_equal_simulations() {
    let input = input();
    let model: &dyn ResidualModel = &input.problem;
    let objective = Objective::new(model);
    let find = |name: &str| objective.parameters().iter().position(|parameter| parameter.name == name).unwrap();
    let names = ["friction_creep.creep", "coulomb_friction.torque", "stribeck_friction.static", "armature.inertia"];
    let mut u = vec![0.0; objective.parameters().len()];
    names.iter().enumerate().for_each(|(i, name)| u[find(&format!("{name}@knee"))] = 0.5 + 0.3 * i as f64);
    let mut compare = |load: f64| {
        u[find("tool_load.mass@shank")] = load;
        let simulated = model.residual(ResidualRequest::of(&u, 0), TimeStep::USUAL).unwrap();
        let sum = objective.residual(&u, LogSet::Learn).unwrap();
        assert!(simulated.iter().zip(&sum).all(|(a, b)| !a.is_finite() || (a - b).abs() < 1e-7 * a.abs().max(1.0)));
        objective.rollouts()
    };
    let first = compare(0.5);
    assert_eq!([compare(0.8), compare(0.2)], [first; 2]);
}

/// They are not offered where the motion is prescribed.
#[test]
fn effects_of_motors_do_not_show_in_prescribed_motions() {
    let residual = |input: &VerbInput| {
        let u = vec![0.0; input.problem.parameters().len()];
        input.problem.residual(ResidualRequest::of(&u, 0), TimeStep::USUAL).unwrap()
    };
    let plain = residual(&input());
    let of_motors: Vec<_> = EFFECTS.iter().filter(|effect| effect.is_of_motor()).map(|effect| effect.spec()).collect();
    assert!(of_motors.len() > 10);
    for spec in of_motors {
        let values: String = spec.params.iter().map(|param| format!("{} = {:?}\n", param.name, param.hint)).collect();
        let site = if spec.site == SiteKind::Joint { "knee" } else { "*" };
        let with = input_with(&format!("[[effects]]\neffect = \"{}\"\nsite = \"{site}\"\n{values}", spec.name));
        let same = residual(&with).iter().zip(&plain).all(|(a, b)| a.to_bits() == b.to_bits());
        assert!(same, "{}", spec.name);
    }
}
