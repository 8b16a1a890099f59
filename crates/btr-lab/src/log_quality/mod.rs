//! Quality of logs for a robot. [`usable`] has the errors that reject a log, [`robot`] the findings of `btr check`,
//! [`in_common`] what several joints have in common, [`coverage`] the checks over all logs of a command,
//! [`beside_model`] glitches that show beside a simulation, [`torque_noise`] the noise floors of torques, and
//! [`repeats`] what runs of the same command differ by, [`stated_noise`] noise that the model states too low, and
//! [`at_limit`] torques of the model that stand at their limit.

pub(crate) mod at_limit;
pub(crate) mod beside_model;
pub(crate) mod coverage;
pub(crate) mod in_common;
pub(crate) mod repeats;
pub(crate) mod robot;
pub(crate) mod stated_noise;
pub(crate) mod torque_noise;
pub(crate) mod usable;

pub(crate) use robot::quality;
