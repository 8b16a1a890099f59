//! Writes a log in the names and units of foreign logs: the inverse of reading by a mapping.

use super::mapping::Mapping;
use super::names::header;
use btr_core::log::{Log, LogError};

/// The log whose CSV file, read by the mapping, is this log again; its columns have the mapping's names and units where
/// a header can carry them, and btr's otherwise.
///
/// # Errors
/// Two channels of one foreign name, whose lengths differ.
pub(crate) fn foreign(log: &Log, mapping: &Mapping) -> Result<Log, LogError> {
    let second = mapping.seconds_per_unit("t").recip();
    let mut written = Log::new(log.clock_s().iter().map(|t| t * second).collect())?;
    for (ours, channel) in log.channels() {
        let theirs = mapping.theirs(ours).map(|(_, theirs)| theirs);
        let theirs = theirs.filter(|theirs| header(theirs).as_ref() == Some(theirs));
        let name = theirs.unwrap_or_else(|| ours.to_owned());
        let factor =
            mapping.meaning(&name).filter(|meaning| meaning.name == ours).map_or(1.0, |meaning| meaning.factor);
        let values = channel.values.iter().map(|value| value / factor).collect();
        written.insert(name, channel.unit.clone(), channel.role, values)?;
    }
    Ok(written)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::{Meta, as_mapped, read_log, write_log};
    use btr_core::log::Role;

    /// Commands of two joints, one of them switched off at the end.
    fn commands() -> Log {
        let mut log = Log::new(vec![0.0, 0.5, 1.0]).unwrap();
        log.insert("cmd_hip", "rad", Role::Command, vec![0.0, 0.25, -1.5]).unwrap();
        log.insert("cmd_knee", "rad", Role::Command, vec![0.5, 1.0, f64::NAN]).unwrap();
        log
    }

    /// What a file holds, and whether it is read as the commands again.
    fn round_trip(mapping: &str, file: &str) -> Log {
        let mapping: Mapping = toml::from_str(mapping).unwrap();
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(file);
        write_log(&path, &as_mapped(&path, &commands(), &mapping).unwrap(), &Meta::default()).unwrap();
        let (read, _) = read_log(&path, &mapping).unwrap();
        for (name, channel) in commands().channels() {
            let near = |(a, b): (&f64, &f64)| (a - b).abs() < 1e-12 || a.is_nan() && b.is_nan();
            assert!(read.values(name).unwrap().iter().zip(&channel.values).all(near), "{name} in {file}");
        }
        assert_eq!(read.clock_s(), commands().clock_s());
        read_log(&path, &Mapping::default()).unwrap().0
    }

    const DEGREES: &str = r#"channels = { "cmd_{joint}" = { column = "cmd_{joint}", factor = 0.017453292519943295 } }"#;

    #[test]
    fn commands_are_read_back_by_the_mapping_they_were_written_for() {
        let raw = round_trip(DEGREES, "drive.csv");
        assert!((raw.values("cmd_hip").unwrap()[2] + 85.94).abs() < 0.01, "in degrees");
        let renamed = r#"channels = { "cmd_{joint}" = { column = "{joint}_goal", factor = -0.5 } }"#;
        assert!(round_trip(renamed, "drive.csv").channel("knee_goal").is_some());
        round_trip(r#"channels = { cmd_hip = "hip_goal_deg", cmd_knee = "q_cmd_knee" }"#, "drive.csv");
        let millis = round_trip("time_unit = \"ms\"", "drive.csv");
        assert_eq!(millis.clock_s()[1].to_bits(), 500.0_f64.to_bits());
        // What btr writes has seconds in `t`, where other logs have a column of another name.
        let named = round_trip("time = \"t [ms]\"\ntime_unit = \"ms\"", "drive.csv");
        assert_eq!(named.clock_s()[1].to_bits(), 0.5_f64.to_bits());
    }

    #[test]
    fn swapped_joints_are_swapped_back() {
        round_trip(r#"channels = { cmd_hip = "cmd_knee", cmd_knee = "cmd_hip" }"#, "drive.csv");
    }

    #[cfg(feature = "mcap")]
    #[test]
    fn btr_s_own_messages_need_no_mapping() {
        round_trip(DEGREES, "drive.mcap");
        round_trip(r#"channels = { cmd_hip = "cmd_knee", cmd_knee = "cmd_hip" }"#, "drive.mcap");
        round_trip(r#"channels = { "cmd_{joint}" = { column = "{joint}_goal", factor = -0.5 } }"#, "drive.mcap");
    }
}
