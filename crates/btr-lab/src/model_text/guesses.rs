//! Values in the place of guesses: comments of a new model file that call gains so go once these are fitted.

use btr_physics::robot::Robot;
use toml_edit::{Decor, DocumentMut, Item, RawString, TableLike, Value};

/// Behind the entry of a servo.
pub(crate) const SERVO_GUESS: &str = "FILL IN kp and kd: a GUESS";

/// Above the free gains.
pub(crate) const GAINS_GUESS: &str =
    "# Guessed gains: remove the lines of those that you have filled in, as a free kd passes for friction.";

/// Replaces a value; a comment behind it stays unless it calls the value a guess.
pub(super) fn set(table: &mut dyn TableLike, key: &str, x: f64) {
    let behind = table.get(key).and_then(Item::as_value).and_then(|old| old.decor().suffix()?.as_str());
    let behind = behind.map(without_guess);
    let mut new = Value::from(x);
    if let Some(behind) = behind {
        *new.decor_mut() = Decor::new(" ", behind);
    }
    table.insert(key, Item::Value(new));
}

/// Removes the comments about gains that all have a fitted value.
pub(super) fn forget_guesses(document: &mut DocumentMut, robot: &Robot, fitted: &[&str]) {
    let is_fitted = |name: &str| fitted.contains(&name);
    let gains: Vec<String> = free_gains(document);
    for (_, link) in robot.movable() {
        let joint = link.joint.name.as_str();
        let mut own =
            gains.iter().filter(|name| name.split_once('@').is_some_and(|(_, site)| site == joint)).peekable();
        if own.peek().is_some() && own.all(|name| is_fitted(name)) {
            forget_servo(document, joint);
        }
    }
    if !gains.is_empty() && gains.iter().all(|name| is_fitted(name)) {
        forget_heading(document, &gains);
    }
}

/// Names of the gains in `[parameters]`.
fn free_gains(document: &DocumentMut) -> Vec<String> {
    let Some(parameters) = document.get("parameters").and_then(Item::as_table_like) else { return Vec::new() };
    let is_gain = |name: &&str| name.starts_with("kp@") || name.starts_with("kd@");
    parameters.iter().map(|(name, _)| name).filter(is_gain).map(str::to_owned).collect()
}

fn forget_servo(document: &mut DocumentMut, joint: &str) {
    let Some(entry) = document.get_mut("actuators").and_then(|actuators| actuators.get_mut(joint)) else { return };
    let Some(value) = entry.as_value_mut() else { return };
    let behind = value.decor().suffix().and_then(RawString::as_str).unwrap_or_default();
    let behind = without_guess(behind);
    value.decor_mut().set_suffix(behind);
}

fn forget_heading(document: &mut DocumentMut, gains: &[String]) {
    let Some(parameters) = document.get_mut("parameters").and_then(Item::as_table_like_mut) else { return };
    for name in gains {
        let Some(mut key) = parameters.key_mut(name) else { continue };
        let above = key.leaf_decor().prefix().and_then(RawString::as_str).unwrap_or_default();
        if above.contains(GAINS_GUESS) {
            let above = above.replace(&format!("{GAINS_GUESS}\n"), "");
            key.leaf_decor_mut().set_prefix(above);
        }
    }
}

/// A comment without the part that calls it a guess.
fn without_guess(comment: &str) -> String {
    let rest = comment.replace(&format!("{SERVO_GUESS}; "), "").replace(SERVO_GUESS, "");
    if rest.trim() == "#" || rest.contains("GUESS") { String::new() } else { rest }
}
