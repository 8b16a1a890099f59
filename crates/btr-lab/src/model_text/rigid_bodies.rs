//! Writes whole inertial parameters, friction, rotors and offsets of an arm into its model's text.

use super::effects::rounded;
use btr_physics::effects::{FORMULA, SiteKind, find};
use btr_physics::inertials::StatedInertials;
use toml_edit::{Array, ArrayOfTables, DocumentMut, InlineTable, Item, Table, TomlError, Value, value};

/// Law of a torque that the motor has to deliver whatever the motion.
const OFFSET_LAW: &str = "-offset";
/// Upper bound of a value of 0, in its unit, and of another one as a multiple of it.
const ROOM: (f64, f64) = (1.0, 2.0);

/// What a joint of a model has, or a body.
#[derive(Clone, Debug)]
pub(crate) struct StatedBody<'a> {
    /// Its link.
    pub(crate) link: &'a str,
    /// Links that are fixed to it, whose mass is part of its.
    pub(crate) fixed: &'a [String],
    /// Its inertial parameters.
    pub(crate) inertials: &'a StatedInertials,
    /// The joint that moves it.
    pub(crate) joint: &'a str,
    /// A constant torque.
    pub(crate) offset: f64,
    /// Parameters of effects on the joint, by name.
    pub(crate) values: Vec<(String, f64)>,
}

/// The text with these bodies. What else says something about inertial parameters is taken out: it is part of them.
///
/// # Errors
/// A text that is not TOML; it was parsed before, so this does not happen.
pub(crate) fn with_bodies(text: &str, bodies: &[StatedBody]) -> Result<String, TomlError> {
    let mut document = text.parse::<DocumentMut>()?;
    let names: Vec<&str> = bodies.iter().flat_map(|body| &body.values).map(|(name, _)| name.as_str()).collect();
    take_out(&mut document, &names);
    for body in bodies {
        write_link(&mut document, body.link, body.inertials);
        let nothing = StatedInertials { mass_kg: 0.0, com_m: [0.0; 3], inertia_kg_m2: [0.0; 6] };
        body.fixed.iter().for_each(|link| write_link(&mut document, link, &nothing));
        body.values.iter().for_each(|(name, value)| write_value(&mut document, name, *value));
        write_offset(&mut document, body.joint, body.offset);
    }
    Ok(document.to_string())
}

/// Takes out masses and inertias that are parameters, effects on links, and values that joints share with others of
/// which these are named one by one.
fn take_out(document: &mut DocumentMut, named: &[&str]) {
    let is_of_link = |effect: &str| find(effect).is_some_and(|effect| effect.spec().site == SiteKind::Link);
    if let Some(parameters) = document.get_mut("parameters").and_then(Item::as_table_like_mut) {
        let names: Vec<String> = parameters.iter().map(|(name, _)| name.to_owned()).collect();
        let states = |name: &&String| {
            let what = name.split('@').next().unwrap_or(name);
            let shared =
                || named.iter().any(|other| other.split('@').next() == Some(what)) && !named.contains(&&***name);
            ["mass", "inertia"].contains(&what)
                || what.split_once('.').is_some_and(|(effect, _)| is_of_link(effect))
                || shared()
        };
        names.iter().filter(states).for_each(|name| drop(parameters.remove(name)));
    }
    match document.get_mut("effects") {
        Some(Item::ArrayOfTables(sections)) => {
            sections.retain(|section| !section.get("effect").and_then(Item::as_str).is_some_and(is_of_link));
        }
        Some(Item::Value(Value::Array(sections))) => sections.retain(|section| {
            let effect = section.as_inline_table().and_then(|section| section.get("effect")).and_then(Value::as_str);
            !effect.is_some_and(is_of_link)
        }),
        _ => {}
    }
}

fn write_link(document: &mut DocumentMut, link: &str, inertials: &StatedInertials) {
    let links = document.entry("links").or_insert_with(|| {
        let mut table = Table::new();
        table.set_implicit(true);
        Item::Table(table)
    });
    let Some(links) = links.as_table_like_mut() else { return };
    let numbers = |of: &[f64]| value(of.iter().copied().collect::<Array>());
    let mut section = Table::new();
    section.insert("mass_kg", value(inertials.mass_kg));
    section.insert("com_m", numbers(&inertials.com_m));
    section.insert("inertia_kg_m2", numbers(&inertials.inertia_kg_m2));
    links.insert(link, Item::Table(section));
}

/// Writes the value of a parameter, which becomes free where it was not, within bounds that have room for it.
fn write_value(document: &mut DocumentMut, name: &str, of: f64) {
    let parameters = document.entry("parameters").or_insert_with(|| Item::Table(Table::new()));
    let Some(parameters) = parameters.as_table_like_mut() else { return };
    let before = |k: usize| parameters.get(name)?.get("bounds")?.get(k)?.as_float();
    let most = before(1).unwrap_or(if of > 0.0 { 0.0 } else { ROOM.0 }).max(ROOM.1 * of);
    let mut entry = InlineTable::new();
    entry.insert("bounds", Value::Array([0.0, rounded(most)].into_iter().collect()));
    entry.insert("value", of.into());
    parameters.insert(name, value(entry));
}

/// Writes a constant torque, or adds it to the one that is there.
fn write_offset(document: &mut DocumentMut, joint: &str, of: f64) {
    let effects = document.entry("effects").or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    let Item::ArrayOfTables(sections) = effects else { return };
    let is = |section: &Table, key: &str, text: &str| section.get(key).and_then(Item::as_str) == Some(text);
    let same = |section: &&mut Table| is(section, "law", OFFSET_LAW) && is(section, "site", joint);
    if let Some(section) = sections.iter_mut().find(same) {
        let before = section.get("offset").and_then(Item::as_float).unwrap_or(0.0);
        section.insert("offset", value(before + of));
        return;
    }
    let mut section = Table::new();
    for (key, text) in [("effect", FORMULA.name), ("site", joint), ("on", "torque"), ("law", OFFSET_LAW)] {
        section.insert(key, value(text));
    }
    section.insert("offset", value(of));
    sections.push(section);
}
