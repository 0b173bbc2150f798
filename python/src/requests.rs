//! Requests as JSON texts.

use gripfast::error::Error;
use gripfast::request::Request;
use pyo3::prelude::*;
use serde_json::{Map, Value};

use crate::errors::{OrRaise, json};

/// Tables of a request whose fields are named as flags are, without the table.
const TABLES: [&str; 4] = ["candidates", "scoring", "selection", "output"];

pub(crate) fn read(text: &str) -> PyResult<Request> {
    serde_json::from_str(text).map_err(|error| wrong(&error)).or_raise()
}

fn wrong(error: &serde_json::Error) -> Error {
    Error::format("request", error.to_string(), "the fields are those of a request file")
}

/// The request that says nothing.
#[pyfunction]
pub(crate) fn request_default() -> PyResult<String> {
    json(&Request::default())
}

/// The request, checked, with every default stated.
#[pyfunction]
pub(crate) fn request_check(text: &str) -> PyResult<String> {
    let request = read(text)?;
    request.check().or_raise()?;
    json(&request)
}

/// The request with one more field, in whichever of its tables that is; `value` is JSON.
#[pyfunction]
pub(crate) fn request_set(text: &str, field: &str, value: &str) -> PyResult<String> {
    let value: Value = serde_json::from_str(value).map_err(|error| wrong(&error)).or_raise()?;
    let Value::Object(fields) =
        serde_json::to_value(read(text)?).map_err(|error| wrong(&error)).or_raise()?
    else {
        return request_check(text);
    };
    if value.is_null() {
        let mut fields = fields.clone();
        let table = TABLES
            .iter()
            .find(|table| fields.get(**table).is_some_and(|inner| inner.get(field).is_some()));
        let gone = match table {
            Some(table) => fields[*table].as_object_mut().and_then(|inner| inner.remove(field)),
            None => fields.remove(field),
        };
        if gone.is_some() {
            return json(&read(&Value::Object(fields).to_string())?);
        }
    }
    let unknown = format!("unknown field `{field}`");
    for table in [None].into_iter().chain(TABLES.map(Some)) {
        let mut fields = fields.clone();
        place(&mut fields, table, field, value.clone());
        match serde_json::from_value::<Request>(Value::Object(fields)) {
            Ok(request) => return json(&request),
            Err(error) if error.to_string().starts_with(&unknown) => {}
            Err(error) => {
                return Err(Error::input(field, error.to_string(), "").with_options(&[]))
                    .or_raise();
            }
        }
    }
    let remedy = "the fields of a request are those of the flags of `gripfast plan`, with \
                  underscores";
    Err(Error::input(field, "is no field of a request", remedy)).or_raise()
}

/// Sets a field, or takes it out where the value is null.
fn place(fields: &mut Map<String, Value>, table: Option<&str>, field: &str, value: Value) {
    let target = match table {
        None => fields,
        Some(table) => {
            let entry = fields.entry(table).or_insert_with(|| Value::Object(Map::new()));
            let Value::Object(inner) = entry else { return };
            inner
        }
    };
    if field == "mass" {
        target.remove("density");
    } else if field == "density" {
        target.remove("mass");
    }
    match (target.get_mut(field), value) {
        // A table of fields: those that are given.
        (Some(Value::Object(inner)), Value::Object(over)) => inner.extend(over),
        (_, value) => drop(target.insert(field.to_owned(), value)),
    }
}

/// A request file's text.
#[pyfunction]
pub(crate) fn request_from_toml(text: &str) -> PyResult<String> {
    json(&Request::from_toml("request", text).or_raise()?)
}

/// The request as a file that `gripfast plan --request` reads.
#[pyfunction]
pub(crate) fn request_to_toml(text: &str) -> PyResult<String> {
    Ok(read(text)?.to_toml())
}
