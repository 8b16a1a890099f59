//! A model's text with the free parameters that another model has beyond it.

use super::patterns::stands_for;
use toml_edit::{DocumentMut, Item, Table, TomlError};

/// The text with the entries of `[parameters]` that only `other` has, without what earlier logs leave of them (`sd`):
/// these may be the same logs.
///
/// # Errors
/// A text that is not TOML.
pub(crate) fn with_parameters_of(text: &str, other: &str) -> Result<String, TomlError> {
    let (mut document, other) = (text.parse::<DocumentMut>()?, other.parse::<DocumentMut>()?);
    let Some(others) = other.get("parameters").and_then(Item::as_table_like) else { return Ok(text.to_owned()) };
    let parameters = document.entry("parameters").or_insert_with(|| Item::Table(Table::new()));
    let Some(parameters) = parameters.as_table_like_mut() else { return Ok(text.to_owned()) };
    for (name, entry) in others.iter() {
        if parameters.iter().any(|(key, entry)| key == name || stands_for(key, entry, name)) {
            continue;
        }
        let mut entry = entry.clone();
        entry.as_table_like_mut().and_then(|entry| entry.remove("sd"));
        if let Some(inline) = entry.as_inline_table_mut() {
            inline.fmt();
        }
        parameters.insert(name, entry);
        if let (Some(mut key), Some(copied)) = (parameters.key_mut(name), others.key(name)) {
            *key.leaf_decor_mut() = copied.leaf_decor().clone();
        }
    }
    Ok(document.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn what_is_missing_comes_with_its_comment_and_without_its_deviation() {
        let model = "name = \"arm\"\n[parameters]\n\"kp@yaw\" = { bounds = [1.0, 2.0] }\n";
        let found = "[parameters]\n\"kp@yaw\" = { bounds = [0.0, 9.0], value = 3.0 }\n\n# In N·m.\n\
                     \"coulomb_friction.torque@yaw\" = { bounds = [0.0, 4.0], value = 0.3, sd = 0.1 }\n";
        let both = with_parameters_of(model, found).unwrap();
        let added = "\n# In N·m.\n\"coulomb_friction.torque@yaw\" = { bounds = [0.0, 4.0], value = 0.3 }\n";
        assert_eq!(both, format!("{model}{added}"));
        assert_eq!(with_parameters_of(&both, found).unwrap(), both);
        assert_eq!(with_parameters_of("name = \"arm\"\n", "name = \"arm\"\n").unwrap(), "name = \"arm\"\n");
    }
}
