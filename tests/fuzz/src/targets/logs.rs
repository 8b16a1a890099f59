//! Logs: what is read is checked as `btr check` does.

use super::{FEW_STEPS, PENDULUM, names_a_file};
use crate::files;
use crate::folder::Folder;
use btr_core::log::Log;
use btr_io::{Mapping, Recording, Warning, read_log};
use btr_lab::experiment::{LogSource, Source, replays};
use btr_lab::verbs::check;
use std::path::{Path, PathBuf};

/// A log as CSV.
pub fn csv(data: &[u8]) -> bool {
    file("log.csv", data)
}

/// A log as MCAP.
pub fn mcap(data: &[u8]) -> bool {
    file("log.mcap", data)
}

fn file(name: &str, data: &[u8]) -> bool {
    let folder = Folder::new();
    read(&folder.write(name, data), &folder)
}

/// The topics of messages, by the number that is their first byte (a digit will do).
const TOPICS: [(&str, &str, &str); 8] = [
    ("/joint_states", "sensor_msgs/msg/JointState", "cdr"),
    ("/joint_commands", "sensor_msgs/msg/JointState", "cdr"),
    ("/imu", "sensor_msgs/msg/Imu", "cdr"),
    ("/numbers", "std_msgs/msg/Float64MultiArray", "cdr"),
    ("/joint_states", "sensor_msgs/msg/JointState", "json"),
    ("/joint_commands", "sensor_msgs/msg/JointState", "json"),
    ("/imu", "sensor_msgs/msg/Imu", "json"),
    ("/joint_commands", "trajectory_msgs/msg/JointTrajectory", "cdr"),
];
const MOST_MESSAGES: usize = 8;

/// Messages in a recording, 10 ms apart.
pub fn cdr(data: &[u8]) -> bool {
    let mut mapping = Mapping::default();
    mapping.topics.arrays.insert("/numbers".to_owned(), vec!["q_hinge".to_owned(), "dq_hinge".to_owned()]);
    let mut recording = Recording::new(&mapping);
    for (id, (topic, schema, encoding)) in (0..).zip(TOPICS) {
        recording.topic(id, topic, schema, encoding, &Default::default());
    }
    for (k, message) in (0..).zip(files::<MOST_MESSAGES>(data)) {
        if let Some((topic, body)) = message.split_first() {
            recording.take(u16::from(*topic) % TOPICS.len() as u16, 10_000_000 * k, body);
        }
    }
    match recording.into_log(Path::new("bag")) {
        Ok((log, warnings)) => checked(log, &warnings),
        Err(error) => {
            assert!(error.to_string().contains("bag"), "{error}");
            false
        }
    }
}

/// A LeRobot data set of one episode: `info.json` and the Parquet file.
pub fn lerobot(data: &[u8]) -> bool {
    let folder = Folder::new();
    let [info, frames] = files(data);
    folder.write("meta/info.json", info);
    folder.write("data/chunk-000/file-000.parquet", frames);
    read(folder.path(), &folder)
}

fn read(path: &Path, folder: &Folder) -> bool {
    match read_log(path, &Mapping::default()) {
        Ok((log, warnings)) => checked(log, &warnings),
        Err(error) => {
            names_a_file(&error.to_string(), folder);
            drop(error.help().to_string());
            false
        }
    }
}

/// True: the log was read, whatever the checks say.
fn checked(log: Log, warnings: &[Warning]) -> bool {
    warnings.iter().for_each(|warning| drop(warning.to_string()));
    let mut source = Source::new("pendulum.toml", PENDULUM);
    let log = LogSource::InMemory { name: PathBuf::from("log"), log };
    match source.set(&[FEW_STEPS.to_owned()]).and_then(|()| replays(&source, &[log], &[])) {
        Ok(replays) => drop(check(replays).document().to_string()),
        Err(error) => drop(error.to_string()),
    }
    true
}
