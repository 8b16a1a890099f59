//! Channel names of the values of a frame.

use serde_json::Value;

/// Columns that are read.
pub(super) const COLUMNS: [&str; 4] = ["action", "observation.state", "observation.velocity", "observation.effort"];

/// Suffixes of names in the state, and the prefixes that they stand for.
const ENDINGS: [(&str, &str); 3] = [(".pos", "q_"), (".vel", "dq_"), (".torque", "tau_")];

/// btr's names of the values of a column: by the joints in `names`, or by index if `names` does not name each.
pub(super) fn channels(column: &str, names: &Value, width: usize) -> Vec<String> {
    let named = flat(names);
    let joints = if named.len() == width { named } else { (0..width).map(|k| k.to_string()).collect() };
    joints.iter().map(|joint| channel(column, joint)).collect()
}

fn channel(column: &str, name: &str) -> String {
    let joint = name.strip_suffix(".pos").unwrap_or(name);
    match column {
        "action" => format!("cmd_{joint}"),
        "observation.velocity" => format!("dq_{joint}"),
        "observation.effort" => format!("tau_{joint}"),
        _ => {
            let split = ENDINGS.iter().find_map(|(ending, prefix)| Some((prefix, name.strip_suffix(ending)?)));
            split.map_or_else(|| format!("q_{name}"), |(prefix, joint)| format!("{prefix}{joint}"))
        }
    }
}

/// The names in order: from a list, from lists under keys as in older recordings (`{"motors": [...]}`), or from keys
/// with their indices (`{"x": 0, "y": 1}`).
fn flat(names: &Value) -> Vec<String> {
    match names {
        Value::String(name) => vec![name.clone()],
        Value::Array(parts) => parts.iter().flat_map(flat).collect(),
        Value::Object(parts) if parts.values().all(Value::is_u64) => {
            let mut placed: Vec<(Option<u64>, &String)> = parts.iter().map(|(name, at)| (at.as_u64(), name)).collect();
            placed.sort();
            placed.into_iter().map(|(_, name)| name.clone()).collect()
        }
        Value::Object(parts) => parts.values().flat_map(flat).collect(),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn names_are_read_in_every_form() {
        assert_eq!(channels("action", &json!(["pan.pos", "lift.pos"]), 2), ["cmd_pan", "cmd_lift"]);
        assert_eq!(channels("observation.state", &json!({ "motors": ["pan", "lift"] }), 2), ["q_pan", "q_lift"]);
        assert_eq!(channels("observation.state", &json!({ "b": 0, "a": 1 }), 2), ["q_b", "q_a"]);
        let state = json!(["pan.pos", "pan.vel", "pan.torque"]);
        assert_eq!(channels("observation.state", &state, 3), ["q_pan", "dq_pan", "tau_pan"]);
        assert_eq!(channels("observation.velocity", &json!(["pan.pos"]), 1), ["dq_pan"]);
        // A single name for several values, or none, names no joint.
        assert_eq!(channels("observation.state", &json!(["state"]), 2), ["q_0", "q_1"]);
        assert_eq!(channels("action", &Value::Null, 1), ["cmd_0"]);
    }
}
