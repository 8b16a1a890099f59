//! The adapted model as a file: the experiment's text with the estimates written in and its comments kept.

use super::guesses::forget_guesses;
use super::in_place::write_in_place;
use super::paths::{anchor, with_schema};
use super::patterns::spell_out;
use crate::experiment::{SimulationSection, Source, USUAL_STEPS};
use btr_core::space::{Dim, Space};
use btr_physics::model::Model;
use btr_physics::setup::Setup;
use std::path::Path;
use toml_edit::{DocumentMut, Item, Table, TomlError, Value};

/// Sections that control a run and do not belong to a model.
const NOT_MODEL: [&str; 3] = ["reality", "coevolve", "distances"];

/// Sections for the drive and its fitness; not part of the result if no controllers were searched.
const TASK: [&str; 2] = ["drive", "fitness"];

/// Comment above the parameters of an adapted model.
const PRECEDENCE: &str =
    "# As fitted: a value here wins over the same one in another section, and is where the next fit begins.";

/// A free parameter of a model file.
#[derive(Clone, Copy, Debug)]
pub struct FittedValue<'a> {
    /// Its name.
    pub name: &'a str,
    /// Its value.
    pub value: f64,
    /// Standard deviation of the value, where it is known.
    pub sd: Option<f64>,
}

impl<'a> From<(&'a str, f64)> for FittedValue<'a> {
    fn from((name, value): (&'a str, f64)) -> Self {
        FittedValue { name, value, sd: None }
    }
}

/// The text of `source` as a model file in the folder `into`, with the free parameters of its model at these values, by
/// name: in `[parameters]`, and where the file states them.
///
/// # Errors
/// A file that is not TOML; it was read before, so this does not happen.
pub fn adapted<'a>(
    source: &Source,
    model: &Model,
    values: impl IntoIterator<Item = FittedValue<'a>>,
    into: &Path,
) -> Result<String, TomlError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    TASK.iter().for_each(|section| drop(document.remove(section)));
    Ok(model_text(document, (source, model), values, into))
}

/// The same with the sections for the drive and its fitness. The drive is fixed at `controller`, a point of C with its
/// space; without a controller it stays unchanged.
///
/// # Errors
/// See [`adapted`].
pub fn adapted_with_drive(
    source: &Source,
    model: &Model,
    simulation: &[f64],
    controller: Option<SpacePoint>,
    into: &Path,
) -> Result<String, TomlError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    if let Some(controller) = controller {
        fix_drive(&mut document, controller.named());
    }
    let simulation = SpacePoint { space: &model.simulations, point: simulation };
    Ok(model_text(document, (source, model), simulation.named().map(FittedValue::from), into))
}

/// A document as a model file in the folder `into`, with these values of the free parameters.
fn model_text<'a>(
    mut document: DocumentMut,
    (source, model): (&Source, &Model),
    values: impl IntoIterator<Item = FittedValue<'a>>,
    into: &Path,
) -> String {
    NOT_MODEL.iter().for_each(|section| drop(document.remove(section)));
    anchor(&mut document, source.folder(), into);
    let values: Vec<FittedValue> = values.into_iter().collect();
    write_values(&mut document, model, values.iter().map(|of| (of.name, of.value)));
    values.iter().for_each(|of| write_key(&mut document, of.name, "sd", of.sd.map(Value::from)));
    note_precedence(&mut document);
    with_schema(&document.to_string(), source.folder(), into)
}

/// A point with its space.
#[derive(Clone, Copy)]
pub struct SpacePoint<'a> {
    /// The space.
    pub space: &'a Space,
    /// A point of it, in physical units.
    pub point: &'a [f64],
}

impl<'a> SpacePoint<'a> {
    /// The values with their names.
    fn named(self) -> impl Iterator<Item = (&'a str, f64)> {
        self.space.dims().iter().map(|dim| dim.name.as_str()).zip(self.point.iter().copied())
    }
}

/// Fixes the searched parameters of a drive in addition to those that were already fixed.
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

/// The text of a model's file with other values of these free parameters. Their standard deviations belong to the
/// values before and are removed; everything else is unchanged.
///
/// # Errors
/// See [`adapted`].
pub fn at<'a>(
    text: &str,
    model: &Model,
    values: impl IntoIterator<Item = (&'a str, f64)>,
) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    let values: Vec<(&str, f64)> = values.into_iter().collect();
    write_values(&mut document, model, values.iter().copied());
    values.iter().for_each(|(name, _)| write_key(&mut document, name, "sd", None));
    Ok(document.to_string())
}

/// Writes values of free parameters, each where the file states it and in `[parameters]`, so that the two agree.
fn write_values<'a>(document: &mut DocumentMut, model: &Model, values: impl IntoIterator<Item = (&'a str, f64)>) {
    spell_out(document, &model.simulations);
    let mut fitted = Vec::new();
    for (name, value) in values {
        if write_in_place(document, &model.robot, name, value)
            && let Some(k) = model.simulations.index_of(name)
        {
            keep_bounds(document, &model.simulations.dims()[k], value);
        }
        include(document, name, value);
        write_key(document, name, "value", Some(value.into()));
        fitted.push(name);
    }
    forget_guesses(document, &model.robot, &fitted);
}

/// Widens bounds that a value exceeds: bounds have two digits, and an effect that is off at infinity is searched up to
/// there.
fn include(document: &mut DocumentMut, name: &str, value: f64) {
    let entry = document["parameters"].get_mut(name).and_then(Item::as_table_like_mut);
    let Some(bounds) = entry.and_then(|entry| entry.get_mut("bounds")).and_then(Item::as_array_mut) else { return };
    let stated = |k: usize| bounds.get(k).and_then(|x| x.as_float().or_else(|| x.as_integer().map(|x| x as f64)));
    let (Some(least), Some(most)) = (stated(0), stated(1)) else { return };
    if value < least {
        bounds.replace(0, value);
    } else if value > most {
        bounds.replace(1, value);
    }
}

/// Bounds relative to a value that the file no longer states, as they were.
fn keep_bounds(document: &mut DocumentMut, dim: &Dim, value: f64) {
    let Some(entry) = document["parameters"].get_mut(&dim.name).and_then(Item::as_table_like_mut) else { return };
    if !entry.contains_key("relative") {
        return;
    }
    let bounds = [dim.min, dim.max].map(|bound| {
        let short = shortened(bound);
        if (short <= value) == (bound <= value) && (short >= value) == (bound >= value) { short } else { bound }
    });
    let bounds = Item::Value(Value::Array(bounds.into_iter().collect()));
    let keys: Vec<(String, Item)> = entry.iter().map(|(key, item)| (key.to_owned(), item.clone())).collect();
    entry.clear();
    for (key, item) in keys {
        let (key, item) = if key == "relative" { ("bounds", bounds.clone()) } else { (key.as_str(), item) };
        entry.insert(key, item);
    }
}

/// Twelve digits, without those that a product of two decimal numbers adds.
fn shortened(x: f64) -> f64 {
    format!("{x:.11e}").parse().unwrap_or(x)
}

/// Writes a key of a free parameter, or removes it.
fn write_key(document: &mut DocumentMut, name: &str, key: &str, value: Option<Value>) {
    let Some(parameter) = document["parameters"].get_mut(name) else { return };
    if let Some(parameter) = parameter.as_table_like_mut() {
        match value {
            Some(value) => drop(parameter.insert(key, toml_edit::value(value))),
            None => drop(parameter.remove(key)),
        }
    }
    if let Some(inline) = parameter.as_inline_table_mut() {
        inline.fmt();
    }
}

/// Adds a comment that the fitted values override those under `[robot]` and `[actuators]`.
fn note_precedence(document: &mut DocumentMut) {
    let Some(parameters) = document.get_mut("parameters").and_then(|item| item.as_table_mut()) else { return };
    let before = parameters.decor().prefix().and_then(|prefix| prefix.as_str()).unwrap_or("\n").to_owned();
    if !before.contains(PRECEDENCE) {
        parameters.decor_mut().set_prefix(format!("{before}{PRECEDENCE}\n"));
    }
}

/// The text of the model's file with each time step divided into `times`; the sampling times are unchanged.
///
/// # Errors
/// See [`adapted`].
pub fn in_finer_steps(text: &str, model: &Setup, times: u32) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    let simulation = document.entry("simulation").or_insert_with(toml_edit::table);
    // The logs' commands set the period where the file does not.
    let by_logs = simulation.get("control_s").is_none();
    let steps = if by_logs { (model.control_s / model.dt_s).round() as u32 } else { USUAL_STEPS };
    let every = SimulationSection::default().sample_every;
    for (key, default) in [("steps_per_control", steps), ("sample_every", every)] {
        let now = simulation.get(key).and_then(|item| item.as_integer()).unwrap_or(i64::from(default));
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
    fn bounds_include_the_value_and_are_else_as_they_were() {
        let after = |value: f64| {
            let text = "[parameters]\n\"limit@hip\" = { bounds = [0.5, 100], value = 1.5 } # N·m\n";
            let mut document = text.parse::<DocumentMut>().unwrap();
            include(&mut document, "limit@hip", value);
            include(&mut document, "absent", value);
            let bounds = document["parameters"]["limit@hip"]["bounds"].to_string();
            (bounds.trim().to_owned(), document.to_string() == text)
        };
        assert_eq!(after(20.0), ("[0.5, 100]".to_owned(), true));
        assert_eq!(after(835.2), ("[0.5, 835.2]".to_owned(), false));
        assert_eq!(after(0.25), ("[0.25, 100]".to_owned(), false));
    }

    #[test]
    fn finer_steps_are_sampled_at_the_same_times() {
        let setup = Setup { control_s: 0.01, dt_s: 0.0025, ..Setup::default() };
        let finer = in_finer_steps("[simulation]\nsteps_per_control = 10 # 1 ms\n", &setup, 4).unwrap();
        assert_eq!(finer, "[simulation]\nsteps_per_control = 40\nsample_every = 4\n");
        let steps = |text: &str| in_finer_steps(text, &setup, 2).unwrap();
        assert!(steps("name = \"arm\"\n").contains("steps_per_control = 8"));
        assert!(steps("[simulation]\ncontrol_s = 0.02\n").contains("steps_per_control = 14"));
    }
}
