//! Whether a log is usable for a robot, and how good it is. All judgements of a log are in this folder: [`usable`] has
//! the errors that refuse a log, [`robot`] the findings of `btr check`, [`coverage`] what all logs of a command have in
//! common.

pub(crate) mod coverage;
pub(crate) mod robot;
pub(crate) mod usable;

pub(crate) use robot::quality;
