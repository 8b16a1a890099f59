//! Logs as MCAP with ROS 2 messages, readable by Foxglove, Rerun, PlotJuggler and rosbags.
//!
//! The topic `/btr/channels` is the log itself, bit by bit: one field per channel and the time in seconds. The standard
//! topics (`/joint_states`, `/joint_commands`, `/imu`, `/tf`, `/robot_description`) are views of it for other tools.
//! Foreign recordings are read from the standard topics.

mod merge;
mod other;
mod overlay;
mod own;
mod read;
mod recording;
mod ros;
mod views;
mod write;

pub use overlay::{MovingFrame, OverlaidRobot, Overlay, frame_of};
pub(crate) use overlay::{is_overlay, write as write_overlay};
pub(crate) use read::read;
pub use recording::Recording;
pub(crate) use write::write;
