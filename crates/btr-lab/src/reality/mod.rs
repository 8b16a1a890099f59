//! Realities: where the truth comes from. Each kind is one file; all keep what they produced on disk before anybody
//! uses it.

mod clock;
mod command;
mod function;
mod logs;
mod manual;
mod store;
mod twin;

pub use command::CommandReality;
pub use function::{FunctionReality, TestFailure, TestRequest};
pub use logs::RecordedReality;
pub use manual::ManualReality;
pub use store::{Store, StoreError};
pub use twin::{Revealed, TwinReality, TwinStage};

use btr_core::world::Reality;

/// A reality that may tell at the end what it was.
pub trait Revealing: Reality + Send + Sync {
    /// The truth, where it is known: hidden twins know it, robots do not.
    fn reveal(&self) -> Option<Revealed> {
        None
    }
}

impl Revealing for RecordedReality {}
impl Revealing for FunctionReality {}
impl Revealing for CommandReality {}
impl Revealing for ManualReality {}
