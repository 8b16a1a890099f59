//! `/btr/channels`: the whole log, bit by bit, as a message with one field per channel.

use super::ros::LITTLE_ENDIAN_CDR;
use btr_core::limits::MOST_COLUMNS;
use btr_core::log::{Log, LogError, Role};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Topic and type of the log.
pub(crate) const TOPIC: &str = "/btr/channels";
pub(crate) const TYPE: &str = "btr/msg/Channels";
/// Key of the MCAP channel's metadata with names, units and roles as JSON.
const KEY: &str = "channels";

/// Description of a value after the time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Column {
    name: String,
    unit: String,
    role: Role,
}

fn columns(log: &Log) -> Vec<Column> {
    log.channels().map(|(name, c)| Column { name: name.to_owned(), unit: c.unit.clone(), role: c.role }).collect()
}

/// Names, units and roles, for the MCAP channel's metadata.
pub(crate) fn metadata(log: &Log) -> Result<BTreeMap<String, String>, serde_json::Error> {
    Ok(BTreeMap::from([(KEY.to_owned(), serde_json::to_string(&columns(log))?)]))
}

/// The message definition: the time, then a field for each channel.
pub(crate) fn definition(log: &Log) -> String {
    let mut definition = String::from("float64 time_s\n");
    let mut taken = vec!["time_s".to_owned()];
    for (name, channel) in log.channels() {
        let field = field(name, &taken);
        // A comment ends with its line, so line breaks in names are removed.
        let comment: String = format!("{name} [{}]", channel.unit).chars().filter(|c| !c.is_control()).collect();
        definition += &format!("float64 {field}  # {comment}\n");
        taken.push(field);
    }
    definition
}

/// A field name that ROS allows (small letters, digits, single underscores, a letter first) and that is not taken yet.
fn field(name: &str, taken: &[String]) -> String {
    let mut field = String::new();
    for c in name.chars() {
        match c {
            c if c.is_ascii_alphanumeric() => field.push(c.to_ascii_lowercase()),
            _ if field.ends_with('_') => {}
            _ => field.push('_'),
        }
    }
    let field = field.trim_matches('_');
    let base = match field.starts_with(|c: char| c.is_ascii_alphabetic()) {
        true => field.to_owned(),
        false => format!("channel_{field}").trim_end_matches('_').to_owned(),
    };
    let numbered = (2..).map(|n| format!("{base}_{n}"));
    std::iter::once(base.clone()).chain(numbered).find(|f| !taken.contains(f)).unwrap_or(base)
}

/// The message of one tick.
pub(crate) fn encode(time_s: f64, values: impl Iterator<Item = f64>, message: &mut Vec<u8>) {
    message.clear();
    message.extend(LITTLE_ENDIAN_CDR);
    for x in std::iter::once(time_s).chain(values) {
        message.extend(x.to_le_bytes());
    }
}

/// A log under construction, row by row.
pub(crate) struct LogRows {
    columns: Vec<Column>,
    clock_s: Vec<f64>,
    values: Vec<Vec<f64>>,
}

impl LogRows {
    /// No rows yet. The error text describes invalid metadata.
    pub(crate) fn new(metadata: &BTreeMap<String, String>) -> Result<Self, String> {
        let json = metadata.get(KEY).ok_or("its metadata does not name the channels")?;
        let columns: Vec<Column> = serde_json::from_str(json).map_err(|e| e.to_string())?;
        if columns.len() > MOST_COLUMNS {
            return Err(format!("{} channels; at most {MOST_COLUMNS} are read", columns.len()));
        }
        let values = vec![Vec::new(); columns.len()];
        Ok(LogRows { columns, clock_s: Vec::new(), values })
    }

    /// Adds a message, and says how many values it has.
    pub(crate) fn push(&mut self, message: &[u8]) -> Result<usize, String> {
        let (kind, body) = message.split_at_checked(4).ok_or("shorter than a CDR header")?;
        let (numbers, rest) = body.as_chunks::<8>();
        if kind != LITTLE_ENDIAN_CDR || !rest.is_empty() || numbers.len() != self.columns.len() + 1 {
            return Err(format!("{} bytes where {} numbers should be", body.len(), self.columns.len() + 1));
        }
        let mut numbers = numbers.iter().map(|bytes| f64::from_le_bytes(*bytes));
        self.clock_s.extend(numbers.next());
        for (column, x) in self.values.iter_mut().zip(numbers) {
            column.push(x);
        }
        Ok(self.columns.len() + 1)
    }

    /// Whether there are no messages.
    pub(crate) fn is_empty(&self) -> bool {
        self.clock_s.is_empty()
    }

    /// The log of all rows.
    pub(crate) fn into_log(self) -> Result<Log, LogError> {
        let mut log = Log::new(self.clock_s)?;
        for (Column { name, unit, role }, values) in self.columns.into_iter().zip(self.values) {
            log.insert(name, unit, role, values)?;
        }
        Ok(log)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;

    #[test]
    fn fields_are_valid_ros_names() {
        let mut log = Log::new(vec![]).unwrap();
        for name in ["q_LHip", "q_lhip", "q_a-/.b_", "time_s", "9", "é"] {
            log.insert(name, "rad", Role::Measured, vec![]).unwrap();
        }
        let definition = definition(&log);
        let fields: Vec<&str> = definition.lines().map(|line| line.split_whitespace().nth(1).unwrap()).collect();
        assert_eq!(fields, ["time_s", "q_lhip", "q_lhip_2", "q_a_b", "time_s_2", "channel_9", "channel"]);
        assert!(definition.contains("q_a_b  # q_a-/.b_ [rad]\n"));
    }
}
