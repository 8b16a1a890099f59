//! Effects on links, mounting, sensors and clock obey their laws.

use crate::scene::{G, arm, fast, fast_weightless, hold, last, placed, run, run_with};
use btr_physics::effects::PlacedEffect;
use btr_physics::engine::turned_inertia;
use btr_physics::presets::ant;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{Sensors, Setup};
use nalgebra::{Matrix3, Vector3};

/// Steady-state position and motor torque of a stiff servo.
fn held(effect: PlacedEffect, at_rad: f64) -> (f64, f64) {
    let servo = Actuator::Position { kp: 400.0, ki: 0.0, kd: 40.0, max_torque: f64::INFINITY };
    let log = run_with(&pendulum(1.3, 0.7, servo), &[effect], &fast(0.001, 4.0), &hold(at_rad));
    (last(&log, "q_hinge"), last(&log, "tau_hinge"))
}

#[test]
fn a_shifted_centre_of_mass_changes_the_gravity_torque() {
    let (q, torque) = held(placed("com_offset", "bob", &[0.1, 0.05, 0.2]), 0.4);
    let expected = -1.3 * G * (0.1 * q.cos() - 0.5 * q.sin());
    assert!((torque - expected).abs() < 1e-6, "{torque} N·m, expected {expected}");
}

#[test]
fn a_payload_at_the_end_weighs_there_and_resists_turning_there() {
    // The bob's centre of mass is 0.7 m from the hinge: its end is 1.4 m away.
    let (q, torque) = held(placed("end_payload", "bob", &[0.5]), 0.4);
    assert!((torque - (1.3 * 0.7 + 0.5 * 1.4) * G * q.sin()).abs() < 1e-6, "{torque} N·m");
    let mut robot = pendulum(1.3, 0.7, Actuator::Torque { max_torque: 100.0 });
    robot.links[1].joint.start = 0.2;
    let setup = fast_weightless(0.001, 0.5);
    let speed = last(&run_with(&robot, &[placed("end_payload", "bob", &[0.5])], &setup, &hold(2.0)), "dq_hinge");
    assert!((speed - 1.0 / (1.3 * 0.49 + 0.5 * 1.96)).abs() < 1e-9, "{speed} rad/s");
}

#[test]
fn a_load_at_the_end_of_a_link_is_a_payload_there() {
    let loads = [placed("tool_load", "bob", &[0.5, 0.0, 0.0, -1.4]), placed("end_payload", "bob", &[0.5])];
    let [load, payload] = loads.map(|effect| held(effect, 0.4));
    assert_eq!(load, payload);
    let (q, torque) = held(placed("tool_load", "bob", &[0.5, 0.2, 0.0, 0.0]), 0.4);
    assert!((torque - (1.3 * 0.7 * q.sin() - 0.5 * 0.2 * q.cos()) * G).abs() < 1e-6, "{torque} N·m");
}

#[test]
fn a_place_may_be_on_any_side_and_a_mass_may_not() {
    assert!(placed("com_offset", "bob", &[-0.5, 0.0, 0.0]).check().is_ok());
    assert!(placed("tool_load", "bob", &[0.5, 0.0, 0.0, -1.4]).check().is_ok());
    assert!(placed("tool_load", "bob", &[-0.5, 0.0, 0.0, 0.1]).check().is_err());
}

#[test]
fn a_roll_joint_turns_a_long_link_with_little_inertia() {
    let mut robot = pendulum(1.3, 0.7, Actuator::Passive);
    robot.links[1].inertia_kg_m2 = Matrix3::from_diagonal(&Vector3::new(0.2, 0.3, 0.01));
    let about = |robot: &Robot| turned_inertia(robot)[0];
    assert!((about(&robot) - (1.3 * 0.49 + 0.3)).abs() < 1e-12, "{}", about(&robot));
    robot.links[1].joint.axis = Vector3::z();
    assert!((about(&robot) - 0.01).abs() < 1e-12, "{}", about(&robot));
}

#[test]
fn an_inertia_is_added_to_the_links() {
    let mut robot = pendulum(1.3, 0.7, Actuator::Torque { max_torque: 100.0 });
    robot.links[1].joint.start = 0.2;
    let effect = placed("link_inertia", "bob", &[0.2]);
    let speed = last(&run_with(&robot, &[effect], &fast_weightless(0.001, 0.5), &hold(2.0)), "dq_hinge");
    assert!((speed - 1.0 / (1.3 * 0.49 + 0.2)).abs() < 1e-9, "{speed} rad/s");
}

#[test]
fn a_tilted_base_rotates_gravity_about_the_hinge() {
    let (q, torque) = held(placed("gravity_tilt", "base", &[0.0, 0.2]), 0.4);
    assert!((torque - 1.3 * G * 0.7 * (q + 0.2).sin()).abs() < 1e-6, "{torque} N·m");
    let (q, torque) = held(placed("gravity_tilt", "base", &[0.3, 0.0]), 0.4);
    assert!((torque - 1.3 * G * 0.3_f64.cos() * 0.7 * q.sin()).abs() < 1e-6, "rolled: {torque} N·m");
}

#[test]
fn an_encoders_offset_and_scale_affect_servo_and_log_alike() {
    let weight = |q: f64| 1.3 * G * 0.7 * q.sin();
    let (reading, torque) = held(placed("encoder_offset", "hinge", &[0.1]), 0.5);
    assert!((400.0 * (0.5 - reading) - torque).abs() < 1e-6, "the servo works with its reading");
    assert!((torque - weight(reading - 0.1)).abs() < 1e-6, "{reading} rad with {torque} N·m");
    let (reading, torque) = held(placed("encoder_scale", "hinge", &[0.2]), 0.5);
    assert!((400.0 * (0.5 - reading) - torque).abs() < 1e-6, "the servo works with its reading");
    assert!((torque - weight(reading / 1.2)).abs() < 1e-6, "{reading} rad with {torque} N·m");
}

#[test]
fn an_encoders_scale_affects_the_damping_too() {
    let robot = |kd: f64| pendulum(1.3, 0.7, Actuator::Position { kp: 0.0, ki: 0.0, kd, max_torque: 100.0 });
    let coast = Setup { start_velocities: vec![2.0], ..fast_weightless(0.001, 0.4) };
    let misread = run_with(&robot(0.5), &[placed("encoder_scale", "hinge", &[0.2])], &coast, &hold(0.0));
    let damped = run(&robot(0.6), &coast, &hold(0.0));
    assert!((last(&misread, "dq_hinge") / 1.2 - last(&damped, "dq_hinge")).abs() < 1e-12);
    assert!((last(&misread, "tau_hinge") - last(&damped, "tau_hinge")).abs() < 1e-12);
}

#[test]
fn a_late_encoder_shifts_the_log_and_nothing_else() {
    let setup = fast(0.001, 0.5);
    let plain = run(&arm(), &setup, &hold(0.0));
    let late = run_with(&arm(), &[placed("encoder_delay", "elbow", &[0.02])], &setup, &hold(0.0));
    for (name, channel) in plain.channels() {
        let shift = if ["q_elbow", "dq_elbow"].contains(&name) { 20 } else { 0 };
        for (i, value) in late.values(name).unwrap().iter().enumerate() {
            let expected = channel.values[i.saturating_sub(shift)];
            assert!((value - expected).abs() < 1e-6, "{name}[{i}]");
        }
    }
}

#[test]
fn a_late_encoder_saw_the_motion_before_the_log_began() {
    let robot = pendulum(1.3, 0.7, Actuator::Passive);
    let coast = Setup { start_velocities: vec![2.0], ..fast_weightless(0.001, 0.1) };
    let late = run_with(&robot, &[placed("encoder_delay", "hinge", &[0.02])], &coast, &hold(0.0));
    for (t, q) in late.clock_s().iter().zip(late.values("q_hinge").unwrap()) {
        assert!((q - 2.0 * (t - 0.02)).abs() < 1e-9, "{q} at {t} s");
    }
}

#[test]
fn a_delay_looks_the_same_in_coarsely_and_finely_sampled_logs() {
    let swing = |sample_s: f64, effects: &[PlacedEffect]| {
        let setup = Setup { sample_s: Some(sample_s), start_velocities: vec![3.0], ..fast(0.001, 1.0) };
        run_with(&pendulum(1.3, 0.7, Actuator::Passive), effects, &setup, &hold(0.0))
    };
    for effect in [placed("encoder_delay", "hinge", &[0.013]), placed("clock_skew", "*", &[0.03])] {
        let (few, many) = (swing(0.01, std::slice::from_ref(&effect)), swing(0.001, &[effect]));
        // Readings of the time before the start are guessed from the first velocity.
        for (i, q) in few.values("q_hinge").unwrap().iter().enumerate().skip(2) {
            let expected = many.values("q_hinge").unwrap()[10 * i];
            assert!((q - expected).abs() < 1e-6, "{q} and {expected} at {i}");
        }
    }
}

#[test]
fn a_fast_clock_stretches_what_was_measured() {
    let robot = pendulum(1.3, 0.7, Actuator::Passive);
    let coast = Setup { start_velocities: vec![2.0], ..fast_weightless(0.001, 1.0) };
    let log = run_with(&robot, &[placed("clock_skew", "*", &[0.02])], &coast, &hold(0.0));
    assert!((last(&log, "q_hinge") - 2.0 / 1.02).abs() < 1e-9, "{}", last(&log, "q_hinge"));
}

#[test]
fn readings_with_a_lead_are_those_of_later_samples() {
    let setup = fast(0.001, 0.5);
    let plain = run(&arm(), &setup, &hold(0.0));
    let early = run_with(&arm(), &[placed("encoder_lead", "*", &[0.02])], &setup, &hold(0.0));
    for name in ["q_shoulder", "q_elbow", "dq_elbow"] {
        let values = plain.values(name).unwrap();
        let end = values.len() - 20;
        for (i, value) in early.values(name).unwrap()[..end].iter().enumerate() {
            assert!((value - values[i + 20]).abs() < 1e-6, "{name}[{i}]");
        }
    }
    // Beyond the end, a joint goes on at its last velocity.
    let expected = last(&plain, "q_elbow") + 0.02 * last(&plain, "dq_elbow");
    assert!((last(&early, "q_elbow") - expected).abs() < 1e-9, "{} and {expected}", last(&early, "q_elbow"));
}

#[test]
fn an_imu_bias_is_added_to_the_readings() {
    let sensors = Sensors { velocities: true, torques: true, imu: true, feet: true };
    let setup = Setup { dt_s: 0.002, control_s: 0.01, duration_s: 0.2, sensors, ..Setup::default() };
    let bias = [0.1, -0.2, 0.3, -1.0, 2.0, 0.5];
    let walk = |effects: &[PlacedEffect]| {
        simulate(RolloutRequest::new(&ant::ant(), &ant::tripod()).setup(&setup).effects(effects)).unwrap()
    };
    let (plain, biased) = (walk(&[]), walk(&[placed("imu_bias", "base", &bias)]));
    let names = ["gyro_x", "gyro_y", "gyro_z", "acc_x", "acc_y", "acc_z"].map(|name| format!("imu_{name}"));
    for (name, channel) in plain.channels() {
        let bias = names.iter().position(|imu| imu == name).map_or(0.0, |i| bias[i]);
        let difference = last(&biased, name) - channel.values.last().unwrap();
        assert!((difference - bias).abs() < 1e-12, "{name}: {difference}");
    }
}
