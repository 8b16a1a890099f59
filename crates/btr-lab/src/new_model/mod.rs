//! A model file to start from, made of a robot's description (URDF, xacro, MJCF) and logs with any column names.
//!
//! [`RobotFile::read`] gives a [`RobotDescription`], [`LogColumns::matched`] finds the joints' columns in logs, and
//! [`written`] writes the model file. What is guessed is told, in the file and as [`Draft::told`].

mod channels;
mod column;
mod columns;
mod convert;
mod description;
mod gains;
mod noise;
mod parameters;
mod text;
mod units;
mod words;

pub use columns::LogColumns;
pub use convert::RobotFile;
pub use description::{Command, JointFacts, RobotDescription};
pub use text::{Draft, UrdfPlace, written};
