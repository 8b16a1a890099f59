//! MCAP files that btr wrote: cut anywhere, they give what is whole.

use super::*;
use ::mcap::MessageStream;
use ::mcap::read::{LinearReader, metadata};

/// A walk of `ticks` samples with everything that has a standard topic.
pub(super) fn walk(ticks: usize) -> Log {
    let mut log = Log::new((0..ticks).map(|i| 0.01 * i as f64).collect()).unwrap();
    let wave = |phase: f64| (0..ticks).map(|i| (0.1 * i as f64 + phase).sin()).collect::<Vec<f64>>();
    let names = [
        "cmd_hip",
        "cmd_knee",
        "q_hip",
        "q_knee",
        "dq_knee",
        "imu_acc_x",
        "imu_acc_y",
        "imu_acc_z",
        "imu_gyro_x",
        "imu_gyro_y",
        "imu_gyro_z",
    ];
    let base = ["base_x", "base_y", "base_z", "base_qx", "base_qy", "base_qz", "base_qw", "foot_l"];
    for (i, name) in names.into_iter().chain(base).enumerate() {
        let role = if name.starts_with("cmd_") { Role::Command } else { Role::Measured };
        log.insert(name, "1", role, wave(i as f64)).unwrap();
    }
    log
}

pub(super) fn bytes(log: &Log, meta: &Meta) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    mcap::write(log, meta, &mut out).unwrap();
    out.into_inner()
}

pub(super) fn read(bytes: &[u8]) -> Result<(Log, Vec<Warning>), IoError> {
    mcap::read(Path::new("walk.mcap"), bytes, &Mapping::default())
}

#[test]
fn standard_topics_meta_and_attachment_are_there() {
    let notes = [("seed".to_owned(), "7".to_owned())].into();
    let toml = Some("robot = \"ant\"\n".to_owned());
    let meta = Meta { urdf: Some("<robot/>".into()), base_link: None, model_toml: toml, notes };
    let file = bytes(&walk(100), &meta);
    let mut counts = std::collections::BTreeMap::new();
    for message in MessageStream::new(&file).unwrap() {
        *counts.entry(message.unwrap().channel.topic.clone()).or_insert(0) += 1;
    }
    let counts: Vec<(&str, i32)> = counts.iter().map(|(topic, n)| (topic.as_str(), *n)).collect();
    // The base is drawn at 30 Hz: every fourth sample of 100 Hz.
    let per_tick = ["/btr/channels", "/imu", "/joint_commands", "/joint_states"].map(|topic| (topic, 100));
    assert_eq!(counts, [&per_tick[..], &[("/robot_description", 1), ("/tf", 25)]].concat());

    let summary = ::mcap::Summary::read(&file).unwrap().unwrap();
    let notes = metadata(&file, &summary.metadata_indexes[0]).unwrap().metadata;
    assert_eq!((notes["seed"].as_str(), notes["version"].as_str()), ("7", env!("CARGO_PKG_VERSION")));
    assert_eq!(summary.attachment_indexes[0].name, "model.toml");
    LinearReader::new(&file).unwrap().for_each(|record| drop(record.unwrap()));
}

#[test]
fn a_file_cut_anywhere_gives_its_whole_messages_and_says_how_many() {
    let log = walk(1000);
    let file = bytes(&log, &Meta::default());
    let mut kept = 0;
    for cut in (0..file.len()).step_by(211).chain(file.len() - 60..file.len()) {
        let Ok((part, warnings)) = read(&file[..cut]) else {
            assert!(kept == 0, "cut at {cut}: a longer piece must not give less");
            continue;
        };
        assert!(part.len() >= kept, "cut at {cut}");
        kept = part.len();
        assert_eq!(part.clock_s(), &log.clock_s()[..kept]);
        assert_eq!(part.values("q_knee").unwrap(), &log.values("q_knee").unwrap()[..kept]);
        let [Warning::Truncated { messages, .. }] = &warnings[..] else { panic!("cut at {cut}: {warnings:?}") };
        assert!(*messages >= kept, "cut at {cut}");
    }
    assert_eq!(kept, 1000);
}

#[test]
fn what_is_no_mcap_file_is_named() {
    let complaint = |bytes: &[u8]| read(bytes).unwrap_err().to_string();
    assert_eq!(complaint(b""), "walk.mcap: the file is empty");
    assert_eq!(complaint(b"t,q_hip\n"), "walk.mcap: not an MCAP file");
    let nothing = bytes(&Log::default(), &Meta::default());
    assert_eq!(complaint(&nothing), "walk.mcap: no joint states on `/joint_states`; topics: none");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn flipped_bytes_never_panic(at in vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        let mut file = bytes(&walk(20), &Meta::default());
        for (index, byte) in at {
            let i = index.index(file.len());
            file[i] = byte;
        }
        let _ = read(&file);
    }
}

/// A walk's messages as a writer with these options writes them.
fn written(options: ::mcap::WriteOptions) -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let mut writer = options.chunk_size(Some(2000)).create(&mut out).unwrap();
    for message in MessageStream::new(&bytes(&walk(100), &Meta::default())).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    out.into_inner()
}

#[test]
fn no_flipped_bit_is_read_as_another_log() {
    let file = bytes(&walk(20), &Meta::default());
    let whole = read(&file).unwrap();
    assert!(whole.1.is_empty());
    let mut damaged = 0;
    for bit in (0..8 * file.len()).step_by(23) {
        let mut flipped = file.clone();
        flipped[bit / 8] ^= 1 << (bit % 8);
        match read(&flipped) {
            Ok((_, warnings)) => assert!(warnings.iter().any(Warning::is_half), "bit {bit}: {warnings:?}"),
            Err(error) => damaged += usize::from(matches!(error, IoError::Damaged { .. })),
        }
    }
    assert!(damaged > file.len() / 4, "{damaged} of {}", 8 * file.len() / 23);
}

#[test]
fn each_checksum_is_compared_and_none_has_to_be_there() {
    let without = || ::mcap::WriteOptions::new().compression(None).calculate_chunk_crcs(false);
    let without = || without().calculate_data_section_crc(false).calculate_summary_section_crc(false);
    let none = written(without());
    assert!(read(&none).unwrap().1.is_empty());
    for (options, in_summary, told) in [
        (without().calculate_chunk_crcs(true), false, "Chunk CRC failed"),
        (without().calculate_data_section_crc(true).use_chunks(false), false, "Data section CRC failed"),
        (without().calculate_summary_section_crc(true), true, "Summary section CRC failed"),
    ] {
        let mut file = written(options);
        assert!(read(&file).unwrap().1.is_empty());
        // The channel is named twice: before the messages, in their data, and in the summary.
        let name = |part: &[u8]| part == b"float64 q_hip";
        let in_file =
            |mut parts: std::slice::Windows<u8>| if in_summary { parts.rposition(name) } else { parts.position(name) };
        let at = in_file(file.windows(13)).unwrap();
        file[at + 12] ^= 1;
        let error = read(&file).unwrap_err();
        assert!(error.to_string().starts_with(&format!("walk.mcap: the file is damaged: {told}")), "{error}");
        assert!(error.help().to_string().contains("mcap recover"), "{}", error.help());
    }
}
