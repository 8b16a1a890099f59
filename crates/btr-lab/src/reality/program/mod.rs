//! Programs that move the robot: each runs in a process group of its own, and ends with all processes that it started.

mod group;
mod output;
mod process;
mod record;
mod signal;
#[cfg_attr(unix, path = "unix.rs")]
#[cfg_attr(not(unix), path = "windows.rs")]
mod system;
mod tell;

pub(super) use group::{POLL, Stopping, listed};
pub(super) use process::{End, OutputFiles, Program};
pub(super) use record::Record;
pub use signal::StopSignal;
pub(super) use tell::tell;
