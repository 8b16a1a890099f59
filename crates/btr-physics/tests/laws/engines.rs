//! The two engines are independent implementations of the same mechanics: they converge as the step shrinks.

use crate::scene::{G, Told, hold, last, placed, run, run_with, setup};
use btr_core::log::Log;
use btr_physics::effects::PlacedEffect;
use btr_physics::presets::pendulum::pendulum;
use btr_physics::robot::{Actuator, Base, Joint, JointKind, Link, Robot};
use btr_physics::setup::{EngineName, Setup};
use nalgebra::{Isometry3, Matrix3, Vector3};
use proptest::prelude::*;

pub(crate) fn link(name: &str, parent: Option<usize>, joint: Joint, mass_kg: f64, com: [f64; 3]) -> Link {
    let inertia_kg_m2 = Matrix3::from_diagonal(&Vector3::new(2.0, 3.0, 4.0)) * (mass_kg * 1e-3);
    Link {
        name: name.to_owned(),
        parent,
        joint,
        mass_kg,
        com_m: com.into(),
        inertia_kg_m2,
        shapes: vec![],
        mesh_boxes: vec![],
        foot: false,
    }
}

/// Two skew hinges with a slide at the end, and a second arm on the first link.
pub(crate) fn tree(actuator: &Actuator) -> Robot {
    let joint = |name: &str, kind, at: [f64; 3], turn: [f64; 3], axis: [f64; 3], start| Joint {
        actuator: actuator.clone(),
        start,
        ..Joint::new(name, kind, Isometry3::new(at.into(), turn.into()), Vector3::from(axis).normalize())
    };
    let turning = JointKind::Revolute;
    let root = Joint::new("root", JointKind::Fixed, Isometry3::identity(), Vector3::z());
    let links = vec![
        link("base", None, root, 2.0, [0.0; 3]),
        link(
            "upper",
            Some(0),
            joint("a", turning, [0.1, 0.0, 0.4], [0.2, 0.1, 0.0], [0.3, 1.0, 0.2], 0.5),
            1.1,
            [0.05, 0.02, -0.2],
        ),
        link(
            "lower",
            Some(1),
            joint("b", turning, [0.0, 0.05, -0.3], [0.0, 0.4, 0.3], [1.0, 0.2, 0.0], -0.4),
            0.7,
            [0.01, -0.03, -0.15],
        ),
        link(
            "tool",
            Some(2),
            joint("c", JointKind::Prismatic, [0.0, 0.0, -0.3], [0.1; 3], [0.2, 0.1, 1.0], 0.02),
            0.3,
            [0.02, 0.0, -0.05],
        ),
        link(
            "side",
            Some(1),
            joint("d", turning, [0.1, 0.0, -0.1], [0.0; 3], [0.0, 1.0, 0.0], 0.8),
            0.4,
            [0.1, 0.0, 0.0],
        ),
    ];
    let start = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.3, -0.2));
    Robot { name: "tree".to_owned(), base: Base::Fixed, start, links }
}

/// Largest difference of a joint's position between the engines.
fn apart(robot: &Robot, effects: &[PlacedEffect], setup: &Setup, drive: &dyn btr_physics::drive::Drive) -> f64 {
    let both = [EngineName::Auto, EngineName::Rapier]
        .map(|engine| run_with(robot, effects, &Setup { engine, ..setup.clone() }, drive));
    let difference = |name: &str, log: &Log| {
        let pairs = both[0].values(name).unwrap().iter().zip(log.values(name).unwrap());
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    robot.movable().map(|(_, link)| difference(&format!("q_{}", link.joint.name), &both[1])).fold(0.0, f64::max)
}

pub(crate) fn servo() -> Actuator {
    Actuator::Position { kp: 30.0, ki: 0.0, kd: 1.0, max_torque: f64::INFINITY }
}

fn at(dt_s: f64, duration_s: f64) -> Setup {
    Setup { control_s: 0.004, sample_s: Some(0.004), ..setup(dt_s, duration_s) }
}

#[test]
fn a_swinging_tree_converges() {
    let robot = tree(&Actuator::Passive);
    let [coarse, fine] = [0.0005, 0.00025].map(|dt| apart(&robot, &[], &at(dt, 0.8), &hold(f64::NAN)));
    assert!(fine < 2e-3 && fine < 0.6 * coarse, "{coarse}, then {fine} rad");
}

#[test]
fn a_driven_tree_with_friction_and_rotors_converges() {
    let effects = [placed("coulomb_friction", "*", &[0.3]), placed("armature", "*", &[0.01])];
    let wave = Told(|t: f64| 0.4 * (9.0 * t).sin());
    let [coarse, fine] = [0.001, 0.0005].map(|dt| apart(&tree(&servo()), &effects, &at(dt, 1.0), &wave));
    assert!(fine < 0.02 && fine < 0.6 * coarse, "{coarse}, then {fine} rad");
}

#[test]
fn a_driven_tree_is_of_second_order() {
    let wave = Told(|t: f64| 0.4 * (9.0 * t).sin());
    let effects = [placed("viscous_friction", "*", &[0.2]), placed("armature", "*", &[0.01])];
    let end = |dt: f64| {
        let setup = Setup { engine: EngineName::Auto, ..at(dt, 1.0) };
        let log = run_with(&tree(&servo()), &effects, &setup, &wave);
        ["a", "b", "c", "d"].map(|j| last(&log, &format!("q_{j}")))
    };
    let truth = end(0.000_062_5);
    let error = |dt: f64| end(dt).iter().zip(truth).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    let (coarse, fine) = (error(0.002), error(0.001));
    assert!(fine < 3e-4 && (3.3..4.7).contains(&(coarse / fine)), "{coarse}, then {fine} rad");
}

#[test]
fn a_pendulum_keeps_its_energy_to_second_order() {
    let mut robot = pendulum(1.3, 0.7, Actuator::Passive);
    robot.links[1].joint.start = 1.5;
    let drift = |dt: f64| {
        let log = run(&robot, &Setup { engine: EngineName::Auto, ..setup(dt, 5.0) }, &hold(0.0));
        let (q, dq) = (log.values("q_hinge").unwrap(), log.values("dq_hinge").unwrap());
        let energy = |i: usize| 1.3 * (0.5 * (0.7 * dq[i]).powi(2) - G * 0.7 * q[i].cos());
        (0..q.len()).map(|i| (energy(i) - energy(0)).abs() / (1.3 * G * 0.7)).fold(0.0, f64::max)
    };
    let (coarse, fine) = (drift(0.002), drift(0.001));
    assert!(coarse < 1e-4 && fine < 0.3 * coarse, "{coarse} of m·g·l, then {fine}");
}

#[test]
fn dry_friction_holds_without_creep() {
    let mut robot = pendulum(1.0, 0.5, Actuator::Passive);
    robot.links[1].joint.start = 0.7;
    let weight = G * 0.5 * 0.7f64.sin();
    let end = |torque: f64| {
        let friction = [placed("coulomb_friction", "hinge", &[torque])];
        last(
            &run_with(&robot, &friction, &Setup { engine: EngineName::Auto, ..setup(0.001, 10.0) }, &hold(0.0)),
            "q_hinge",
        )
    };
    assert!((end(1.01 * weight) - 0.7).abs() < 1e-12, "{}", end(1.01 * weight));
    assert!(end(0.99 * weight) < 0.695);
}

#[test]
fn a_joint_stops_at_its_limit() {
    let mut robot = pendulum(1.0, 0.5, Actuator::Passive);
    robot.links[1].joint.start = 1.2;
    robot.links[1].joint.limits = (0.3, 2.0);
    let log = run(&robot, &Setup { engine: EngineName::Auto, ..setup(0.001, 3.0) }, &hold(0.0));
    let least = log.values("q_hinge").unwrap().iter().copied().fold(f64::INFINITY, f64::min);
    assert!((least - 0.3).abs() < 1e-9 && (last(&log, "q_hinge") - 0.3).abs() < 1e-9, "{least}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]
    #[test]
    fn the_first_step_from_any_state_is_the_same(
        q in prop::array::uniform4(-1.5..1.5f64),
        dq in prop::array::uniform4(-3.0..3.0f64),
    ) {
        let mut robot = tree(&Actuator::Passive);
        robot.links.iter_mut().skip(1).zip(q).for_each(|(link, q)| link.joint.start = q);
        let dt_s = 1e-6;
        let start = Setup { start_velocities: dq.to_vec(), ..setup(dt_s, dt_s) };
        let end = |engine| {
            let log = run(&robot, &Setup { engine, ..start.clone() }, &hold(0.0));
            ["a", "b", "c", "d"].map(|j| last(&log, &format!("dq_{j}")))
        };
        let (own, rapier) = (end(EngineName::Auto), end(EngineName::Rapier));
        for i in 0..4 {
            // Accelerations of tens of rad/s² agree to a relative error of 1e-6.
            prop_assert!((own[i] - rapier[i]).abs() / dt_s < 2e-3, "{:?} {:?}", own, rapier);
        }
    }
}
