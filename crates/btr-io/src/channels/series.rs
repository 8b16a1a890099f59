//! Assembles the series of a file into a log: names, units, torque-off intervals and readings marked as invalid.

use super::mapping::{Mapping, Switch};
use super::names::Meaning;
use crate::error::{IoError, Warning};
use btr_core::limits::{MOST_COLUMNS, MOST_VALUES};
use btr_core::log::Log;
use indexmap::IndexMap;
use std::path::Path;

/// One series of a file, under the file's own name for it.
pub(crate) struct NamedSeries {
    /// The file's name.
    pub(crate) source: String,
    /// Its channel, unit and role.
    pub(crate) meaning: Meaning,
    /// In the file's unit, one per tick.
    pub(crate) values: Vec<f64>,
}

#[cfg(any(feature = "mcap", feature = "parquet"))]
impl Mapping {
    /// A series with the meaning of its name: from the mapping, or as one of btr's names.
    pub(crate) fn series(&self, source: String, values: Vec<f64>) -> NamedSeries {
        let meaning = self.meaning(&source).unwrap_or_else(|| Meaning::of(source.clone()));
        NamedSeries { source, meaning, values }
    }
}

/// Builds a log from series with a common clock.
pub(crate) fn assemble(
    path: &Path,
    clock_s: Vec<f64>,
    mut series: Vec<NamedSeries>,
    mapping: &Mapping,
) -> Result<(Log, Vec<Warning>), IoError> {
    let warnings = unused(mapping, &series);
    check_names(path, &series)?;
    let switches = switches(mapping, &series);
    for (switched, index, switch) in &switches {
        let states = series[*index].values.clone();
        let samples = series[*switched].values.iter_mut().zip(states);
        samples.filter(|(_, state)| !switch.lets_pass(*state)).for_each(|(value, _)| *value = f64::NAN);
    }
    let failed = |source| IoError::Log { path: path.to_owned(), source };
    let mut log = Log::new(clock_s).map_err(failed)?;
    for (i, s) in series.into_iter().enumerate() {
        if switches.iter().any(|(_, index, _)| *index == i) {
            continue;
        }
        let Meaning { name, unit, role, factor } = s.meaning;
        let values = s.values.into_iter().map(|v| v * factor).collect();
        log.insert(name, unit, role, values).map_err(failed)?;
    }
    Ok((log, warnings))
}

/// The switched series, the 0/1 series that switch them, and how.
fn switches(mapping: &Mapping, series: &[NamedSeries]) -> Vec<(usize, usize, Switch)> {
    let of = |(i, one): (usize, &NamedSeries)| {
        let switches = mapping.switches_of(&one.meaning.name, one.meaning.role).into_iter();
        let found = switches.filter_map(|switch| {
            let index = series.iter().position(|other| other.source == switch.name)?;
            Some((i, index, switch))
        });
        found.collect::<Vec<_>>()
    };
    series.iter().enumerate().flat_map(of).collect()
}

/// Checks that a log of this size may be kept.
///
/// # Errors
/// [`IoError::TooMany`], with the limit.
pub(crate) fn check_size(path: &Path, samples: usize, columns: usize) -> Result<(), IoError> {
    let too_many = |what, most| Err(IoError::TooMany { path: path.to_owned(), what, most });
    match () {
        () if columns > MOST_COLUMNS => too_many("columns", MOST_COLUMNS),
        () if samples.saturating_mul(columns) > MOST_VALUES => too_many("values", MOST_VALUES),
        () => Ok(()),
    }
}

fn check_names(path: &Path, series: &[NamedSeries]) -> Result<(), IoError> {
    let mut known: IndexMap<&str, &NamedSeries> = IndexMap::with_capacity(series.len());
    for second in series {
        if let Some(first) = known.insert(&second.meaning.name, second) {
            return Err(IoError::Twice {
                path: path.to_owned(),
                channel: second.meaning.name.clone(),
                first: first.source.clone(),
                second: second.source.clone(),
            });
        }
    }
    Ok(())
}

/// Names of the mapping that are missing in the log. A log in btr's own names (a simulated one) has no foreign names,
/// so a mapping without any match gives no warnings, but for columns that mark readings.
fn unused(mapping: &Mapping, series: &[NamedSeries]) -> Vec<Warning> {
    let named = mapping.channels.iter().map(|(ours, theirs)| (ours.as_str(), theirs.name()));
    let mut expected: Vec<(&str, &str)> = named.filter(|(_, theirs)| !theirs.contains("{joint}")).collect();
    expected.extend(mapping.switch_names().filter(|(_, name)| !name.contains("{joint}")));
    let has = |theirs: &str| series.iter().any(|s| s.source == theirs);
    let foreign = series.iter().any(|s| mapping.meaning(&s.source).is_some());
    // Without marks, all readings count, the bad ones too.
    let marks = |ours: &str| ["valid", "suspect"].contains(&ours);
    let missing = expected.into_iter().filter(|(ours, theirs)| !has(theirs) && (foreign || marks(ours)));
    missing.map(|(ours, theirs)| Warning::MappingUnused { ours: ours.to_owned(), theirs: theirs.to_owned() }).collect()
}
