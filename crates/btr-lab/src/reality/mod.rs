//! Realities: how real tests are carried out. Each kind is one file; all of them save a result to disk before it is
//! used.

mod attempt;
mod clock;
mod command;
pub(crate) mod commands;
mod function;
mod logs;
mod manual;
mod program;
mod revealed;
mod settings;
mod store;
mod twin;

pub use command::CommandReality;
pub use function::{FunctionReality, RobotFunction, TestFailure, TestRequest};
pub use logs::RecordedReality;
pub use manual::ManualReality;
pub use program::StopSignal;
pub use revealed::{Revealed, Revealing};
pub use settings::CommandSettings;
pub use store::{Store, StoreError};
pub use twin::{TwinReality, TwinStage};
