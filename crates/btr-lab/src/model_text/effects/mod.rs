//! Effects in a model file's text: added, removed, and the values of those that it states.

mod add;
mod in_place;
mod law;
mod remove;

pub(crate) use add::add_scaled;
pub(super) use add::rounded;
pub use add::{AddError, Addition, add};
pub(super) use in_place::write_in_effect;
pub use law::{OwnLaw, OwnNumber, add_law};
pub use remove::{RemoveError, remove};
