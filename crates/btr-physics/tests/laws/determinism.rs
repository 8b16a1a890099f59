//! The same arguments give the same bits.

use crate::scene::{ENGINES, setup};
use btr_core::log::Log;
use btr_physics::effects::{PlacedEffect, find};
use btr_physics::presets::ant;
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{EngineName, Setup};

fn walk(engine: EngineName, noise_seed: Option<u64>) -> Log {
    let mut walking = Setup { duration_s: 0.5, engine, ..Setup::default() };
    walking.noise.position = 1e-3;
    let rub = PlacedEffect::hinted(find("coulomb_friction").unwrap(), "*");
    simulate(RolloutRequest::new(&ant::ant(), &ant::tripod()).setup(&walking).effects(&[rub]).noise_seed(noise_seed))
        .unwrap()
}

#[test]
fn repeats_and_threads_agree_bitwise() {
    for engine in ENGINES {
        let expected = walk(engine, Some(7));
        let threaded: Vec<Log> = std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(|| walk(engine, Some(7)))).collect();
            threads.into_iter().map(|thread| thread.join().unwrap()).collect()
        });
        assert!(threaded.iter().all(|log| *log == expected), "{engine:?}");
    }
}

#[test]
fn noise_is_seeded_and_only_on_sensors() {
    let [clean, one, two] = [None, Some(1), Some(2)].map(|seed| walk(EngineName::Auto, seed));
    assert_ne!(one, two);
    assert_eq!(clean.values("base_x").unwrap(), one.values("base_x").unwrap());
    assert_eq!(clean.values("cmd_L1_yaw").unwrap(), one.values("cmd_L1_yaw").unwrap());
    let (q, noisy) = (clean.values("q_L1_yaw").unwrap(), one.values("q_L1_yaw").unwrap());
    let variance = q.iter().zip(noisy).map(|(q, n)| (q - n).powi(2)).sum::<f64>() / q.len() as f64;
    assert!((variance.sqrt() / 1e-3 - 1.0).abs() < 0.15, "deviation {}", variance.sqrt());
}

#[test]
fn samples_are_thinned_without_changing_the_run() {
    let fine = setup(0.002, 0.4);
    let coarse = Setup { sample_s: Some(0.01), ..fine.clone() };
    let log = |setup: &Setup| simulate(RolloutRequest::new(&ant::ant(), &ant::tripod()).setup(setup)).unwrap();
    let (fine, coarse) = (log(&fine), log(&coarse));
    assert_eq!((fine.len(), coarse.len()), (201, 41));
    let every_fifth: Vec<f64> = fine.values("q_R2_knee").unwrap().iter().step_by(5).copied().collect();
    assert_eq!(every_fifth, coarse.values("q_R2_knee").unwrap());
}

#[test]
fn invalid_setups_and_sites_are_errors() {
    let robot = ant::ant();
    let run = |setup: &Setup, effects: &[PlacedEffect]| {
        simulate(RolloutRequest::new(&robot, &ant::tripod()).setup(setup).effects(effects))
    };
    let odd = Setup { sample_s: Some(0.0015), ..setup(0.001, 0.1) };
    assert!(run(&odd, &[]).unwrap_err().to_string().contains("multiple"));
    let nowhere = PlacedEffect::hinted(find("armature").unwrap(), "wing");
    assert!(run(&setup(0.001, 0.1), &[nowhere]).unwrap_err().to_string().contains("wing"));
}

#[test]
fn divergence_is_reported_with_time_and_joint() {
    let mut robot =
        btr_physics::presets::pendulum::pendulum(1.0, 1.0, btr_physics::robot::Actuator::Torque { max_torque: 1e9 });
    robot.links[1].joint.name = "knee".to_owned();
    let error = simulate(RolloutRequest::new(&robot, &crate::scene::hold(1e6)).setup(&setup(0.001, 1.0))).unwrap_err();
    let text = error.to_string();
    assert!(text.contains("diverged at t = 0.0") && text.contains("knee"), "{text}");
    let nan = simulate(RolloutRequest::new(&robot, &crate::scene::hold(f64::INFINITY)).setup(&setup(0.001, 1.0)));
    assert!(nan.is_ok() || nan.unwrap_err().to_string().contains("diverged"));
}
