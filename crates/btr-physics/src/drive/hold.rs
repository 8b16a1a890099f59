//! Drive that holds every joint at its start position.

use super::Drive;
use crate::robot::Robot;

/// The start positions as constant references.
#[derive(Clone, Debug, PartialEq)]
pub struct Hold {
    starts: Vec<f64>,
}

impl Hold {
    /// Holds `robot` at its start positions.
    pub fn new(robot: &Robot) -> Self {
        Hold { starts: robot.movable().map(|(_, link)| link.joint.start).collect() }
    }
}

impl Drive for Hold {
    fn command(&self, _time_s: f64, command: &mut [f64]) {
        command.copy_from_slice(&self.starts);
    }
}
