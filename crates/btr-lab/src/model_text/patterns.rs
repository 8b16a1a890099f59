//! Entries of `[parameters]` whose name is a pattern, and stands for a free parameter of each joint or link.

use btr_core::space::Space;
use btr_physics::robot::site::{is_pattern, matches};
use toml_edit::{DocumentMut, Item, Key, Table};

/// Whether an entry of this name gives the parameter `name` a value of its own.
pub(super) fn stands_for(key: &str, entry: &Item, name: &str) -> bool {
    let parts = |name: &'_ str| -> (String, String) {
        let (what, site) = name.split_once('@').unwrap_or((name, "*"));
        (what.to_owned(), site.to_owned())
    };
    let ((what, pattern), (of, site)) = (parts(key), parts(name));
    let is_shared = entry.get("shared").and_then(Item::as_bool).unwrap_or(false);
    let is_effects = what.contains('.') && entry.get("relative").is_none();
    what == of && is_pattern(&pattern) && !is_shared && !is_effects && matches(&pattern, &site)
}

/// Writes an entry for each free parameter that a pattern stands for in the pattern's place.
pub(super) fn spell_out(document: &mut DocumentMut, space: &Space) {
    let Some(parameters) = document.get_mut("parameters").and_then(Item::as_table_mut) else { return };
    let is_known = |key: &str| space.index_of(key).is_some();
    if parameters.iter().all(|(key, _)| is_known(key)) {
        return;
    }
    let entries: Vec<(Key, Item)> =
        parameters.iter().filter_map(|(key, entry)| Some((parameters.key(key)?.clone(), entry.clone()))).collect();
    let stated: Vec<String> = entries.iter().map(|(key, _)| key.get().to_owned()).collect();
    parameters.clear();
    for (key, entry) in entries {
        let is_of_it = |name: &&str| !stated.iter().any(|key| key == name) && stands_for(key.get(), &entry, name);
        let names: Vec<&str> = space.dims().iter().map(|dim| dim.name.as_str()).filter(is_of_it).collect();
        if is_known(key.get()) || names.is_empty() {
            parameters.insert_formatted(&key, entry);
            continue;
        }
        insert_each(parameters, &key, &entry, &names);
    }
}

/// The entry under each of these names; the first has the comment.
fn insert_each(parameters: &mut Table, key: &Key, entry: &Item, names: &[&str]) {
    for (k, name) in names.iter().enumerate() {
        parameters.insert(name, entry.clone());
        if let (0, Some(mut own)) = (k, parameters.key_mut(name)) {
            *own.leaf_decor_mut() = key.leaf_decor().clone();
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use btr_core::space::Dim;

    #[test]
    fn patterns_become_entries_in_their_place() {
        let names = ["mass@bob", "kp@hip", "kp@knee", "kd@*"];
        let space = Space::new(names.map(|name| Dim::new(name, "1", 0.0, 1.0)).to_vec()).unwrap();
        let text = "[parameters]\n\"mass@bob\" = { relative = [0.5, 2.0] }\n# Gains.\n\
                    \"kp@*\" = { relative = [0.8, 1.25] }\n\"kd@*\" = { relative = [0.5, 2.0], shared = true }\n";
        let mut document = text.parse::<DocumentMut>().unwrap();
        spell_out(&mut document, &space);
        let each = "\"kp@hip\" = { relative = [0.8, 1.25] }\n\"kp@knee\" = { relative = [0.8, 1.25] }\n";
        assert_eq!(document.to_string(), text.replace("\"kp@*\" = { relative = [0.8, 1.25] }\n", each));
    }
}
