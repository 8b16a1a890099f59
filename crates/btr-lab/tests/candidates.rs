//! Which candidates are compared with each other, and how long they are searched.
#![allow(clippy::unwrap_used)]

use btr_identify::residual_model::ResidualModel;
use btr_lab::experiment::Source;
use btr_lab::identification::VerbInput;
use std::path::Path;

/// The shipped arm with that many logs.
fn input(logs: usize) -> VerbInput {
    let robots = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../robots");
    let text = std::fs::read_to_string(robots.join("arm.toml")).unwrap();
    let names = ["learn_1", "learn_2", "learn_3", "learn_4", "held_out_1", "held_out_2"];
    let logs: Vec<_> = names[..logs].iter().map(|name| robots.join(format!("arm/{name}.csv"))).collect();
    VerbInput::new(Source::new(robots.join("arm.toml"), text), &logs, &[]).unwrap()
}

/// A turn of the whole robot about its first joint is a tilt of gravity as well.
#[test]
fn a_tilted_base_is_compared_with_the_first_joint() {
    let all = input(1).problem.description().candidates;
    let similar = |name: &str| {
        let candidate = all.iter().find(|candidate| candidate.name() == name).unwrap();
        candidate.similar.iter().map(|&other| all[other].name()).collect::<Vec<_>>()
    };
    let to_base = similar("gravity_tilt@base");
    assert!(to_base.contains(&"encoder_offset@yaw".to_owned()), "{to_base:?}");
    assert!(similar("encoder_offset@yaw").contains(&"gravity_tilt@base".to_owned()));
    assert!(!similar("encoder_offset@shoulder").contains(&"gravity_tilt@base".to_owned()));
}

/// Every point of a search simulates all training logs.
#[test]
fn the_usual_number_of_rollouts_grows_with_the_training_logs() {
    let most = |logs| input(logs).options(Some(2), None).max_rollouts;
    assert_eq!((most(1), most(4), most(6)), (6800, 6800, 10_200));
    assert_eq!(input(6).options(Some(2), Some(50)).max_rollouts, 50);
}
