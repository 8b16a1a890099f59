//! Values of free parameters in the place where a model's file states them: gains under `[actuators]`, parameters of
//! effects in `[[effects]]`, the ground's friction.

use super::effects::write_in_effect;
use super::guesses::set;
use btr_physics::model::parameter::{Target, motor_values};
use btr_physics::robot::Robot;
use btr_physics::robot::site::matches;
use toml_edit::{DocumentMut, Item, Table, TableLike};

/// Writes a free parameter's value where the file states it; whether it does so everywhere.
pub(super) fn write_in_place(document: &mut DocumentMut, robot: &Robot, name: &str, x: f64) -> bool {
    let Ok(target) = Target::parse(name, robot) else { return false };
    let (what, site) = name.split_once('@').unwrap_or((name, "*"));
    if let Some((effect, parameter)) = what.split_once('.') {
        return write_in_effect(document, robot, &target, (effect, site), (parameter, x));
    }
    if what == "ground_friction" {
        let simulation = document.get_mut("simulation").and_then(Item::as_table_like_mut);
        return simulation.filter(|table| table.contains_key(what)).map(|table| set(table, what, x)).is_some();
    }
    write_in_actuators(document, robot, &target, (what, x))
}

fn set_in(entry: &mut Item, key: &str, x: f64) {
    if let Some(table) = entry.as_table_like_mut() {
        set(table, key, x);
    }
    if let Some(inline) = entry.as_inline_table_mut() {
        inline.fmt();
    }
}

fn write_in_actuators(document: &mut DocumentMut, robot: &Robot, target: &Target, (what, x): (&str, f64)) -> bool {
    let joints: Vec<&str> = target.links().iter().map(|&link| robot.links[link].joint.name.as_str()).collect();
    let is_motors = |&link: &usize| motor_values(&robot.links[link].joint.actuator).any(|(name, _)| name == what);
    let Some(actuators) = document.get_mut("actuators").and_then(Item::as_table_like_mut) else { return false };
    if joints.is_empty() || !target.links().iter().all(is_motors) {
        return false;
    }
    let stated: Vec<Option<String>> = joints.iter().map(|joint| stating(actuators, robot, joint)).collect();
    for (joint, pattern) in joints.iter().zip(stated.iter().flatten()) {
        let covered: Vec<&str> = driven(robot).filter(|other| covers(pattern, robot, other)).collect();
        if covered.iter().all(|other| joints.contains(other)) {
            actuators.get_mut(pattern).into_iter().for_each(|entry| set_in(entry, what, x));
        } else {
            split_off(actuators, robot, pattern, joint);
            actuators.get_mut(joint).into_iter().for_each(|entry| set_in(entry, what, x));
        }
    }
    stated.iter().all(Option::is_some)
}

/// Names of the movable joints.
fn driven(robot: &Robot) -> impl Iterator<Item = &str> {
    robot.movable().map(|(_, link)| link.joint.name.as_str())
}

/// Whether an entry of `[actuators]` is about a joint; one that follows another joint has only an entry of its own.
fn covers(pattern: &str, robot: &Robot, joint: &str) -> bool {
    let follows = |name: &str| robot.movable().any(|(_, link)| link.joint.name == name && link.joint.mimic.is_some());
    pattern == joint || (matches(pattern, joint) && !follows(joint))
}

/// The entry of `[actuators]` that a joint has: the last one that is about it.
fn stating(actuators: &dyn TableLike, robot: &Robot, joint: &str) -> Option<String> {
    let entries = actuators.iter().map(|(pattern, _)| pattern).filter(|pattern| covers(pattern, robot, joint));
    entries.last().map(str::to_owned)
}

/// Gives a joint a copy of the entry that it shares with others; an entry that no joint has any more is removed, and
/// its comment goes to the copy.
fn split_off(actuators: &mut dyn TableLike, robot: &Robot, pattern: &str, joint: &str) {
    let Some(mut own) = actuators.get(pattern).cloned() else { return };
    if let Some(table) = own.as_table_mut() {
        table.decor_mut().set_prefix("\n");
    }
    actuators.insert(joint, own);
    let still_has = |other: &str| stating(actuators, robot, other).as_deref() == Some(pattern);
    if driven(robot).any(still_has) {
        return;
    }
    let Some(removed) = actuators.remove(pattern).and_then(|entry| entry.into_table().ok()) else { return };
    // Copies keep the position in the file.
    let is_copy = |table: &Table| table.position() == removed.position();
    let table = |joint: &str| actuators.get(joint).and_then(Item::as_table);
    let first = driven(robot).find(|joint| table(joint).is_some_and(is_copy));
    if let Some(first) = first.and_then(|joint| actuators.get_mut(joint)).and_then(Item::as_table_mut) {
        *first.decor_mut() = removed.decor().clone();
    }
}
