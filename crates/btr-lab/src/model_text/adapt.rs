//! The adapted model as a file: the experiment's own text with the estimates written in, comments and all.

use super::paths::{anchor, with_schema};
use crate::experiment::{SimulationSection, Source};
use btr_core::space::Space;
use std::path::Path;
use toml_edit::{DocumentMut, Item, Table, TomlError};

/// Sections that steer a run and do not belong to a model.
const NOT_MODEL: [&str; 3] = ["reality", "coevolve", "distances"];

/// What a model is told and how it is judged; where nobody searched controllers, these are not part of a result.
const TASK: [&str; 2] = ["drive", "fitness"];

/// Said above the parameters of an adapted model.
const WHAT_WINS: &str = "# As fitted: these values win over those under [robot] and [actuators].";

/// The text of `source` as a model file in the folder `into`, whose parameters in doubt have the values of `s`.
///
/// # Errors
/// A file that is not TOML; it was read before, so this does not happen.
pub fn adapted(source: &Source, space: &Space, s: &[f64], into: &Path) -> Result<String, TomlError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    TASK.iter().for_each(|section| drop(document.remove(section)));
    Ok(model_text(document, source, (space, s), into))
}

/// The same with what the model is told and how it is judged. The drive is that of `controller`, a point of C with its space,
/// and searches nothing; without a controller it stays as it is.
///
/// # Errors
/// See [`adapted`].
pub fn adapted_with_drive(
    source: &Source,
    simulation: (&Space, &[f64]),
    controller: Option<(&Space, &[f64])>,
    into: &Path,
) -> Result<String, TomlError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    if let Some((space, c)) = controller {
        fix_drive(&mut document, named(space, c));
    }
    Ok(model_text(document, source, simulation, into))
}

/// A document as a model file in the folder `into`, with these values of what is in doubt.
fn model_text(mut document: DocumentMut, source: &Source, (space, s): (&Space, &[f64]), into: &Path) -> String {
    NOT_MODEL.iter().for_each(|section| drop(document.remove(section)));
    anchor(&mut document, source.folder(), into);
    write_values(&mut document, named(space, s));
    say_what_wins(&mut document);
    with_schema(&document.to_string(), source.folder(), into)
}

/// The numbers of a point with their names.
fn named<'a>(space: &'a Space, point: &'a [f64]) -> impl Iterator<Item = (&'a str, f64)> {
    space.dims().iter().map(|dim| dim.name.as_str()).zip(point.iter().copied())
}

/// Fixes what a drive searched, beside what it had fixed.
fn fix_drive<'a>(document: &mut DocumentMut, values: impl Iterator<Item = (&'a str, f64)>) {
    let Some(drive) = document.get_mut("drive").and_then(|drive| drive.as_table_like_mut()) else { return };
    for key in ["search", "start_from_nominal"] {
        drive.remove(key);
    }
    let mut values = values.peekable();
    if values.peek().is_none() {
        return;
    }
    let mut set = Table::new();
    let fixed = drive.remove("set");
    let fixed = fixed.iter().filter_map(|set| set.as_table_like()).flat_map(|set| set.iter());
    fixed.for_each(|(name, value)| drop(set.insert(name, value.clone())));
    values.for_each(|(name, value)| drop(set.insert(name, toml_edit::value(value))));
    drive.insert("set", Item::Table(set));
}

/// The text of a file of whose parameters in doubt these have other values; all else is as it was.
///
/// # Errors
/// See [`adapted`].
pub fn at<'a>(text: &str, values: impl IntoIterator<Item = (&'a str, f64)>) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    write_values(&mut document, values);
    Ok(document.to_string())
}

fn write_values<'a>(document: &mut DocumentMut, values: impl IntoIterator<Item = (&'a str, f64)>) {
    for (name, value) in values {
        let Some(parameter) = document["parameters"].get_mut(name) else { continue };
        if let Some(parameter) = parameter.as_table_like_mut() {
            parameter.insert("value", toml_edit::value(value));
        }
        if let Some(inline) = parameter.as_inline_table_mut() {
            inline.fmt();
        }
    }
}

/// Whoever reads an actuator's gain in an adapted model must know that another one holds.
fn say_what_wins(document: &mut DocumentMut) {
    let Some(parameters) = document.get_mut("parameters").and_then(|item| item.as_table_mut()) else { return };
    let before = parameters.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or("\n").to_owned();
    if !before.contains(WHAT_WINS) {
        parameters.decor_mut().set_prefix(format!("{before}{WHAT_WINS}\n"));
    }
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
}
