//! Realities: how real tests are carried out. Each kind is one file; all of them save a result to disk before it is
//! used.

mod clock;
mod command;
pub(crate) mod commands;
mod function;
mod logs;
mod manual;
mod revealed;
mod store;
mod twin;

pub use command::{CommandReality, CommandSettings};
pub use function::{FunctionReality, RobotFunction, TestFailure, TestRequest};
pub use logs::RecordedReality;
pub use manual::ManualReality;
pub use revealed::{Revealed, Revealing};
pub use store::{Store, StoreError};
pub use twin::{TwinReality, TwinStage};
