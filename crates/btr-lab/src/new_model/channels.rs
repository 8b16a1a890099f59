//! `[channels]` of a new model file, and `[noise]`, commented out: what the logs show of the sensors.

use super::column::{Column, Unit};
use super::gains::rounded;
use super::noise::ShownNoise;
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

    /// Stated noise counts rather than that of the logs, so nothing is stated that only they say.
    pub(super) fn noise(&mut self) {
        let ShownNoise { position, position_quantum, torque } = self.columns.noise;
        let shown = [
            ("position_rad", position, "white noise of the encoders, standard deviation"),
            ("position_quantum_rad", position_quantum, "their step"),
            ("torque_n_m", torque, "of measured torques"),
        ];
        self.line("\n# The noise floor is estimated from the logs. State the sensors' noise if it is correlated from sample to sample,");
        self.line("# or if logs are full of impacts; a part that is not stated is still estimated.");
        if shown.iter().all(|(_, value, _)| *value <= 0.0) {
            self.line("# [noise]\n# position_rad = 0.0005\n# position_quantum_rad = 0.0015  # 2·pi/4096 for 12 bits");
            return;
        }
        self.line("# [noise]  # what the log shows");
        for (key, value, what) in shown.into_iter().filter(|(_, value, _)| *value > 0.0) {
            self.line(&format!("# {key} = {}  # {what}", number(rounded(value))));
        }
    }
}
