//! Restarts: resetting the robot's state during a rollout (multiple shooting), so that errors grow for no longer than
//! one segment.

use crate::effects::PlacedEffect;
use crate::engine::{Dynamics, RobotState};
use crate::robot::Robot;
use btr_core::world::WorldError;

/// The state at the start of a segment. The internal states of servos and effects are kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Restart {
    /// Time of the restart, in s.
    pub time_s: f64,
    /// Joints as encoder readings, and the root.
    pub state: RobotState,
}

/// Converts restarts from encoder readings to true joint states, by inverting the effects on encoders.
pub(crate) fn undo_encoder_effects(
    restarts: &[Restart],
    robot: &Robot,
    effects: &[PlacedEffect],
) -> Result<Vec<Restart>, WorldError> {
    let mut restarts = restarts.to_vec();
    if restarts.is_empty() {
        return Ok(restarts);
    }
    for placed in effects.iter().filter(|placed| !placed.is_off()) {
        for joint in placed.joints(robot)? {
            for (q, dq) in restarts.iter_mut().filter_map(|restart| restart.state.joints.get_mut(joint)) {
                let truth = |reading: f64| placed.effect.start(&placed.values, reading);
                // Readings are affine in the true position.
                (*q, *dq) = (truth(*q), truth(*dq) - truth(0.0));
            }
        }
    }
    Ok(restarts)
}

/// A hook that sets the robot's state when a restart is due; `dt_s` is the simulation's step.
pub(crate) fn apply_restarts(restarts: &[Restart], dt_s: f64) -> impl FnMut(f64, &mut dyn Dynamics) + '_ {
    let mut due = restarts.iter().peekable();
    move |time_s, engine| {
        while let Some(restart) = due.next_if(|restart| restart.time_s <= time_s + 0.5 * dt_s) {
            engine.place(&restart.state);
        }
    }
}

#[cfg(all(test, feature = "rapier"))]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::drive::Drive;
    use crate::engine::rapier::Rapier;
    use crate::presets::ant;
    use crate::robot::Base;
    use crate::rollout::{RolloutRequest, simulate};
    use crate::setup::{EngineName, Setup};
    use btr_core::log::Log;

    const DT_S: f64 = 0.002;
    const AT_S: f64 = 0.5;

    fn setup(robot: &Robot) -> Setup {
        let floor = if robot.base == Base::Floating { Setup::default().ground } else { None };
        Setup { dt_s: DT_S, duration_s: 0.8, control_s: 0.01, ground: floor, ..Setup::default() }
    }

    /// The ant, with a floating or a fixed base.
    fn robot(base: Base) -> Robot {
        Robot { base, ..ant::ant() }
    }

    /// The log of a rollout, and the state at `AT_S`.
    fn run(robot: &Robot, engine: EngineName, restarts: &[Restart], drive: &dyn Drive) -> (Log, RobotState) {
        let mut restarted = apply_restarts(restarts, DT_S);
        let mut state_at_s = None;
        let mut hook = |time_s: f64, engine: &mut dyn Dynamics| {
            if state_at_s.is_none() && time_s > AT_S - 0.5 * DT_S {
                state_at_s = Some(RobotState::of(engine));
            }
            restarted(time_s, engine);
        };
        let setup = Setup { engine, ..setup(robot) };
        let log = simulate(RolloutRequest::new(robot, drive).setup(&setup).hook(Box::new(&mut hook))).unwrap();
        (log, state_at_s.unwrap())
    }

    /// Largest difference of joint positions in the `for_s` seconds after `from_s`.
    fn apart(a: &Log, b: &Log, from_s: f64, for_s: f64) -> f64 {
        let joints = a.channels().filter(|(name, _)| name.starts_with("q_"));
        let samples = (from_s / DT_S).round() as usize..=((from_s + for_s) / DT_S).round() as usize;
        let late = |log: &Log, name: &str| log.values(name).unwrap()[samples.clone()].to_vec();
        let far = |name: &str| late(a, name).iter().zip(late(b, name)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        joints.map(|(name, _)| far(name)).fold(0.0, f64::max)
    }

    #[test]
    fn restarting_in_the_present_state_changes_nothing() {
        for base in [Base::Fixed, Base::Floating] {
            let (robot, drive) = (robot(base), ant::tripod());
            let (log, state) = run(&robot, EngineName::Auto, &[], &drive);
            let (again, _) = run(&robot, EngineName::Auto, &[Restart { time_s: AT_S, state }], &drive);
            let apart = apart(&log, &again, 0.0, 0.8);
            assert!(apart <= 0.0, "{base:?}: {apart}");
        }
    }

    #[test]
    fn a_restart_erases_earlier_differences() {
        let displaced = |mut robot: Robot| {
            robot.links.iter_mut().for_each(|link| link.joint.start += 0.1);
            robot.start.translation.z += 0.01;
            robot
        };
        let without_integral = |mut robot: Robot| {
            for link in &mut robot.links {
                if let crate::robot::Actuator::Position { ki, .. } = &mut link.joint.actuator {
                    *ki = 0.0;
                }
            }
            robot
        };
        // With contact, only briefly: the impulses with which Rapier's few sweeps start are not part of the state, and
        // in another order the sweeps give another result.
        for (base, engine, for_s, tolerance) in [
            (Base::Fixed, EngineName::Auto, 0.2, 1e-9),
            (Base::Fixed, EngineName::Rapier, 0.2, 1e-12),
            (Base::Floating, EngineName::Rapier, 0.01, 1e-3),
        ] {
            let (robot, drive) = (without_integral(robot(base)), ant::tripod());
            let (log, state) = run(&robot, engine, &[], &drive);
            let moved = displaced(robot);
            let (other, _) = run(&moved, engine, &[], &drive);
            let (again, _) = run(&moved, engine, &[Restart { time_s: AT_S, state }], &drive);
            let [before, after] = [&other, &again].map(|late| apart(&log, late, AT_S + DT_S, for_s));
            assert!(after < tolerance, "{base:?} {engine:?}: {after}, without {before}");
        }
    }

    #[test]
    fn collision_shapes_move_with_the_bodies() {
        let standing = ant::ant();
        let setup = setup(&standing);
        let on_the_floor = RobotState::of(&Rapier::new(&standing, &setup));
        let mut aloft = standing;
        aloft.start.translation.z += 0.05;
        let mut engine = Rapier::new(&aloft, &setup);
        engine.step();
        assert!(engine.foot_force_n(0) <= 0.0);
        engine.place(&on_the_floor);
        engine.step();
        assert!(engine.foot_force_n(0) > 0.0);
    }
}
