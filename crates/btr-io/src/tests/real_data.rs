//! Recordings of real machines, when they are there: `BTR_DATA`, or `shared/data` beside the workspace.

use super::*;
use std::fs;
use std::path::PathBuf;

fn data() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data");
    let folder = std::env::var_os("BTR_DATA").map_or_else(beside, PathBuf::from);
    if folder.is_dir() {
        return Some(folder);
    }
    println!("skipped: data not there ({})", folder.display());
    None
}

/// Reads every recording of a folder.
fn read_all(folder: &Path, mapping: &str) -> Vec<(String, Log)> {
    let mapping = toml::from_str(mapping).unwrap();
    let mut files: Vec<PathBuf> = fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    let read = |path: PathBuf| {
        let (log, warnings) = read_log(&path, &mapping).unwrap();
        assert_eq!(warnings, [], "{}", path.display());
        (path.file_name().unwrap().to_string_lossy().into_owned(), log)
    };
    files.into_iter().map(read).collect()
}

#[test]
fn pendulum_recordings_are_read_with_their_torque_off_spells() {
    let Some(data) = data() else { return };
    let mapping = r#"
        time = "t_s"
        torque_on = "torque_on"
        channels = { cmd_motor = "q_cmd_rad", q_motor = "q_rad", dq_motor = "dq_rad_s" }
    "#;
    let logs = read_all(&data.join("bam_xl330_pendulum/episodes"), mapping);
    assert_eq!(logs.len(), 20);
    let (_, log) = logs.iter().find(|(name, _)| name == "xl330_lift_and_drop_kp100.csv").unwrap();
    assert_eq!(log.len(), 1510);
    // The index that comes with the recordings gives the share of time with torque on as 0.246.
    let on = log.values("cmd_motor").unwrap().iter().filter(|x| !x.is_nan()).count();
    assert!((on as f64 / 1510.0 - 0.246).abs() < 5e-4, "{on}");
}

#[test]
fn positioning_system_recordings_are_read_in_metres() {
    let Some(data) = data() else { return };
    let logs = read_all(&data.join("emps/episodes"), r#"channels = { cmd_slider = "q_ref_m", q_slider = "q_m" }"#);
    assert_eq!(logs.iter().map(|(_, log)| log.len()).collect::<Vec<_>>(), [24841, 24841]);
    assert!(logs.iter().all(|(_, log)| log.channel("q_slider").unwrap().unit == "m"));
}

#[test]
fn arm_recordings_are_read_without_a_mapping_and_compressed() {
    let Some(data) = data() else { return };
    for folder in ["sage_so101/episodes", "sage_so101/episodes_more"] {
        let logs = read_all(&data.join(folder), "");
        assert!(!logs.is_empty());
        for (name, log) in logs {
            assert!(log.values("cmd_Elbow").unwrap().iter().all(|x| x.is_finite()), "{name}");
        }
    }
}
