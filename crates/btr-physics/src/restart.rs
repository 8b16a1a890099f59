//! Moving a robot to another state on the way, so that errors do not build up for longer than a window.

use crate::effect::Placed;
use crate::engine::{Dynamics, State};
use crate::robot::Robot;
use btr_core::world::WorldError;

/// The state in which a window of a log begins. What a servo or an effect remembers goes on.
#[derive(Clone, Debug, PartialEq)]
pub struct Restart {
    /// When, in s.
    pub time_s: f64,
    /// Joints as their encoders read them, and the root.
    pub state: State,
}

/// The restarts of a robot whose readings depend on the effects on its encoders.
pub(crate) fn read_back(restarts: &[Restart], robot: &Robot, effects: &[Placed]) -> Result<Vec<Restart>, WorldError> {
    let mut restarts = restarts.to_vec();
    if restarts.is_empty() {
        return Ok(restarts);
    }
    for placed in effects.iter().filter(|placed| !placed.is_off()) {
        for joint in placed.joints(robot)? {
            for (q, dq) in restarts.iter_mut().filter_map(|restart| restart.state.joints.get_mut(joint)) {
                let truth = |reading: f64| placed.effect.start(&placed.values, reading);
                // Readings are linear in what they read.
                (*q, *dq) = (truth(*q), truth(*dq) - truth(0.0));
            }
        }
    }
    Ok(restarts)
}

/// Moves the robot whenever one of the restarts is due; `dt_s` is the simulation's step.
pub(crate) fn lead(restarts: &[Restart], dt_s: f64) -> impl FnMut(f64, &mut dyn Dynamics) + '_ {
    let mut due = restarts.iter().peekable();
    move |time_s, engine| {
        while let Some(restart) = due.next_if(|restart| restart.time_s <= time_s + 0.5 * dt_s) {
            engine.place(&restart.state);
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::ant;
    use crate::drive::Drive;
    use crate::robot::Base;
    use crate::sim::{EngineName, Setup, simulate_led};
    use btr_core::log::Log;

    const DT_S: f64 = 0.002;
    const AT_S: f64 = 0.3;

    fn setup(robot: &Robot) -> Setup {
        let floor = if robot.base == Base::Floating { Setup::default().ground } else { None };
        Setup { dt_s: DT_S, duration_s: 0.6, control_s: 0.01, ground: floor, ..Setup::default() }
    }

    /// The ant, or the same bolted down.
    fn robot(base: Base) -> Robot {
        Robot { base, ..ant::ant() }
    }

    /// The run, and its state at `AT_S`.
    fn run(robot: &Robot, engine: EngineName, restarts: &[Restart], drive: &dyn Drive) -> (Log, State) {
        let mut restarted = lead(restarts, DT_S);
        let mut there = None;
        let mut lead = |time_s: f64, engine: &mut dyn Dynamics| {
            if there.is_none() && time_s > AT_S - 0.5 * DT_S {
                there = Some(State::of(engine));
            }
            restarted(time_s, engine);
        };
        let setup = Setup { engine, ..setup(robot) };
        let log = simulate_led(robot, &[], &setup, drive, None, &mut lead).unwrap();
        (log, there.unwrap())
    }

    /// Largest distance of joint positions after `from_s`.
    fn apart(a: &Log, b: &Log, from_s: f64) -> f64 {
        let joints = a.channels().filter(|(name, _)| name.starts_with("q_"));
        let late = |log: &Log, name: &str| log.values(name).unwrap()[(from_s / DT_S).round() as usize..].to_vec();
        let far = |name: &str| late(a, name).iter().zip(late(b, name)).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max);
        joints.map(|(name, _)| far(name)).fold(0.0, f64::max)
    }

    /// A tenth of a degree: what a common encoder resolves. Why the ant is moved at all is not known yet.
    const ENCODER_STEP_RAD: f64 = 0.0017;

    #[test]
    fn its_own_state_changes_nothing() {
        for (base, least) in [(Base::Fixed, 0.0), (Base::Floating, ENCODER_STEP_RAD)] {
            let (robot, drive) = (robot(base), ant::tripod());
            let (log, state) = run(&robot, EngineName::Auto, &[], &drive);
            let (again, _) = run(&robot, EngineName::Auto, &[Restart { time_s: AT_S, state }], &drive);
            assert!(apart(&log, &again, 0.0) <= least, "{base:?}: {}", apart(&log, &again, 0.0));
        }
    }

    #[test]
    fn whatever_was_before_is_forgotten() {
        let elsewhere = |mut robot: Robot| {
            robot.links.iter_mut().for_each(|link| link.joint.start += 0.1);
            robot.start.translation.z += 0.01;
            robot
        };
        let unhurried = |mut robot: Robot| {
            for link in &mut robot.links {
                if let crate::robot::Actuator::Position { ki, .. } = &mut link.joint.actuator {
                    *ki = 0.0;
                }
            }
            robot
        };
        for (base, engine, most) in [
            (Base::Fixed, EngineName::Auto, 1e-3),
            (Base::Fixed, EngineName::Rapier, 1e-9),
            (Base::Floating, EngineName::Rapier, 3e-3),
        ] {
            let (robot, drive) = (unhurried(robot(base)), ant::tripod());
            let (log, state) = run(&robot, engine, &[], &drive);
            let moved = elsewhere(robot);
            let (other, _) = run(&moved, engine, &[], &drive);
            let (again, _) = run(&moved, engine, &[Restart { time_s: AT_S, state }], &drive);
            let (before, after) = (apart(&log, &other, AT_S + DT_S), apart(&log, &again, AT_S + DT_S));
            assert!(after < most, "{base:?} {engine:?}: {after}, without {before}");
        }
    }
}
