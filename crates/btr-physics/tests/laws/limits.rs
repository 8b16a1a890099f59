//! What would take all memory or for ever is refused before it begins.

use crate::scene::{fast, hold, placed};
use btr_core::limits::MOST_STEPS;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot, Sampling};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::Setup;

fn servo() -> Robot {
    pendulum(1.0, 1.0, Actuator::Position { kp: 10.0, ki: 0.0, kd: 0.0, max_torque: f64::INFINITY })
}

fn refusal(robot: &Robot, effects: &[PlacedEffect], setup: &Setup) -> String {
    let drive = hold(0.0);
    simulate(RolloutRequest::new(robot, &drive).setup(setup).effects(effects)).unwrap_err().to_string()
}

#[test]
fn too_many_steps_are_not_begun() {
    let robot = servo();
    let told = |dt_s: f64, duration_s: f64| refusal(&robot, &[], &fast(dt_s, duration_s));
    let ends = format!("physics steps; at most {MOST_STEPS} are simulated");
    for (dt_s, duration_s) in [(0.001, 8e4), (1e-12, 1.0), (1e-300, 1.0)] {
        let told = told(dt_s, duration_s);
        assert!(told.ends_with(&ends), "{told}");
    }
    for (dt_s, duration_s) in [(0.001, 1e9), (1e6, 1e9), (0.001, 1e300)] {
        let told = told(dt_s, duration_s);
        assert!(told.ends_with("s; at most 86400 s, a day, are simulated"), "{told}");
    }
    let few = Setup { max_steps: 10, ..fast(0.01, 0.11) };
    assert!(refusal(&robot, &[], &few).contains("0.11 s in steps of 0.01 s are 1.1e1 physics steps; at most 10"));
    assert!(few.check(&robot).is_err() && Setup { duration_s: 0.1, ..few }.check(&robot).is_ok());
    // A rest before time zero counts.
    assert!(Setup { max_steps: 10, rest_s: 0.1, ..fast(0.01, 0.1) }.check(&robot).is_err());
}

#[test]
fn a_log_that_does_not_fit_into_memory_is_not_begun() {
    let robot = servo();
    let told = refusal(&robot, &[], &Setup { max_steps: u64::MAX, ..fast(1e-6, 1e4) });
    assert!(told.contains("samples of about") && told.ends_with("at most 100000000 values are kept"), "{told}");
}

#[test]
fn servos_and_delays_remember_no_more_than_fits_into_memory() {
    let mut robot = servo();
    let setup = Setup { sample_s: Some(1e-7), ..fast(1e-7, 1e-5) };
    let told = refusal(&robot, &[placed("command_delay", "*", &[1.0])], &setup);
    assert!(told.contains("command_delay would remember 10000002 values; at most 1000000 are kept"), "{told}");
    for link in &mut robot.links {
        link.joint.sampling = Some(Sampling { period_s: 0.001, velocity_over: u32::MAX });
    }
    let told = refusal(&robot, &[], &fast(0.001, 0.1));
    assert!(told.contains("hinge would remember 4294967295 values"), "{told}");
}
