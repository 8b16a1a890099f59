//! Files that a verb writes never take the place of those that it reads: a recording exists once.

use crate::failure::Failure;
use std::path::{Path, PathBuf};

/// Refuses to write over an input.
///
/// # Errors
/// An output that is one of the inputs, by whatever name.
pub(crate) fn apart<'a>(
    outputs: impl IntoIterator<Item = &'a Path>,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let inputs: Vec<PathBuf> = inputs.into_iter().filter_map(|input| input.canonicalize().ok()).collect();
    for output in outputs {
        if output.canonicalize().is_ok_and(|there| inputs.contains(&there)) {
            let message = format!("{} is read here and would be written over", output.display());
            return Err(Failure::new("output", message, Some("give the output another name".to_owned())));
        }
    }
    Ok(())
}
