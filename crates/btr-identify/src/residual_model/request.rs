//! Requests to a residual model, and derived models.

use serde::{Deserialize, Serialize};

/// One rollout to be compared with a log.
#[derive(Clone, Copy, Debug)]
pub struct ResidualRequest<'a> {
    /// One coordinate per parameter.
    pub u: &'a [f64],
    /// Which log.
    pub log: usize,
    /// By how much each number of the log's start is moved, in all windows at once, in units of what noise could hide.
    /// Empty for the recorded start.
    pub moved: &'a [f64],
}

impl<'a> ResidualRequest<'a> {
    /// A rollout from the log's recorded start.
    pub fn of(u: &'a [f64], log: usize) -> Self {
        ResidualRequest { u, log, moved: &[] }
    }
}

/// A log whose start is moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MovedStart {
    /// The log, as an index.
    pub log: usize,
    /// By how much each number of its start is moved, as in [`ResidualRequest::moved`].
    pub by: Vec<f64>,
}

/// A change of a residual model that gives another one. Serialised; the order of the variants is part of the format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Derivation {
    /// Only the beginnings of logs count: a robot that tips over continues in ways that no probe around the model
    /// predicts, but why it tips shows before it does. Not available where the whole of a log follows smoothly from its
    /// beginning.
    Beginnings,
    /// The parts of the logs' starts that only a model determines, and its noise floors, are taken from the model at
    /// these coordinates. Not available where they do not depend on the model, or where starts are searched number by
    /// number ([`StartNumber::search_sd`](super::StartNumber::search_sd)).
    WithStartsAt(Vec<f64>),
    /// The starts of some logs, and of those that begin with them, are moved.
    WithInitialState(Vec<MovedStart>),
    /// Logs are cut into short windows that begin in the measured state, so that an error does not grow over the log:
    /// around a motion that has run off from the measured one, no probe shows the way back. Available for robots on a
    /// fixed base that touch nothing and none of whose joints follows a prescribed motion.
    InWindows,
    /// The readings that depart from the model's motion at these coordinates as no error of a model does are left out.
    /// Not available where there are none, nor where glitches are kept.
    WithoutGlitchesAt(Vec<f64>),
    /// The noise floors of torques that a prescribed motion requires are taken from the model at these coordinates. The
    /// more inertia it has, the more torque the noise of the motion becomes. Not available where that changes next to
    /// nothing, nor for other motions.
    WithTorqueFloorsAt(Vec<f64>),
    /// The motion that joints follow has as much noise again as it has, by the draw of this number. Not available for
    /// other motions.
    WithNoisierMotion(usize),
}
