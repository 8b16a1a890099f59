//! Which candidates are compared with each other, and how long they are searched.
#![allow(clippy::unwrap_used)]

use btr_core::log::{Log, Role};
use btr_identify::residual_model::{EffectCandidate, ResidualModel};
use btr_lab::experiment::{LogSource, Source};
use btr_lab::identification::VerbInput;
use std::path::PathBuf;

const MODEL: &str = r#"name = "leg"
[robot]
urdf = "leg.urdf"
base = "fixed"
[actuators."*"]
kind = "position"
kp = 20.0
kd = 0.5
"#;

const URDF: &str = r#"<robot name="leg">
<link name="trunk"/>
<link name="thigh"><inertial><origin xyz="0 0 -0.15"/><mass value="2.0"/>
<inertia ixx="0.02" iyy="0.02" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="shank"><inertial><origin xyz="0 0 -0.1"/><mass value="1.0"/>
<inertia ixx="0.002" iyy="0.002" izz="0.0003" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="trunk"/><child link="thigh"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
<joint name="knee" type="revolute"><parent link="thigh"/><child link="shank"/><origin xyz="0 0 -0.3"/><axis xyz="1 0 0"/>
<limit lower="-2" upper="2" effort="20" velocity="20"/></joint>
</robot>
"#;

fn input(logs: usize) -> VerbInput {
    let clock: Vec<f64> = (0..100).map(|i| 0.02 * f64::from(i)).collect();
    let mut log = Log::new(clock.clone()).unwrap();
    for (joint, rate) in [("hip", 2.1), ("knee", 3.3)] {
        let swing: Vec<f64> = clock.iter().map(|t| 0.6 * (rate * t).sin()).collect();
        log.insert(format!("cmd_{joint}"), "rad", Role::Command, swing.clone()).unwrap();
        log.insert(format!("q_{joint}"), "rad", Role::Measured, swing).unwrap();
    }
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("leg.urdf"), URDF).unwrap();
    let source = Source::new(folder.path().join("leg.toml"), MODEL);
    let named = |i| LogSource::InMemory { name: PathBuf::from(format!("swing {i}")), log: log.clone() };
    VerbInput::new(source, &(0..logs).map(named).collect::<Vec<_>>(), &[]).unwrap()
}

/// A turn of the whole robot about its first joint is a tilt of gravity as well.
#[test]
fn a_tilted_base_is_compared_with_the_first_joint() {
    let all: Vec<EffectCandidate> = input(1).problem.description().candidates;
    let similar = |name: &str| {
        let candidate = all.iter().find(|candidate| candidate.name() == name).unwrap();
        candidate.similar.iter().map(|&other| all[other].name()).collect::<Vec<_>>()
    };
    assert!(
        similar("gravity_tilt@base").contains(&"encoder_offset@hip".to_owned()),
        "{:?}",
        similar("gravity_tilt@base")
    );
    assert!(similar("encoder_offset@hip").contains(&"gravity_tilt@base".to_owned()));
    assert!(!similar("encoder_offset@knee").contains(&"gravity_tilt@base".to_owned()));
}

/// Every point of a search simulates all training logs.
#[test]
fn the_usual_number_of_rollouts_grows_with_the_training_logs() {
    let most = |logs| input(logs).options(Some(2), None).max_rollouts;
    assert_eq!((most(1), most(4), most(6)), (6800, 6800, 10_200));
    assert_eq!(input(6).options(Some(2), Some(50)).max_rollouts, 50);
}
