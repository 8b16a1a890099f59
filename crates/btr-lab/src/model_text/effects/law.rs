//! Writes a user-defined law into a model file, with fixed or free parameters.

use super::add::AddError;
use crate::experiment::Source;
use btr_physics::effects::FORMULA;
use toml_edit::{ArrayOfTables, DocumentMut, InlineTable, Item, Table, TableLike, Value, value};

/// Keys of a formula's section other than the law's parameters.
const KEYS: [&str; 4] = ["effect", "site", "on", "law"];

/// A user-defined law for a model file.
#[derive(Clone, Debug)]
pub struct OwnLaw {
    /// An expression, or the name of a function passed along with the model.
    pub law: String,
    /// Names of joints.
    pub site: String,
    /// `torque`, `command` or `reading`.
    pub on: String,
    /// Its parameters by name, in SI units.
    pub numbers: Vec<(String, OwnNumber)>,
}

/// A parameter of a law.
#[derive(Clone, Copy, Debug)]
pub enum OwnNumber {
    /// Fixed at a value.
    Fixed(f64),
    /// Free to fit between two bounds.
    Between(f64, f64),
}

impl OwnNumber {
    /// Initial value of a fit: the midpoint of the bounds, or their geometric mean if they are positive, as in fits.
    fn nominal(self) -> f64 {
        match self {
            OwnNumber::Fixed(value) => value,
            OwnNumber::Between(least, most) if least > 0.0 => (least * most).sqrt().clamp(least, most.max(least)),
            OwnNumber::Between(least, most) => 0.5 * (least + most),
        }
    }
}

/// The model's text with the law added. The law and its parameters are validated when the text is read.
///
/// # Errors
/// A parameter name that is already used in the file.
pub fn add_law(source: &Source, law: &OwnLaw) -> Result<String, AddError> {
    let mut document = source.text.parse::<DocumentMut>()?;
    for (name, _) in &law.numbers {
        let taken = |why: String| Err(AddError::Name { name: name.clone(), why });
        if KEYS.contains(&name.as_str()) {
            return taken("a formula's section says something else with it".to_owned());
        }
        if has_parameter(document.get("effects"), &law.site, name) {
            let site = &law.site;
            return taken(format!("another formula at `{site}` has one, and parameters of one name there are one"));
        }
    }
    let effects = document.entry("effects").or_insert_with(|| Item::ArrayOfTables(ArrayOfTables::new()));
    match effects {
        Item::ArrayOfTables(sections) => {
            let mut section = Table::new();
            fill(&mut section, law);
            sections.push(section);
        }
        Item::Value(Value::Array(sections)) => {
            let mut section = InlineTable::new();
            fill(&mut section, law);
            sections.push(section);
        }
        _ => {}
    }
    let parameters = document.entry("parameters").or_insert_with(|| Item::Table(Table::new()));
    let Some(parameters) = parameters.as_table_like_mut() else { return Ok(document.to_string()) };
    for (name, number) in &law.numbers {
        if let OwnNumber::Between(least, most) = *number {
            let mut entry = InlineTable::new();
            entry.insert("bounds", Value::Array([least, most].into_iter().collect()));
            parameters.insert(&format!("{}.{name}@{}", FORMULA.name, law.site), value(entry));
        }
    }
    Ok(document.to_string())
}

fn fill(section: &mut dyn TableLike, law: &OwnLaw) {
    let texts = [FORMULA.name, &law.site, &law.on, &law.law];
    for (key, text) in KEYS.into_iter().zip(texts) {
        section.insert(key, value(text));
    }
    for (name, number) in &law.numbers {
        section.insert(name, value(number.nominal()));
    }
}

/// Whether a formula at the site has a parameter of that name.
fn has_parameter(effects: Option<&Item>, site: &str, name: &str) -> bool {
    let holds = |section: &dyn TableLike, key: &str, text: &str| section.get(key).and_then(Item::as_str) == Some(text);
    let is = |section: &dyn TableLike| {
        let here = holds(section, "site", site) || (site == "*" && !section.contains_key("site"));
        holds(section, "effect", FORMULA.name) && here && section.contains_key(name)
    };
    match effects {
        Some(Item::ArrayOfTables(sections)) => sections.iter().any(|section| is(section)),
        Some(Item::Value(Value::Array(sections))) => {
            sections.iter().filter_map(Value::as_inline_table).any(|section| is(section))
        }
        _ => false,
    }
}
