//! Properties of reading and writing: round trips, equal bytes, and errors with a remedy.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod broken_csv;
#[cfg(feature = "mcap")]
mod foreign_mcap;
#[cfg(feature = "mcap")]
mod limits;
#[cfg(feature = "mcap")]
mod own_mcap;
#[cfg(all(feature = "mcap", feature = "parquet"))]
mod real_data;

use super::*;
use btr_core::log::Role;
use proptest::collection::vec;
use proptest::prelude::*;

/// Values of sensors and simulations, and missing ones.
fn value() -> impl Strategy<Value = f64> {
    prop_oneof![
        6 => -100.0..100.0,
        1 => any::<f64>().prop_map(|x| if x.is_finite() { x } else { -0.0 }),
        1 => Just(f64::NAN),
    ]
}

/// Names of files in every format that can be written.
const FILES: &str = if cfg!(feature = "mcap") { "log[.](csv|csv[.]gz|mcap)" } else { "log[.]csv([.]gz)?" };

const UNITS: [(&str, &str, Role); 8] = [
    ("cmd_", "rad", Role::Command),
    ("q_", "rad", Role::Measured),
    ("dq_", "rad/s", Role::Measured),
    ("tau_", "N·m", Role::Measured),
    ("foot_", "N", Role::Measured),
    ("base_v", "1", Role::Truth),
    ("ball_q", "1", Role::Truth),
    ("other_", "1", Role::Truth),
];

/// A log on an irregular clock, with names of the convention.
pub(super) fn any_log() -> impl Strategy<Value = Log> {
    (1..40_usize, 0..10_usize).prop_flat_map(|(ticks, channels)| {
        let steps = vec(1e-6..0.1, ticks);
        let names = vec((0..UNITS.len(), "[A-Za-z][A-Za-z0-9_é, \"-]{0,8}[A-Za-z0-9]"), channels);
        (-2.0..2.0, steps, names, vec(vec(value(), ticks), channels)).prop_map(|(start, steps, names, values)| {
            let clock = steps.iter().scan(start, |t, step| {
                *t += step;
                Some(*t)
            });
            let mut log = Log::new(clock.collect()).unwrap();
            for ((family, joint), values) in names.into_iter().zip(values) {
                let (prefix, unit, role) = UNITS[family];
                log.insert(format!("{prefix}{joint}"), unit, role, values).unwrap();
            }
            log
        })
    })
}

/// Equal to the last bit; NaN equals NaN.
pub(super) fn assert_same(a: &Log, b: &Log) {
    let bits = |values: &[f64]| -> Vec<u64> {
        values.iter().map(|x| if x.is_nan() { f64::NAN.to_bits() } else { x.to_bits() }).collect()
    };
    assert_eq!(bits(a.clock_s()), bits(b.clock_s()), "clocks");
    let table = |log: &Log| -> Vec<_> {
        log.channels().map(|(n, c)| (n.to_owned(), c.unit.clone(), c.role, bits(&c.values))).collect()
    };
    assert_eq!(table(a), table(b));
}

fn round_trip(log: &Log, name: &str) -> (Log, Vec<Warning>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    write_log(&path, log, &Meta::default()).unwrap();
    read_log(&path, &Mapping::default()).unwrap()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn what_is_written_is_read_back_bit_by_bit(log in any_log(), name in FILES) {
        let (read, warnings) = round_trip(&log, &name);
        assert_same(&read, &log);
        prop_assert_eq!(warnings, vec![]);
    }

    #[test]
    fn equal_logs_give_equal_bytes(log in any_log(), name in FILES) {
        let folder = tempfile::tempdir().unwrap();
        let bytes = || {
            let path = folder.path().join(&name);
            write_log(&path, &log, &Meta { urdf: Some("<robot/>".into()), ..Meta::default() }).unwrap();
            std::fs::read(path).unwrap()
        };
        prop_assert_eq!(bytes(), bytes());
    }
}

#[test]
fn unknown_extensions_and_bags_are_named_with_a_remedy() {
    let error = read_log(Path::new("walk.bin"), &Mapping::default()).unwrap_err();
    assert_eq!(error.to_string(), "walk.bin: not a log format that btr reads");
    assert!(error.help().to_string().starts_with("logs end in .csv, .csv.gz or .mcap;"));
    let error = read_log(Path::new("runs/bag/walk.db3"), &Mapping::default()).unwrap_err();
    assert_eq!(error.to_string(), "runs/bag/walk.db3: a SQLite bag; btr reads bags in MCAP");
    assert!(
        error
            .help()
            .to_string()
            .starts_with("convert it: rosbags-convert --src runs/bag --dst out --dst-storage mcap;")
    );
    let error = read_log(Path::new("nowhere/walk.csv"), &Mapping::default()).unwrap_err();
    assert!(error.to_string().starts_with("nowhere/walk.csv: No such file"), "{error}");
}

#[cfg(not(feature = "mcap"))]
#[test]
fn a_format_that_was_left_out_is_named_with_its_feature() {
    let error = read_log(Path::new("walk.mcap"), &Mapping::default()).unwrap_err();
    assert_eq!(error.to_string(), "walk.mcap: this build of btr-io does not include MCAP");
    assert!(error.help().to_string().contains("`mcap`"));
}
