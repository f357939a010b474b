//! Values of a campaign file on one line, for the cells of tables.

use crate::{Invalid, text};
use serde::{Serialize, de::DeserializeOwned};
use std::collections::BTreeMap;

/// A message that people write in campaign files, as an inline table or list of TOML: `{ slip = 0.05 }`. [`of_toml_line`] reads
/// it.
#[must_use]
pub fn to_toml_line(message: &impl Serialize) -> String {
    toml::Value::try_from(message).map_or_else(|_| String::new(), |value| value.to_string())
}

/// Reads what [`to_toml_line`] wrote.
///
/// # Errors
/// Names `field` if the line is no such table or list; `example` is one.
pub fn of_toml_line<T: DeserializeOwned>(field: &str, line: &str, example: &str) -> Result<T, Invalid> {
    let refused = || {
        let allowed = format!("as in a campaign file, on one line, such as {example}");
        Invalid::new(field, text::quoted(line), allowed)
    };
    let table = toml::from_str::<BTreeMap<String, T>>(&format!("line = {line}"));
    // A line break would begin a second field.
    let lines = table.map_err(|_| refused())?;
    let mut values = lines.into_values();
    match (values.next(), values.next()) {
        (Some(value), None) => Ok(value),
        _ => Err(refused()),
    }
}
