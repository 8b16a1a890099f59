//! Realities: where the truth comes from. Each kind is one file; all keep what they produced on disk before anybody
//! uses it.

mod called;
mod clock;
mod command;
mod logs;
mod manual;
mod store;
mod twin;

pub use called::{Asked, Called, Unanswered};
pub use command::Command;
pub use logs::Logs;
pub use manual::Manual;
pub use store::{Store, StoreError};
pub use twin::{Revealed, Stage, Twin};

use btr_core::world::Reality;

/// A reality that may tell at the end what it was.
pub trait Revealing: Reality + Send + Sync {
    /// The truth, where it is known: hidden twins know it, robots do not.
    fn reveal(&self) -> Option<Revealed> {
        None
    }
}

impl Revealing for Logs {}
impl Revealing for Called {}
impl Revealing for Command {}
impl Revealing for Manual {}
