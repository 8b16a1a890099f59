//! `remove`: takes effects out of a model file, with their parameters and the comments above them.

use super::in_place::site_of;
use btr_core::text::Text;
use toml_edit::{DocumentMut, Item, TableLike, Value};

/// Why an effect cannot be removed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RemoveError {
    /// The model does not have it.
    #[error("the model has no `{name}`")]
    Absent {
        /// The requested name.
        name: String,
        /// The effects of the model, as `effect@site`.
        present: Vec<String>,
    },
    /// The file is not valid TOML; it was parsed before, so this does not happen.
    #[error(transparent)]
    Toml(#[from] toml_edit::TomlError),
}

impl RemoveError {
    /// The remedy.
    pub fn help(&self) -> Option<Text> {
        match self {
            RemoveError::Absent { present, .. } if present.is_empty() => Some("it has no effects".into()),
            RemoveError::Absent { present, .. } => Some(format!("it has: {}", present.join(", ")).into()),
            RemoveError::Toml(_) => None,
        }
    }
}

/// A model's text without these effects: `coulomb_friction@knee` as the text names the site, or `coulomb_friction` at
/// all sites.
///
/// # Errors
/// An effect that the text does not have there.
pub fn remove(text: &str, effects: &[String]) -> Result<String, RemoveError> {
    let mut document = text.parse::<DocumentMut>()?;
    for name in effects {
        let (effect, site) = name.split_once('@').map_or((name.as_str(), None), |(effect, site)| (effect, Some(site)));
        let is_meant = |named: (&str, &str)| named.0 == effect && site.is_none_or(|site| site == named.1);
        let present = present(&document);
        let entries = remove_entries(&mut document, is_meant);
        if !remove_parameters(&mut document, is_meant) && !entries {
            return Err(RemoveError::Absent { name: name.clone(), present });
        }
    }
    Ok(document.to_string())
}

/// The effect and the site of a free parameter, as in `coulomb_friction.torque@knee`.
fn named(parameter: &str) -> Option<(&str, &str)> {
    let (what, site) = parameter.split_once('@')?;
    Some((what.split_once('.')?.0, site))
}

/// The effect and the site of an entry.
fn of_entry(entry: &dyn TableLike) -> (&str, &str) {
    (entry.get("effect").and_then(Item::as_str).unwrap_or_default(), site_of(entry))
}

/// Removes entries of `[[effects]]`; whether there were any.
fn remove_entries(document: &mut DocumentMut, is_meant: impl Fn((&str, &str)) -> bool) -> bool {
    let (before, after) = match document.get_mut("effects") {
        Some(Item::ArrayOfTables(tables)) => {
            let before = tables.len();
            tables.retain(|table| !is_meant(of_entry(table)));
            (before, tables.len())
        }
        Some(Item::Value(Value::Array(values))) => {
            let before = values.len();
            values.retain(|value| value.as_inline_table().is_none_or(|table| !is_meant(of_entry(table))));
            (before, values.len())
        }
        _ => return false,
    };
    if after == 0 {
        document.remove("effects");
    }
    after < before
}

/// Removes free parameters; whether there were any.
fn remove_parameters(document: &mut DocumentMut, is_meant: impl Fn((&str, &str)) -> bool) -> bool {
    let Some(parameters) = document.get_mut("parameters").and_then(Item::as_table_like_mut) else { return false };
    let names: Vec<String> = parameters.iter().map(|(name, _)| name.to_owned()).collect();
    let meant: Vec<&String> = names.iter().filter(|name| named(name).is_some_and(&is_meant)).collect();
    meant.iter().for_each(|name| drop(parameters.remove(name)));
    if meant.len() == names.len() && !names.is_empty() {
        document.remove("parameters");
    }
    !meant.is_empty()
}

/// The effects of a text, as `effect@site`.
fn present(document: &DocumentMut) -> Vec<String> {
    let entries: Vec<&dyn TableLike> = match document.get("effects") {
        Some(Item::ArrayOfTables(tables)) => tables.iter().map(|table| table as &dyn TableLike).collect(),
        Some(Item::Value(Value::Array(values))) => {
            values.iter().filter_map(Value::as_inline_table).map(|table| table as &dyn TableLike).collect()
        }
        _ => Vec::new(),
    };
    let parameters = document.get("parameters").and_then(Item::as_table_like);
    let free = parameters.into_iter().flat_map(TableLike::iter).filter_map(|(name, _)| named(name));
    let mut all: Vec<String> = Vec::new();
    for (effect, site) in entries.into_iter().map(of_entry).chain(free) {
        let name = format!("{effect}@{site}");
        if !all.contains(&name) {
            all.push(name);
        }
    }
    all
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]

    use super::*;

    const TEXT: &str = "name = \"arm\"\n\n[parameters]\n\"mass@forearm\" = { relative = [0.5, 2.0] }\n\n\
        # coulomb_friction: dry.\n\"coulomb_friction.torque@yaw\" = { bounds = [0.0, 2.0], value = 0.0 }\n\n\
        [[effects]]\neffect = \"backlash\"\nsite = \"elbow\"\ngap = 0.01\n\n\
        # Along the whole arm.\n[[effects]]\neffect = \"viscous_friction\"\ncoefficient = 0.1\n";

    fn without(effects: &[&str]) -> Result<String, RemoveError> {
        remove(TEXT, &effects.iter().map(|&effect| effect.to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn an_effect_goes_with_its_parameters_and_the_comments_above_them() {
        let text = without(&["coulomb_friction@yaw", "viscous_friction@*"]).unwrap();
        assert_eq!(
            text,
            "name = \"arm\"\n\n[parameters]\n\"mass@forearm\" = { relative = [0.5, 2.0] }\n\n\
             [[effects]]\neffect = \"backlash\"\nsite = \"elbow\"\ngap = 0.01\n"
        );
        assert!(!without(&["backlash"]).unwrap().contains("backlash"));
        let none = without(&["backlash", "viscous_friction"]).unwrap();
        assert!(!none.contains("effects") && none.contains("coulomb_friction.torque@yaw"));
    }

    #[test]
    fn what_is_not_there_is_said_with_what_is() {
        for name in ["coulomb_friction@elbow", "backlash@*", "payload"] {
            let error = without(&[name]).unwrap_err();
            assert_eq!(error.to_string(), format!("the model has no `{name}`"));
            let help = error.help().unwrap().to_string();
            assert_eq!(help, "it has: backlash@elbow, viscous_friction@*, coulomb_friction@yaw");
        }
    }
}
