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
