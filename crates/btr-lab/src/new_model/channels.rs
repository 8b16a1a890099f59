//! `[channels]` of a new model file.

use super::column::{Column, Unit};
use super::text::{Writer, key, number, quoted};
use super::units::says_its_unit;

impl Writer<'_> {
    pub(super) fn channels(&mut self) {
        let joints: Vec<String> = self.built.movable().map(|(_, link)| link.joint.name.clone()).collect();
        let ours = |column: &Column| format!("{}{}", column.kind.prefix(), joints[column.joint]);
        let (mut lines, columns) = (Vec::new(), self.columns);
        for column in &columns.columns {
            let (name, ours) = (quoted(&column.name), ours(column));
            let stem = column.name.strip_prefix("q_cmd_").map(|joint| format!("cmd_{joint}"));
            let stem = stem.unwrap_or_else(|| column.name.clone());
            let known = stem == ours || (says_its_unit(&stem) && stem.starts_with(&format!("{ours}_")));
            match column.unit {
                Unit::Native if known => {}
                Unit::Native => lines.push(format!("{} = {name}", key(&ours))),
                unit => {
                    let factor = number(unit.factor());
                    lines.push(format!("{} = {{ column = {name}, factor = {factor} }}  # GUESS", key(&ours)));
                }
            }
        }
        let time = columns.time.is_some() || columns.time_unit.is_some();
        if time || !columns.unmatched.is_empty() {
            self.line("\n[channels]");
        }
        if let Some(time) = &columns.time {
            self.line(&format!("time = {}", quoted(time)));
        }
        if let Some(unit) = columns.time_unit {
            self.line(&format!("time_unit = \"{}\"  # GUESS", unit.name()));
        }
        if !columns.unmatched.is_empty() {
            self.line(&format!("# columns that are no channel of a joint: {}", columns.unmatched.join(", ")));
        }
        if !lines.is_empty() {
            self.line("\n[channels.channels]");
            lines.iter().for_each(|line| self.line(line));
        }
        self.missing(&joints);
    }

    /// Tells the joints that a log lacks.
    fn missing(&mut self, joints: &[String]) {
        let measured = |i: usize| self.columns.columns.iter().any(|column| column.joint == i);
        let without: Vec<&str> = (0..joints.len()).filter(|i| !measured(*i)).map(|i| joints[i].as_str()).collect();
        if !without.is_empty() && !self.columns.columns.is_empty() {
            let told = format!("no log has columns of {}", without.join(", "));
            self.told.push(told);
        }
    }
}
