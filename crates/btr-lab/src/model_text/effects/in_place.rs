//! Values of free parameters in `[[effects]]`.

use crate::model_text::guesses::set;
use btr_physics::model::parameter::Target;
use btr_physics::robot::Robot;
use btr_physics::robot::site::{instance, matches, numbered};
use toml_edit::{DocumentMut, Item, Table, TableLike, Value, value};

/// Writes a parameter of an effect at a site where the file states that effect; whether it does.
pub(in crate::model_text) fn write_in_effect(
    document: &mut DocumentMut,
    robot: &Robot,
    target: &Target,
    (effect, site): (&str, &str),
    (parameter, x): (&str, f64),
) -> bool {
    let Some(effects) = document.get_mut("effects") else { return false };
    let entries: Vec<&mut dyn TableLike> = match effects {
        Item::ArrayOfTables(tables) => tables.iter_mut().map(|table| table as &mut dyn TableLike).collect(),
        Item::Value(Value::Array(values)) => {
            values.iter_mut().filter_map(Value::as_inline_table_mut).map(|table| table as &mut dyn TableLike).collect()
        }
        _ => return false,
    };
    if let Some(entry) = entries.into_iter().find(|entry| is_of(*entry, effect) && site_of(*entry) == site) {
        set(entry, parameter, x);
        return true;
    }
    let Some(own) = own_entry(effects, robot, target, (effect, site)) else { return false };
    set(own, parameter, x);
    true
}

fn is_of(entry: &dyn TableLike, effect: &str) -> bool {
    entry.get("effect").and_then(Item::as_str) == Some(effect)
}

pub(super) fn site_of(entry: &dyn TableLike) -> &str {
    entry.get("site").and_then(Item::as_str).unwrap_or("*")
}

/// An entry of a site's own, taken from the one that holds for further sites as well.
fn own_entry<'a>(
    effects: &'a mut Item,
    robot: &Robot,
    target: &Target,
    (effect, site): (&str, &str),
) -> Option<&'a mut Table> {
    let tables = effects.as_array_of_tables_mut()?;
    let sites = target.sites(robot);
    let here: Vec<&str> =
        sites.iter().filter(|(link, _)| target.links().contains(link)).map(|(_, name)| *name).collect();
    let number = instance(site).1;
    let covers = |table: &Table| {
        let all = site_of(table);
        is_of(table, effect) && instance(all).1 == number && here.iter().all(|name| matches(all, name))
    };
    let place = tables.iter().position(covers).filter(|_| !here.is_empty() && !target.is_of_formula())?;
    let table = tables.get_mut(place)?;
    let mut own = table.clone();
    let others = sites.iter().filter(|(_, name)| matches(site_of(table), name) && !here.contains(name));
    let others: Vec<&str> = others.map(|(_, name)| *name).collect();
    if others.is_empty() {
        return tables.get_mut(place);
    }
    table.insert("site", value(numbered(&others.join(","), number)));
    own.insert("site", value(site));
    own.decor_mut().set_prefix("\n");
    tables.insert(place + 1, own);
    tables.get_mut(place + 1)
}
