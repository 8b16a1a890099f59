//! Settings by keyword, read and checked as those of experiment files.

use crate::error::raised;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value, json};
use std::collections::BTreeMap;

/// Settings in the order in which they were given, each under the name that experiment files give it.
pub(crate) type Settings<'py> = Vec<(String, Bound<'py, PyAny>)>;

#[derive(FromPyObject)]
enum Setting {
    Count(i64),
    Number(f64),
    Names(Vec<String>),
    Numbers(BTreeMap<String, f64>),
}

/// A spec: `tag` says what it is called there (`algorithm`, `name`). `said` is how the caller calls a setting.
pub(crate) fn read<T: DeserializeOwned>(
    tag: &str,
    name: &str,
    settings: &Settings<'_>,
    said: impl Fn(&str) -> String,
) -> PyResult<T> {
    let mut table = Map::from_iter([(tag.to_owned(), json!(name))]);
    for (key, setting) in settings {
        let value = value(&said(key), setting)?;
        // Each setting is checked alone first: the others have defaults, so an error belongs to this one.
        let alone = serde_json::from_value::<T>(json!({ tag: name, key: value }));
        alone.map_err(|error| refused(&said(key), &error.to_string()))?;
        table.insert(key.clone(), value);
    }
    serde_json::from_value(Value::Object(table)).map_err(|error| raised(format!("{tag}: {error}"), None))
}

fn value(said: &str, setting: &Bound<'_, PyAny>) -> PyResult<Value> {
    match setting.extract() {
        Ok(Setting::Count(count)) => Ok(json!(count)),
        // JSON has no numbers for these and would write null.
        Ok(Setting::Number(number)) if !number.is_finite() => {
            Err(refused(said, &format!("expected a finite number, not {number}")))
        }
        Ok(Setting::Number(number)) => Ok(json!(number)),
        Ok(Setting::Names(names)) => Ok(json!(names)),
        Ok(Setting::Numbers(numbers)) => Ok(json!(numbers)),
        Err(_) => Err(PyTypeError::new_err(format!("{said} cannot be {}", setting.repr()?))),
    }
}

/// serde names Rust's types.
fn refused(said: &str, why: &str) -> PyErr {
    let whole = "expected a whole number, 0 or more";
    let why = why
        .replace("expected usize", whole)
        .replace("expected u32", whole)
        .replace("expected f64", "expected a number");
    raised(format!("{said}: {why}"), Some("leave it out for its default".into()))
}
