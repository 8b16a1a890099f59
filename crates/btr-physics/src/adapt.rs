//! The adapted model as a file: the experiment's own text with the estimates written in, comments and all.

use crate::experiment::Source;
use btr_core::space::Space;

/// Sections that steer a run and do not belong to a model.
const NOT_MODEL: [&str; 5] = ["reality", "coevolve", "drive", "fitness", "distances"];

/// The text of `source` as a model file whose parameters in doubt have the values of `s`.
///
/// # Errors
/// A file that is not TOML; it was read before, so this does not happen.
pub fn adapted(source: &Source, space: &Space, s: &[f64]) -> Result<String, toml_edit::TomlError> {
    let mut document = source.text.parse::<toml_edit::DocumentMut>()?;
    for section in NOT_MODEL {
        document.remove(section);
    }
    // The file will lie elsewhere.
    let urdf = document.get_mut("robot").and_then(|robot| robot.get_mut("urdf"));
    if let Some((urdf, path)) = urdf.and_then(|urdf| urdf.as_str().map(str::to_owned).map(|path| (urdf, path))) {
        let path = source.folder().join(path);
        let path = std::path::absolute(&path).unwrap_or(path);
        *urdf = toml_edit::value(path.to_string_lossy().into_owned());
    }
    for (dim, value) in space.dims().iter().zip(s) {
        if let Some(parameter) = document["parameters"].get_mut(&dim.name).and_then(|item| item.as_table_like_mut()) {
            parameter.insert("value", toml_edit::value(*value));
        }
    }
    Ok(document.to_string())
}
