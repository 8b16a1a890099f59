//! Realities: where the truth comes from. Each kind is one file; all keep what they produced on disk before anybody
//! uses it.

mod command;
mod logs;
mod manual;
mod store;
mod twin;

pub use command::Command;
pub use logs::Logs;
pub use manual::Manual;
pub use store::{Store, StoreError};
pub use twin::{Revealed, Twin};
