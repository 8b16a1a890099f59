//! The commands of the next experiment, as `btr diagnose --next` writes them.

use crate::compare::lab;
use btr_io::{Mapping, read_log};

/// Logs whose columns are in degrees under btr's own names, as those of a LeRobot data set.
const DEGREES: &str = r#"
[channels.channels]
"q_{joint}" = { column = "q_{joint}", factor = 0.017453292519943295 }
"cmd_{joint}" = { column = "cmd_{joint}", factor = 0.017453292519943295 }
"#;

#[test]
fn the_next_drive_is_in_the_units_in_which_the_model_reads_logs() {
    let lab = lab("effect = \"command_delay\"\ndelay = 0.03");
    lab.write("degrees.toml", &format!("{}{DEGREES}", lab.read("swing.toml")));
    lab.edit("log.csv", "degrees.csv", |row, cells| {
        cells.truncate(3);
        let numbers = cells.iter_mut().skip(1).filter(|_| row > 0);
        numbers.for_each(|cell| *cell = cell.parse::<f64>().unwrap().to_degrees().to_string());
        true
    });
    let told = lab.ok("diagnose swing.toml log.csv --next radians.csv");
    assert!(told.contains("radians.csv: the commands of the next experiment, in SI units"), "{told}");
    let told = lab.ok("diagnose degrees.toml degrees.csv --next next.csv");
    assert!(told.contains("next.csv: the commands of the next experiment, in the names and units of [channels]"));
    lab.ok("simulate swing.toml --log radians.csv -q -o of_radians.csv");
    lab.ok("simulate degrees.toml --log next.csv -q -o of_degrees.csv");
    let commands = |file: &str| {
        let (log, _) = read_log(&lab.path(file), &Mapping::default()).unwrap();
        log.values("cmd_hinge").unwrap().to_vec()
    };
    let largest =
        |values: &[f64]| values.iter().copied().filter(|x| x.is_finite()).fold(0.0, |a, b| f64::max(a, b.abs()));
    let (radians, degrees) = (commands("radians.csv"), commands("next.csv"));
    assert!((largest(&degrees) / largest(&radians).to_degrees() - 1.0).abs() < 1e-6);
    let (a, b) = (commands("of_radians.csv"), commands("of_degrees.csv"));
    assert_eq!(a.len(), b.len());
    assert!(a.iter().zip(&b).all(|(a, b)| (a - b).abs() < 1e-9 || a.is_nan() && b.is_nan()));
}
