//! CSV files as people have them: what is understood, and what the complaint says.

use super::*;

fn read(text: &str, mapping: &str) -> Result<(Log, Vec<Warning>), IoError> {
    csv::read(Path::new("walk.csv"), text.as_bytes(), &toml::from_str(mapping).unwrap())
}

fn complaint(text: &str) -> String {
    read(text, "").unwrap_err().to_string()
}

#[test]
fn complaints_name_file_line_and_column() {
    assert_eq!(complaint(""), "walk.csv: the file is empty");
    assert_eq!(complaint("t,q_hip\n"), "walk.csv: a header without samples");
    assert_eq!(complaint("clock,q_hip\n0,1\n"), "walk.csv:1: no time column `t` among `clock`, `q_hip`");
    assert_eq!(complaint("t,q_hip\n0,1\n1,abc\n"), "walk.csv:3: column `q_hip`: `abc` is not a number");
    assert_eq!(complaint("t,q_hip\n0,1\n1,inf\n"), "walk.csv:3: column `q_hip`: `inf` is not a number");
    assert_eq!(complaint("t,q_hip\n0,1\n,2\n"), "walk.csv:3: column `t`: `` is not a number");
    assert_eq!(complaint("t,q_hip\n0,1\n0.5,1\n0.5,2\n"), "walk.csv:4: time does not increase: 0.5 s, then 0.5 s");
    assert_eq!(complaint("t,q_hip\n0,1\n\n-1,2\n"), "walk.csv:4: time does not increase: 0 s, then -1 s");
    assert_eq!(complaint("t,q_hip\n0,1\n1\n2,3\n"), "walk.csv:3: 1 cells, but the header has 2");
    assert_eq!(complaint("t,q_hip\n0,1\n1,2,3\n"), "walk.csv:3: 3 cells, but the header has 2");
    assert_eq!(
        complaint("t,q_hip,q_hip_rad\n0,1,2\n"),
        "walk.csv: `q_hip` and `q_hip_rad` both mean the channel `q_hip`"
    );
    let not_text = csv::read(Path::new("walk.csv"), &b"t,q_hip\n0,\xff\n"[..], &Mapping::default()).unwrap_err();
    assert!(not_text.to_string().starts_with("walk.csv: CSV parse error: record 1 (line 2"), "{not_text}");
}

#[test]
fn missing_samples_are_nan_and_half_a_last_line_is_dropped() {
    let (log, warnings) = read("t,q_hip,dq_hip\n0,1,\n1,nan, 5 \n2,3,4\n3,0.", "").unwrap();
    assert_eq!(log.clock_s(), [0.0, 1.0, 2.0]);
    assert_eq!(format!("{:?}", log.values("q_hip").unwrap()), "[1.0, NaN, 3.0]");
    assert_eq!(format!("{:?}", log.values("dq_hip").unwrap()), "[NaN, 5.0, 4.0]");
    assert_eq!(warnings, [Warning::LastLineCut { line: 5 }]);
}

#[test]
fn text_in_a_column_nobody_asked_for_is_only_a_warning() {
    let (log, warnings) = read("t,q_hip,state\n0,1,walking\n1,2,fallen\n", "").unwrap();
    assert_eq!(log.channels().map(|(n, _)| n).collect::<Vec<_>>(), ["q_hip"]);
    let ignored = Warning::ColumnIgnored { column: "state".into(), line: 2, text: "walking".into() };
    assert_eq!(warnings, [ignored]);
    assert_eq!(warnings[0].to_string(), "column `state` is left out: line 2 holds `walking`");
}

#[test]
fn foreign_names_units_clocks_and_torque_switches_are_mapped() {
    let mapping = r#"
        time = "stamp_ms"
        torque_on = "enabled"
        channels = { "cmd_{joint}" = "{joint}_goal_deg", q_motor = "motor_m" }
    "#;
    let text = "\u{feff}stamp_ms,motor_goal_deg,enabled,motor_m,volts\n500,180,1,1,7\n1500,90,0,2,7\n";
    let (log, warnings) = read(text, mapping).unwrap();
    assert_eq!(log.clock_s(), [0.5, 1.5]);
    let table: Vec<_> = log.channels().map(|(n, c)| (n, c.unit.as_str(), c.role)).collect();
    let expected = [("cmd_motor", "rad", Role::Command), ("q_motor", "m", Role::Measured), ("volts", "1", Role::Truth)];
    assert_eq!(table, expected);
    assert_eq!(format!("{:?}", log.values("cmd_motor").unwrap()), format!("[{:?}, NaN]", std::f64::consts::PI));
    assert_eq!(warnings, []);
}

#[test]
fn a_mapping_half_found_is_warned_about_and_one_not_found_at_all_is_not() {
    let mapping = r#"channels = { cmd_motor = "goal", q_motor = "encoder" }"#;
    let (_, warnings) = read("t,encoder\n0,1\n", mapping).unwrap();
    assert_eq!(warnings, [Warning::MappingUnused { ours: "cmd_motor".into(), theirs: "goal".into() }]);
    // A simulated log carries btr's own names; the model's mapping does not concern it.
    let (log, warnings) = read("t,q_motor\n0,1\n", mapping).unwrap();
    assert_eq!((log.values("q_motor").unwrap(), warnings), (&[1.0][..], vec![]));
}

#[test]
fn names_that_csv_cannot_carry_are_refused_before_anything_is_written() {
    for name in ["q_cmd_hip", "t", " q_hip"] {
        let mut log = Log::new(vec![0.0]).unwrap();
        log.insert(name, "rad", Role::Measured, vec![1.0]).unwrap();
        let error = csv::headers(Path::new("walk.csv"), &log).unwrap_err();
        let expected = format!("walk.csv: the channel `{name}` would be read back from CSV as something else");
        assert_eq!(error.to_string(), expected);
    }
}

proptest! {
    #[test]
    fn rubbish_never_panics(bytes in vec(any::<u8>(), 0..300), lines in "(t,q_a\n)?([0-9.,;\"\n-]{0,60})") {
        let _ = csv::read(Path::new("x.csv"), &bytes[..], &Mapping::default());
        let _ = csv::read(Path::new("x.csv"), lines.as_bytes(), &Mapping::default());
    }
}

#[test]
fn semicolons_and_tabs_may_separate_cells_of_numbers_with_commas() {
    let comma = format!("{:?}", read("t,q_hip,q_knee\n0,0.5,1e3\n0.25,,-2\n", "").unwrap().0);
    for text in [
        "t;q_hip;q_knee\n0;0,5;1e3\n0,25;; -2,0\n",
        "t;q_hip;q_knee\r\n0;0.5;1e3\r\n0.25;nan;-2\r\n",
        "\u{feff}t\tq_hip\tq_knee\n0\t0,5\t1e3\n0,25\t\t-2\n",
    ] {
        assert_eq!(format!("{:?}", read(text, "").unwrap().0), comma, "{text}");
    }
    // A comma between thousands is no point.
    for text in ["t;q_hip\n0;0.5\n0.1;1,234\n", "t;q_hip\n0;0,5\n0,1;1.234\n", "t;q_hip\n0;1,234.5\n"] {
        assert!(matches!(read(text, ""), Err(IoError::NotANumber { .. })), "{text}");
    }
    // The header decides, by the separator that it has most of.
    let commented = read("t;\"q_hip\";\"note; at 1,5 V\"\n0;0,5;ok\n1;0,6;not, ok\n", "").unwrap().0;
    assert_eq!(commented.channel("q_hip").unwrap().values, [0.5, 0.6]);
}
