//! Tells the joints what a log says they were told.

use super::Drive;
use crate::robot::Robot;
use btr_core::log::Log;

/// How much of the usual time between samples a stamp may be late.
const LATE: f64 = 0.1;

/// The commands of a log, each held until the next one.
///
/// A missing command (NaN) switches the torque off, as does a channel `torque_on` that is below one half or missing. A joint
/// without a `cmd_<joint>` channel is never driven.
#[derive(Clone, Debug, PartialEq)]
pub struct Replay {
    clock_s: Vec<f64>,
    /// How much later than it was due a command may have been stamped, in s.
    late_s: f64,
    commands: Vec<Option<Vec<f64>>>,
    torque_on: Option<Vec<f64>>,
}

impl Replay {
    /// The drive that repeats what `robot` was told in `log`. Time counts from the log's first sample.
    pub fn new(log: &Log, robot: &Robot) -> Self {
        let values = |name: &str| log.channel(name).map(|channel| channel.values.clone());
        let start_s = log.clock_s().first().copied().unwrap_or(0.0);
        Replay {
            clock_s: log.clock_s().iter().map(|t| t - start_s).collect(),
            late_s: LATE * log.usual_step_s().unwrap_or(0.0),
            commands: robot.movable().map(|(_, link)| values(&format!("cmd_{}", link.joint.name))).collect(),
            torque_on: values("torque_on"),
        }
    }
}

impl Drive for Replay {
    fn command(&self, time_s: f64, command: &mut [f64]) {
        // A command that is due now counts, although its stamp was rounded or a little late.
        let due = self.clock_s.partition_point(|&t| t <= time_s + self.late_s).saturating_sub(1);
        let on = self.torque_on.as_ref().is_none_or(|on| on.get(due).is_some_and(|&on| on >= 0.5));
        for (command, told) in command.iter_mut().zip(&self.commands) {
            let told = told.as_ref().and_then(|values| values.get(due)).copied();
            *command = told.filter(|_| on).unwrap_or(f64::NAN);
        }
    }
}
