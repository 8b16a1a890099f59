//! Logs as MCAP in ROS 2's terms, so that Foxglove, Rerun, PlotJuggler and rosbags open them.
//!
//! The topic `/btr/channels` is the log itself, bit by bit: one field per channel and the time in seconds. The standard
//! topics beside it (`/joint_states`, `/joint_commands`, `/imu`, `/tf`, `/robot_description`) are views of it for other
//! people's tools. Other people's recordings are read from the standard topics.

mod merge;
mod other;
mod own;
mod read;
mod recording;
mod ros;
mod views;
mod write;

pub(crate) use read::read;
pub use recording::Recording;
pub(crate) use write::write;
