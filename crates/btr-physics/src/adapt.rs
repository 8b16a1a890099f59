//! The adapted model as a file: the experiment's own text with the estimates written in, comments and all.

use crate::experiment::{SimulationSection, Source};
use btr_core::space::Space;
use std::path::Path;
use toml_edit::{DocumentMut, TomlError, Value};

/// Sections that steer a run and do not belong to a model.
const NOT_MODEL: [&str; 5] = ["reality", "coevolve", "drive", "fitness", "distances"];

/// Where a file names other files, relative to its own folder: one, or a list.
const NAMES_FILES: [(&str, &str); 6] = [
    ("robot", "urdf"),
    ("logs", "index"),
    ("drive", "log"),
    ("reality", "index"),
    ("reality", "files"),
    ("reality", "held_out"),
];

/// The text of `source` as a model file whose parameters in doubt have the values of `s`.
///
/// # Errors
/// A file that is not TOML; it was read before, so this does not happen.
pub fn adapted(source: &Source, space: &Space, s: &[f64]) -> Result<String, TomlError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    for section in NOT_MODEL {
        document.remove(section);
    }
    anchor(&mut document, source.folder());
    for (dim, value) in space.dims().iter().zip(s) {
        if let Some(parameter) = document["parameters"].get_mut(&dim.name).and_then(|item| item.as_table_like_mut()) {
            parameter.insert("value", toml_edit::value(*value));
        }
    }
    Ok(document.to_string())
}

/// The text of a model file with a finer time step: so many where there was one, sampled as before.
///
/// # Errors
/// See [`adapted`].
pub fn in_finer_steps(text: &str, times: u32) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    let usual = SimulationSection::default();
    let simulation = document.entry("simulation").or_insert_with(toml_edit::table);
    for (key, usual) in [("steps_per_control", usual.steps_per_control), ("sample_every", usual.sample_every)] {
        let now = simulation.get(key).and_then(|item| item.as_integer()).unwrap_or(i64::from(usual));
        if let Some(table) = simulation.as_table_like_mut() {
            table.insert(key, toml_edit::value(now * i64::from(times)));
        }
    }
    Ok(document.to_string())
}

/// The text of a model file that lies in `folder`, for a file that will lie elsewhere.
///
/// # Errors
/// A text that is not TOML.
pub fn moved(text: &str, folder: &Path) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    anchor(&mut document, folder);
    Ok(document.to_string())
}

/// Makes the paths in a document, relative to `folder`, absolute.
fn anchor(document: &mut DocumentMut, folder: &Path) {
    let absolute = |value: &mut Value| {
        let Some(path) = value.as_str().map(|path| folder.join(path)) else { return };
        let path = std::path::absolute(&path).unwrap_or(path);
        let decor = value.decor().clone();
        *value = path.to_string_lossy().into_owned().into();
        *value.decor_mut() = decor;
    };
    for (section, key) in NAMES_FILES {
        let item = document.get_mut(section).and_then(|section| section.get_mut(key));
        match item.and_then(|item| item.as_value_mut()) {
            Some(Value::Array(list)) => list.iter_mut().for_each(absolute),
            Some(one) => absolute(one),
            None => {}
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn finer_steps_are_sampled_at_the_same_times() {
        let finer = in_finer_steps("[simulation]\nsteps_per_control = 10 # 1 ms\n", 4).unwrap();
        assert_eq!(finer, "[simulation]\nsteps_per_control = 40\nsample_every = 4\n");
        assert!(in_finer_steps("name = \"arm\"\n", 2).unwrap().contains("steps_per_control = 14"));
    }

    #[test]
    fn a_file_that_moves_takes_the_way_to_others_along() {
        let text = "[robot]\nurdf = \"arm.urdf\" # its shape\n[logs]\nindex = \"logs/index.csv\"\n\
                    [reality]\nfiles = [\"a.csv\", \"/b.csv\"]\n";
        let moved = moved(text, Path::new("/lab/robots")).unwrap();
        let wanted = "[robot]\nurdf = \"/lab/robots/arm.urdf\" # its shape\n[logs]\n\
                      index = \"/lab/robots/logs/index.csv\"\n\
                      [reality]\nfiles = [\"/lab/robots/a.csv\", \"/b.csv\"]\n";
        assert_eq!(moved, wanted);
    }
}
