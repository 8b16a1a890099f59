//! Edits of a model file's text that keep its comments and layout.

mod adapt;
mod add_effect;
mod add_law;
mod effects_in_place;
mod enlarged;
mod guesses;
mod in_place;
mod parameters_of;
mod paths;
mod patterns;
mod rigid_bodies;

pub use adapt::{FittedValue, SpacePoint, adapted, adapted_with_drive, at, in_finer_steps};
pub(crate) use add_effect::add_scaled;
pub use add_effect::{AddError, Addition, add};
pub use add_law::{OwnLaw, OwnNumber, add_law};
pub use enlarged::enlarges;
pub(crate) use guesses::{GAINS_GUESS, SERVO_GUESS};
pub(crate) use parameters_of::with_parameters_of;
pub(crate) use paths::each_named_file;
pub use paths::{moved, named_files, relative_path};
pub(crate) use rigid_bodies::{StatedBody, with_bodies};
