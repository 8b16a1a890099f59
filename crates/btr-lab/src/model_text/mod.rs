//! Edits of a model file's text that keep its comments and layout.

mod adapt;
mod effects;
mod enlarged;
mod guesses;
mod in_place;
mod parameters_of;
mod paths;
mod patterns;
mod rigid_bodies;

pub use adapt::{FittedValue, SpacePoint, adapted, adapted_with_drive, at, in_finer_steps};
pub(crate) use effects::add_scaled;
pub use effects::{AddError, Addition, OwnLaw, OwnNumber, RemoveError, add, add_law, remove};
pub use enlarged::enlarges;
pub(crate) use guesses::{GAINS_GUESS, SERVO_GUESS};
pub(crate) use parameters_of::with_parameters_of;
pub(crate) use paths::each_named_file;
pub use paths::{moved, named_files, relative_path};
pub(crate) use rigid_bodies::{StatedBody, with_bodies};
