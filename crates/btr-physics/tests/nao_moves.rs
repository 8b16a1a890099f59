//! The Nao walks and kicks in simulation, with the paper's time steps.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use btr_core::log::Log;
use btr_core::space::Space;
use btr_physics::drive::{Drive, NaoKick, NaoWalk, References};
use btr_physics::presets::nao::{CONTROL_S, STEPS_PER_CONTROL, UNCERTAIN_MASSES, nao};
use btr_physics::robot::Robot;
use btr_physics::rollout::{RolloutRequest, simulate};
use btr_physics::setup::{Ball, Sensors, Setup};
use nalgebra::Point3;

/// Number of samples, N in the paper.
const SAMPLES: usize = 4024;

fn setup(duration_s: f64) -> Setup {
    let dt_s = CONTROL_S / STEPS_PER_CONTROL as f64;
    let sensors = Sensors { velocities: false, torques: false, imu: true, feet: true };
    Setup { dt_s, duration_s, control_s: CONTROL_S, interpolate: true, sensors, ..Setup::default() }
}

/// The nominal point of a space with some values replaced.
fn point(space: &Space, changes: &[(&str, f64)]) -> Vec<f64> {
    let mut point = space.nominal();
    for (name, value) in changes {
        point[space.index_of(name).unwrap()] = *value;
    }
    point
}

fn placed(mut robot: Robot, references: &References) -> Robot {
    references.place(&mut robot);
    robot
}

fn walk(robot: Robot, changes: &[(&str, f64)], duration_s: f64) -> Log {
    let walk = NaoWalk::new(&nao(), &point(&NaoWalk::space().unwrap(), changes), duration_s).unwrap();
    simulate(RolloutRequest::new(&placed(robot, walk.references()), &walk).setup(&setup(duration_s))).unwrap()
}

/// The first time at which the torso is low or tilted by more than 45 degrees.
fn fall_s(log: &Log) -> Option<f64> {
    let [z, x, y] = ["base_z", "base_qx", "base_qy"].map(|name| log.values(name).unwrap());
    let up = |i: usize| 1.0 - 2.0 * (x[i] * x[i] + y[i] * y[i]);
    (0..log.len()).find(|&i| up(i) < 0.7 || z[i] < 0.6 * z[0]).map(|i| log.clock_s()[i])
}

/// Number of landings of the foot after at least 0.1 s in the air; shorter flights are bounces.
fn landings(log: &Log, foot: &str) -> usize {
    let (mut left_s, mut count) = (None, 0);
    for (&time_s, &force) in log.clock_s().iter().zip(log.values(foot).unwrap()) {
        if force <= 0.0 {
            left_s = left_s.or(Some(time_s));
        } else if left_s.take().is_some_and(|left| time_s - left > 0.1) {
            count += 1;
        }
    }
    count
}

fn last(log: &Log, name: &str) -> f64 {
    *log.values(name).unwrap().last().unwrap()
}

/// The Nao with the eight masses of the paper's search space scaled; the bodies keep their shape.
fn with_masses(factors: [f64; 8]) -> Robot {
    let mut robot = nao();
    for (name, factor) in UNCERTAIN_MASSES.iter().zip(factors) {
        let link = robot.link(name).unwrap();
        robot.links[link].mass_kg *= factor;
        robot.links[link].inertia_kg_m2 *= factor;
    }
    robot
}

#[test]
fn walks_for_all_the_paper_s_samples() {
    let duration_s = SAMPLES as f64 * CONTROL_S / STEPS_PER_CONTROL as f64;
    let log = walk(nao(), &[], duration_s);
    assert!(log.len() >= SAMPLES);
    assert_eq!(fall_s(&log), None);
    // 31.1 s of walking with a step every 0.45 s.
    for foot in ["foot_LAnkleRoll", "foot_RAnkleRoll"] {
        let count = landings(&log, foot);
        assert!((32..=36).contains(&count), "{foot} landed {count} times");
    }
    // 69 steps of 0.04 m, of which the first four are shorter.
    let travelled = last(&log, "base_x") - log.values("base_x").unwrap()[0];
    assert!((2.3..2.8).contains(&travelled), "{travelled} m");
    assert!(last(&log, "base_y").abs() < 0.3, "{} m aside", last(&log, "base_y"));
}

/// Fall detection reports a fall.
#[test]
fn a_bad_walk_falls() {
    let log = walk(nao(), &[("sway", 0.08), ("stiffening", 0.0), ("step_period", 0.6)], 10.0);
    assert!(fall_s(&log).is_some());
}

/// Corners of the ±50 % box, each with four heavy and four light bodies or all equal.
#[test]
fn walks_with_wrong_masses() {
    let patterns =
        [0b0000_0000, 0b1111_1111, 0b0101_0101, 0b1010_1010, 0b0011_1100, 0b1110_0010, 0b0001_1101, 0b1001_0110];
    let factors = |pattern: u32| std::array::from_fn(|i| if pattern >> i & 1 == 1 { 1.5 } else { 0.5 });
    let stood = patterns.iter().filter(|&&p| fall_s(&walk(with_masses(factors(p)), &[], 10.0)).is_none()).count();
    assert!(stood >= 6, "only {stood} of {} stood", patterns.len());
}

/// A controller that assumes other masses changes the readings; otherwise nothing could be identified.
#[test]
fn a_heavier_shank_shows_in_the_joint_angles() {
    let nominal = walk(nao(), &[], 4.0);
    let heavy = walk(with_masses([1.0, 1.0, 1.0, 1.0, 1.5, 1.0, 1.0, 1.0]), &[], 4.0);
    let rms = |name: &str| {
        let (a, b) = (nominal.values(name).unwrap(), heavy.values(name).unwrap());
        (a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>() / a.len() as f64).sqrt()
    };
    assert!(rms("q_RHipRoll") > 1e-3, "{}", rms("q_RHipRoll"));
    assert!(rms("q_HeadYaw") < 0.1 * rms("q_RHipRoll"), "{}", rms("q_HeadYaw"));
}

#[test]
fn the_same_walk_gives_the_same_bits() {
    assert_eq!(walk(nao(), &[], 3.0), walk(nao(), &[], 3.0));
}

fn kick(changes: &[(&str, f64)]) -> Log {
    let kick = NaoKick::new(&nao(), &point(&NaoKick::space().unwrap(), changes)).unwrap();
    let radius_m = 0.04;
    // 3 cm in front of the right foot, whose front is at 0.10.
    let ball = Ball {
        radius_m,
        mass_kg: 0.05,
        start_m: Point3::new(0.13 + radius_m, -0.06, radius_m),
        friction: 0.5,
        restitution: 0.5,
        rolling_damping_per_s: 1.0,
    };
    let setup = Setup { ball: Some(ball), ..setup(4.0) };
    simulate(RolloutRequest::new(&placed(nao(), kick.references()), &kick).setup(&setup)).unwrap()
}

#[test]
fn a_kick_moves_the_ball_and_leaves_the_robot_standing() {
    let log = kick(&[]);
    assert_eq!(fall_s(&log), None);
    let rolled = last(&log, "ball_x") - log.values("ball_x").unwrap()[0];
    assert!(rolled > 0.5, "{rolled} m");
    assert!((last(&log, "ball_y") + 0.06).abs() < 0.3 * rolled, "{} m aside", last(&log, "ball_y") + 0.06);
}

#[test]
fn a_kick_without_a_swing_does_not_move_the_ball() {
    let log = kick(&[("backswing", 0.0), ("follow_through", 0.0)]);
    assert_eq!(fall_s(&log), None);
    assert!((last(&log, "ball_x") - log.values("ball_x").unwrap()[0]).abs() < 1e-3);
}

/// Every controller of the spaces gives valid references, reachable or not: within ranges and speeds.
#[test]
fn corners_of_the_controller_spaces_stay_within_ranges_and_speeds() {
    let robot = nao();
    let check = |drive: &dyn Drive| {
        let mut before = None;
        for i in 0..110 {
            let mut command = [0.0; 22];
            drive.command(i as f64 * CONTROL_S, &mut command);
            let was = before.replace(command).unwrap_or(command);
            for ((q, was), (_, link)) in command.iter().zip(was).zip(robot.movable()) {
                let (low, high) = link.joint.limits;
                assert!((low..=high).contains(q), "{}: {q} rad", link.name);
                let speed = (q - was).abs() / CONTROL_S;
                assert!(speed < link.joint.speed_limit * (1.0 + 1e-9), "{}: {speed} rad/s", link.name);
            }
        }
    };
    let corner = |space: &Space, bits: usize| {
        space.from_unit(&(0..space.len()).map(|i| (bits >> i & 1) as f64).collect::<Vec<_>>())
    };
    for bits in 0..1 << 10 {
        check(&NaoWalk::new(&robot, &corner(&NaoWalk::space().unwrap(), bits), 4.0).unwrap());
    }
    for bits in 0..1 << 9 {
        check(&NaoKick::new(&robot, &corner(&NaoKick::space().unwrap(), bits)).unwrap());
    }
    check(&NaoWalk::new(&robot, &NaoWalk::space().unwrap().nominal(), f64::NAN).unwrap());
    assert!(NaoWalk::new(&robot, &[0.0; 10], 4.0).is_err());
    assert!(NaoKick::new(&robot, &[f64::NAN; 9]).is_err());
}
