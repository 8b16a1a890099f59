//! Files that claim more than they hold, or hold more than is read.

use super::own_mcap::{bytes, walk};
use super::*;
use ::mcap::records::op;
use btr_core::limits::{LONGEST_LINE, MOST_COLUMNS, MOST_VALUES};

/// An MCAP file of one record.
fn record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [::mcap::MAGIC, &[opcode], &(body.len() as u64).to_le_bytes(), body].concat()
}

fn complaint(file: &[u8]) -> String {
    mcap::read(Path::new("walk.mcap"), file, &Mapping::default()).unwrap_err().to_string()
}

#[test]
fn a_text_of_four_gigabytes_that_is_not_there_takes_no_memory() {
    let claim = [&u32::MAX.to_le_bytes()[..], b"abcdefgh"].concat();
    let lies =
        "walk.mcap: the file is damaged: before the first message: a text is longer than the record that holds it";
    assert_eq!(complaint(&record(op::SCHEMA, &[&[1, 0], &claim[..]].concat())), lies);
    assert_eq!(complaint(&record(op::CHANNEL, &[&[1, 0, 0, 0], &claim[..]].concat())), lies);
    let metadata = [&[1, 0, 0, 0][..], &[0; 8], &12_u32.to_le_bytes(), &claim].concat();
    assert_eq!(complaint(&record(op::CHANNEL, &metadata)), lies);
    // What is no data is not parsed at all.
    for opcode in [op::HEADER, op::METADATA] {
        let told = complaint(&record(opcode, &claim));
        assert!(!told.contains("a text is longer"), "{told}");
    }
}

#[test]
fn an_attachment_without_its_checksum_is_passed_over() {
    let mut file = bytes(&walk(3), &Meta::default());
    let attachment = &record(op::ATTACHMENT, &[0; 32])[::mcap::MAGIC.len()..];
    // The checksum of the data is not that of what is inserted; 0 is none.
    let end = [&[op::DATA_END][..], &4_u64.to_le_bytes()].concat();
    let at = file.windows(end.len()).position(|window| window == end).unwrap() + end.len();
    file[at..at + 4].fill(0);
    file.splice(::mcap::MAGIC.len()..::mcap::MAGIC.len(), attachment.iter().copied());
    assert_eq!(mcap::read(Path::new("walk.mcap"), &file[..], &Mapping::default()).unwrap().0, walk(3));
}

#[test]
fn every_message_with_a_joint_of_its_own_would_fill_the_memory() {
    let mapping = Mapping::default();
    let mut recording = Recording::new(&mapping);
    recording.topic(1, "/joint_states", "sensor_msgs/msg/JointState", "json", &Default::default());
    for k in 0..=MOST_COLUMNS {
        recording.take(1, k as u64, format!("{{\"name\": [\"j{k}\"], \"position\": [0]}}").as_bytes());
    }
    let told = recording.into_log(Path::new("bag")).unwrap_err().to_string();
    assert_eq!(told, format!("bag: more than {MOST_COLUMNS} columns, the most that is read"));
    // A channel has a value at every tick of the clock.
    let error = crate::channels::series::check_size(Path::new("bag"), MOST_VALUES / 100 + 1, 100).unwrap_err();
    assert_eq!(error.to_string(), format!("bag: more than {MOST_VALUES} values, the most that is read"));
}

#[test]
fn a_table_is_neither_too_wide_nor_one_endless_line() {
    let read = |text: &str| csv::read(Path::new("walk.csv"), text.as_bytes(), &Mapping::default());
    let wide = format!("t{}\n0{}\n", ",c".repeat(MOST_COLUMNS), ",1".repeat(MOST_COLUMNS));
    let told = read(&wide).unwrap_err().to_string();
    assert_eq!(told, format!("walk.csv: more than {MOST_COLUMNS} columns, the most that is read"));
    let endless = std::io::repeat(b'1');
    let error = csv::read(Path::new("walk.csv"), endless, &Mapping::default()).unwrap_err();
    assert_eq!(
        error.to_string(),
        format!("walk.csv: a line is longer than {} MB, the most that is read", LONGEST_LINE >> 20)
    );
}

#[test]
fn folders_and_devices_are_no_files() {
    let lab = tempfile::tempdir().unwrap();
    let told = |name: &str| read_log(&lab.path().join(name), &Mapping::default()).unwrap_err();
    std::fs::create_dir(lab.path().join("folder.csv")).unwrap();
    assert!(told("folder.csv").to_string().ends_with("folder.csv: a folder, where a file is read"));
    assert_eq!(told("folder.csv").help().to_string(), "name a regular file");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink("/dev/zero", lab.path().join("zero.csv")).unwrap();
        assert!(told("zero.csv").to_string().contains("zero.csv: a pipe or a device"));
        assert!(read_text(&lab.path().join("zero.csv")).is_err());
    }
}
