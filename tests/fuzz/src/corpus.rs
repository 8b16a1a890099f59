//! The inputs from which mutations begin: files in `corpus/TARGET`, and what is better made than stored.

use crate::targets::{PENDULUM, runs, workers};
use crate::{SEPARATOR, folder::Folder};
use btr_core::log::{Log, LogError, Role};
use btr_io::{Meta, write_log};
use std::path::Path;

/// The corpus of a target, in the order of its files' names.
pub fn seeds(name: &str) -> Vec<Vec<u8>> {
    let entries = std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(name));
    let mut paths: Vec<_> = entries.into_iter().flatten().flatten().map(|entry| entry.path()).collect();
    paths.sort();
    let stored = paths.iter().filter_map(|path| std::fs::read(path).ok());
    stored.chain(made(name)).collect()
}

fn made(name: &str) -> Vec<Vec<u8>> {
    match name {
        "csv" => vec![b"1,".repeat(10_001)],
        "mcap" => {
            vec![written("log.mcap"), recording(&[joint_state(&[0.1])]), recording(&many_joint_states()), claim()]
        }
        "cdr" => {
            vec![topic(b'0', &joint_state(&[0.1])), topic(b'0', &joint_state(&[0.1, 0.2])), topic(b'3', &numbers())]
        }
        "model" => vec![[PENDULUM.as_bytes(), deep("[", "]").as_slice()].concat()],
        "urdf" => vec![[b"<robot name=\"r\">", deep("<a>", "</a>").as_slice(), b"</robot>"].concat()],
        "formula" => vec![[b"0", deep("(", ")").as_slice()].concat()],
        "real_test" => vec![[b"", SEPARATOR, &written("log.mcap")].concat()],
        "checkpoint" => runs::checkpoint_seeds(),
        "worker" => workers::worker_seeds(),
        "answer" => workers::answer_seeds(),
        _ => Vec::new(),
    }
}

/// Brackets or elements inside each other.
fn deep(open: &str, close: &str) -> Vec<u8> {
    [open.repeat(20_000), close.repeat(20_000)].concat().into_bytes()
}

/// A log of the pendulum.
fn swing() -> Result<Log, LogError> {
    let clock: Vec<f64> = (0..30).map(|k| 0.01 * f64::from(k)).collect();
    let mut log = Log::new(clock.clone())?;
    log.insert("cmd_hinge", "rad", Role::Command, clock.iter().map(|t| (8.0 * t).sin()).collect())?;
    log.insert("q_hinge", "rad", Role::Measured, clock.iter().map(|t| 0.9 * (8.0 * t - 0.2).sin()).collect())?;
    Ok(log)
}

/// The bytes of a log as btr writes it.
fn written(name: &str) -> Vec<u8> {
    let folder = Folder::new();
    let path = folder.path().join(name);
    let written = swing().is_ok_and(|log| write_log(&path, &log, &Meta::default()).is_ok());
    written.then(|| std::fs::read(&path).ok()).flatten().unwrap_or_default()
}

/// A record of an MCAP file.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode], &(body.len() as u64).to_le_bytes()[..], body].concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

/// Messages of `/joint_states`, 10 ms apart, in an MCAP file without any checksum: damage reaches the readers.
fn recording(messages: &[Vec<u8>]) -> Vec<u8> {
    let schema = [&[1, 0][..], &text("sensor_msgs/msg/JointState"), &text("ros2msg"), &[0; 4]].concat();
    let channel = [&[0, 0, 1, 0][..], &text("/joint_states"), &text("cdr"), &[0; 4]].concat();
    let message = |(k, data): (u64, &Vec<u8>)| {
        let time = (10_000_000 * k).to_le_bytes();
        record(5, &[&[0; 6][..], &time, &time, data].concat())
    };
    let messages: Vec<u8> = (0..).zip(messages).flat_map(message).collect();
    let begin = [MAGIC, &record(1, &[text(""), text("")].concat()), &record(3, &schema), &record(4, &channel)].concat();
    [&begin[..], &messages, &record(15, &[0; 4]), &record(2, &[0; 20]), MAGIC].concat()
}

const MAGIC: &[u8] = b"\x89MCAP0\r\n";

/// A schema whose name claims 4 GB.
fn claim() -> Vec<u8> {
    [MAGIC, &record(3, &[&[1, 0][..], &u32::MAX.to_le_bytes(), b"abcdefgh"].concat())].concat()
}

/// A `sensor_msgs/msg/JointState` of one joint, in CDR.
fn joint_state(position: &[f64]) -> Vec<u8> {
    // The stamp, an empty frame, one name ("hinge" and its end take 6 bytes).
    let head: [&[u8]; 4] = [&[0; 8], &[1, 0, 0, 0, 0, 0, 0, 0], &[1, 0, 0, 0, 6, 0, 0, 0], b"hinge\0\0\0"];
    let count = (position.len() as u32).to_le_bytes();
    let numbers: Vec<u8> = position.iter().flat_map(|x| x.to_le_bytes()).collect();
    // Numbers of 8 bytes lie at multiples of 8.
    [&[0, 1, 0, 0][..], &head.concat(), &count, &[0; 4], &numbers, &[0; 8]].concat()
}

fn many_joint_states() -> Vec<Vec<u8>> {
    (0..30).map(|k| joint_state(&[0.01 * f64::from(k)])).collect()
}

/// A `std_msgs/msg/Float64MultiArray` of two numbers, in CDR.
fn numbers() -> Vec<u8> {
    [&[0, 1, 0, 0][..], &[0; 8], &[2, 0, 0, 0], &[0; 4], &1.0_f64.to_le_bytes(), &2.0_f64.to_le_bytes()].concat()
}

fn topic(number: u8, message: &[u8]) -> Vec<u8> {
    [&[number], message].concat()
}
