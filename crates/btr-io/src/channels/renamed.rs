//! Renames the channels of logs in memory by a model's `[channels]`.

use super::mapping::Mapping;
use super::names::{Meaning, is_doubled};
use crate::channels::series::{NamedSeries, assemble};
use crate::error::{IoError, Warning};
use btr_core::log::{Channel, Log, Role};
use std::path::Path;

/// Renames foreign channels to btr's names by the mapping. Channels with btr's names are unchanged, so renaming is
/// idempotent.
///
/// # Errors
/// [`IoError::Twice`] for two foreign names of one channel.
pub fn renamed(name: &Path, log: Log, mapping: &Mapping) -> Result<(Log, Vec<Warning>), IoError> {
    let meanings: Vec<Option<Meaning>> = log.channels().map(|(theirs, _)| foreign(theirs, &log, mapping)).collect();
    let is_switched = |(name, channel): (&str, &Channel)| {
        mapping.switches_of(name, channel.role).iter().any(|switch| log.channel(&switch.name).is_some())
    };
    if meanings.iter().all(Option::is_none) && !log.channels().any(is_switched) {
        return Ok((log, Vec::new()));
    }
    let series = log.channels().zip(meanings).map(|((source, channel), meaning)| NamedSeries {
        source: source.to_owned(),
        meaning: meaning.unwrap_or_else(|| as_it_is(source, channel)),
        values: channel.values.clone(),
    });
    let (renamed, mut warnings) = assemble(name, log.clock_s().to_vec(), series.collect(), mapping)?;
    // A channel that already had its name is not missing.
    warnings
        .retain(|warning| !matches!(warning, Warning::MappingUnused { ours, .. } if renamed.channel(ours).is_some()));
    Ok((renamed, warnings))
}

/// The meaning of a channel with a foreign name; `None` for one of btr's names.
fn foreign(theirs: &str, log: &Log, mapping: &Mapping) -> Option<Meaning> {
    let meaning = mapping.meaning(theirs)?;
    let exists = log.channel(&meaning.name).is_some();
    let is_ours = is_doubled(&meaning.name) && Meaning::of(theirs.to_owned()).role != Role::Truth;
    (!exists && !is_ours).then_some(meaning)
}

fn as_it_is(name: &str, channel: &Channel) -> Meaning {
    Meaning { name: name.to_owned(), unit: channel.unit.clone().into(), role: channel.role, factor: 1.0 }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    fn log(channels: &[(&str, f64)]) -> Log {
        let columns = channels.iter().map(|(name, value)| ((*name).to_owned(), vec![*value; 2])).collect();
        crate::log_of(Path::new("log"), vec![0.0, 1.0], columns, &Mapping::default()).unwrap().0
    }

    fn under(mapping: &str, log: Log) -> Log {
        renamed(Path::new("log"), log, &toml::from_str(mapping).unwrap()).unwrap().0
    }

    fn first_values(log: &Log) -> Vec<(&str, f64)> {
        log.channels().map(|(name, channel)| (name, channel.values[0])).collect()
    }

    #[test]
    fn foreign_names_become_btrs_and_renaming_is_idempotent() {
        let mapping = r#"channels = { q_hip = "hip_deg", "cmd_{joint}" = { column = "{joint}_goal", factor = 2.0 } }"#;
        let once = under(mapping, log(&[("hip_deg", 180.0), ("hip_goal", 3.0), ("load", 4.0)]));
        assert_eq!(first_values(&once), [("q_hip", std::f64::consts::PI), ("cmd_hip", 6.0), ("load", 4.0)]);
        assert_eq!(once.channel("q_hip").unwrap().unit, "rad");
        assert_eq!(under(mapping, once.clone()), once);
    }

    #[test]
    fn btrs_names_are_unchanged() {
        let mine = log(&[("cmd_hip", 1.0), ("q_hip", 2.0), ("q_knee", 3.0)]);
        for mapping in [
            r#"channels = { "q_{joint}" = { column = "q_{joint}", factor = 0.5 } }"#,
            r#"channels = { "q_{joint}" = "{joint}", "cmd_{joint}" = "{joint}" }"#,
            r#"channels = { q_hip = "q_knee", q_knee = "q_hip" }"#,
            r#"channels = { "cmd_{joint}" = "q_cmd_{joint}", q_hip = "encoder" }"#,
        ] {
            assert_eq!(under(mapping, mine.clone()), mine, "{mapping}");
        }
    }

    #[test]
    fn a_switch_is_applied_and_removed() {
        let off = under(r#"torque_on = "on_{joint}""#, log(&[("cmd_hip", 1.0), ("q_hip", 2.0), ("on_hip", 0.0)]));
        assert!(off.channel("cmd_hip").unwrap().values[0].is_nan() && off.channel("on_hip").is_none());
    }

    #[test]
    fn readings_marked_as_invalid_are_missing() {
        let channels = [("cmd_hip", 1.0), ("q_hip", 2.0), ("q_knee", 3.0), ("ok", 0.0), ("bad_knee", 1.0)];
        let values = |mapping: &str| under(mapping, log(&channels));
        let missing = |log: &Log| {
            let gone = log.channels().filter(|(_, channel)| channel.values[0].is_nan());
            gone.map(|(name, _)| name.to_owned()).collect::<Vec<_>>()
        };
        assert_eq!(missing(&values(r#"valid = "ok""#)), ["q_hip", "q_knee"]);
        assert_eq!(missing(&values(r#"suspect = "bad_{joint}""#)), ["q_knee"]);
        assert!(values(r#"valid = "ok""#).channel("ok").is_none());
    }

    #[test]
    fn missing_names_are_warned_of_where_others_are_found() {
        let mapping: Mapping =
            toml::from_str(r#"channels = { q_hip = "hip", q_knee = "knee", q_toe = "toe" }"#).unwrap();
        let (_, warnings) = renamed(Path::new("log"), log(&[("hip", 1.0), ("q_knee", 1.0)]), &mapping).unwrap();
        assert_eq!(warnings, [Warning::MappingUnused { ours: "q_toe".into(), theirs: "toe".into() }]);
    }
}
