//! Joints that follow others.

use crate::engines::tree;
use crate::scene::{G, Told, arm, fast, hold, placed, run, run_with};
use btr_physics::engine::forward_dynamics;
use btr_physics::engine::{BaseState, RobotState};
use btr_physics::robot::{Actuator, Base, Mimic, Robot};
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Vector3};
use proptest::prelude::*;

fn follows(robot: &mut Robot, joint: &str, leader: &str, ratio: f64, offset: f64) {
    let mimic = Mimic { leader: leader.to_owned(), ratio, offset };
    let link = robot.links.iter_mut().find(|link| link.joint.name == joint).unwrap();
    (link.joint.mimic, link.joint.actuator) = (Some(mimic), Actuator::Passive);
}

/// The tree with its two arms linked, and the slide linked to the hinge that carries it.
fn linked(base: Base) -> Robot {
    let mut robot = Robot { base, ..tree(&Actuator::Passive) };
    follows(&mut robot, "d", "b", -1.5, 0.2);
    follows(&mut robot, "c", "a", 0.3, 0.0);
    robot
}

#[test]
fn a_follower_stays_at_the_ratio_of_its_leader() {
    let servo = Actuator::Position { kp: 30.0, ki: 0.0, kd: 1.0, max_torque: f64::INFINITY };
    for base in [Base::Fixed, Base::Floating] {
        let mut robot = linked(base);
        for link in robot.links.iter_mut().skip(1).filter(|link| link.joint.mimic.is_none()) {
            link.joint.actuator = servo.clone();
        }
        robot.links[2].joint.limits = (-0.5, 0.3);
        let effects = [placed("coulomb_friction", "*", &[0.2]), placed("armature", "*", &[0.01])];
        let log = run_with(&robot, &effects, &fast(0.002, 2.0), &Told(|t: f64| 0.6 * (9.0 * t).sin()));
        for (joint, leader, ratio, offset) in [("d", "b", -1.5, 0.2), ("c", "a", 0.3, 0.0)] {
            let values = |kind: &str, name: &str| log.values(&format!("{kind}_{name}")).unwrap().to_vec();
            let at = values("q", joint).into_iter().zip(values("q", leader));
            let deviation = at.map(|(q, leader)| (q - ratio * leader - offset).abs()).fold(0.0, f64::max);
            let speeds = values("dq", joint).into_iter().zip(values("dq", leader));
            let speed_deviation = speeds.map(|(dq, leader)| (dq - ratio * leader).abs()).fold(0.0, f64::max);
            assert!(
                deviation < 1e-4 && speed_deviation < 1e-2,
                "{base:?} {joint}: {deviation} rad, {speed_deviation} rad/s"
            );
        }
    }
}

#[test]
fn linked_arms_keep_their_energy() {
    // Two pendulums on one axis, linked at -1, swing as one whose weight is the difference.
    let mut robot = arm();
    robot.links.truncate(2);
    let mut bob = robot.links[1].clone();
    (bob.joint.origin, bob.joint.axis) = (Isometry3::identity(), Vector3::y());
    (bob.com_m, bob.joint.actuator, bob.joint.start) = ([0.0, 0.0, -0.3].into(), Actuator::Passive, 1.0);
    let mut twin = bob.clone();
    (twin.name, twin.joint.name, twin.mass_kg) = ("twin".to_owned(), "twin".to_owned(), 0.5 * bob.mass_kg);
    let leader = bob.joint.name.clone();
    robot.links = vec![robot.links[0].clone(), bob, twin];
    follows(&mut robot, "twin", &leader, -1.0, 0.0);
    let drift = |dt_s: f64| {
        let log = run(&robot, &fast(dt_s, 3.0), &hold(0.0));
        let energy = |i: usize| {
            let of = |link: &btr_physics::robot::Link| {
                let at = |kind: &str| log.values(&format!("{kind}_{}", link.joint.name)).unwrap()[i];
                let inertia = link.inertia_kg_m2[(1, 1)] + link.mass_kg * 0.09;
                0.5 * inertia * at("dq").powi(2) - link.mass_kg * G * 0.3 * at("q").cos()
            };
            robot.links[1..].iter().map(of).sum::<f64>()
        };
        (0..log.len()).map(|i| (energy(i) - energy(0)).abs()).fold(0.0, f64::max)
    };
    let (coarse, fine) = (drift(0.002), drift(0.001));
    assert!(coarse < 1e-4 && fine < 0.3 * coarse, "{coarse} J, then {fine} J");
}

#[test]
fn the_reference_engine_refuses_linkages() {
    let setup = Setup { engine: EngineName::Rapier, ..fast(0.002, 0.1) };
    let error = simulate(RolloutRequest::new(&linked(Base::Fixed), &hold(0.0)).setup(&setup)).unwrap_err().to_string();
    assert!(error.contains("`c` mimics `a`, which the reference engine cannot simulate"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// The constraint force of a follower does no work: it acts on both joints in the ratio of their motion.
    #[test]
    fn linkages_do_no_work(
        q in prop::array::uniform2(-1.0..1.0f64),
        dq in prop::array::uniform2(-2.0..2.0f64),
        torques in prop::array::uniform4(-2.0..2.0f64),
    ) {
        let robot = linked(Base::Floating);
        let free = Robot { base: Base::Floating, ..tree(&Actuator::Passive) };
        let pose = Isometry3::identity();
        let base = BaseState { pose, velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::x() };
        let joints = vec![(q[0], dq[0]), (q[1], dq[1]), (0.3 * q[0], 0.3 * dq[0]), (-1.5 * q[1] + 0.2, -1.5 * dq[1])];
        let state = RobotState { joints, base };
        let gravity = Vector3::new(0.0, 0.0, -G);
        let linked = forward_dynamics(&robot, gravity, &state, &torques);
        prop_assert!((linked[8] - 0.3 * linked[6]).abs() < 1e-9 && (linked[9] + 1.5 * linked[7]).abs() < 1e-9);
        let alone = |extra: [f64; 2]| {
            let leaders = [torques[0] - 0.3 * extra[0], torques[1] + 1.5 * extra[1]];
            let pushed = [leaders[0], leaders[1], torques[2] + extra[0], torques[3] + extra[1]];
            forward_dynamics(&free, gravity, &state, &pushed)
        };
        // Accelerations are linear in the two forces: solve for the forces that give the followers' accelerations, and
        // compare all others.
        let (none, one, other) = (alone([0.0; 2]), alone([1.0, 0.0]), alone([0.0, 1.0]));
        let column = |with: &[f64]| nalgebra::Vector2::new(with[8] - none[8], with[9] - none[9]);
        let response = nalgebra::Matrix2::from_columns(&[column(&one), column(&other)]);
        let needed = response.try_inverse().unwrap() * nalgebra::Vector2::new(linked[8] - none[8], linked[9] - none[9]);
        for (a, b) in alone(needed.into()).iter().zip(&linked) {
            prop_assert!((a - b).abs() < 1e-8 * (1.0 + b.abs()), "{} and {}", a, b);
        }
    }
}

#[test]
fn a_leader_with_a_start_velocity_moves_its_followers() {
    let mut robot = linked(Base::Fixed);
    robot.links[1].joint.start = 0.4;
    let moving = Setup { start_velocities: vec![2.0, 0.0, 0.0, 0.0], ..fast(0.001, 0.01) };
    let log = run(&robot, &moving, &hold(0.0));
    let first = |channel: &str| log.values(channel).unwrap()[0];
    assert!((first("q_c") - 0.3 * 0.4).abs() < 1e-15 && (first("dq_c") - 0.3 * 2.0).abs() < 1e-15);
    let jump = log.values("dq_c").unwrap()[1] - first("dq_c");
    assert!(jump.abs() < 0.05, "no jump in the first step: {jump} m/s");
}

/// Heavy pendulums that all follow a light one, for which an iterative solver would converge very slowly.
#[test]
fn a_light_leader_leads_many_heavy_followers_exactly() {
    let mut robot = arm();
    robot.links.truncate(2);
    robot.links[1].joint.origin = Isometry3::identity();
    robot.links[1].mass_kg *= 0.01;
    robot.links[1].inertia_kg_m2 *= 0.01;
    let leader = robot.links[1].clone();
    for number in 0..6 {
        let mut follower = leader.clone();
        follower.name = format!("follower{number}");
        follower.joint.name = format!("follower{number}");
        (follower.mass_kg, follower.inertia_kg_m2) = (100.0 * leader.mass_kg, leader.inertia_kg_m2 * 100.0);
        robot.links.push(follower);
        follows(
            &mut robot,
            &format!("follower{number}"),
            &leader.joint.name,
            if number % 2 == 0 { 1.0 } else { -2.0 },
            0.0,
        );
    }
    let base =
        BaseState { pose: Isometry3::identity(), velocity_m_s: Vector3::zeros(), angular_rad_s: Vector3::zeros() };
    let state = RobotState { joints: vec![(0.0, 0.0); 7], base };
    let torques = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    let found = forward_dynamics(&robot, Vector3::zeros(), &state, &torques);
    let axis = leader.joint.axis;
    let offset = leader.com_m.coords - axis * axis.dot(&leader.com_m.coords);
    let inertia = (leader.inertia_kg_m2 * axis).dot(&axis) + leader.mass_kg * offset.norm_squared();
    let expected = 1.0 / (inertia * (1.0 + 100.0 * (3.0 + 3.0 * 4.0)));
    for (k, acceleration) in found.iter().enumerate() {
        let ratio = [1.0, 1.0, -2.0, 1.0, -2.0, 1.0, -2.0][k];
        assert!(
            (acceleration / (ratio * expected) - 1.0).abs() < 1e-9,
            "{k}: {acceleration}, expected {}",
            ratio * expected
        );
    }
}
