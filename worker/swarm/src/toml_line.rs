//! Messages on one line of TOML, for the cells of tables.

use crate::{Invalid, text, toml_file};
use serde::{Serialize, de::DeserializeOwned};

/// The fields of a message that differ from those of `other`, as an inline table of TOML; `None` if none differs.
/// [`of_toml_line`] reads the table.
#[must_use]
pub fn to_differing_line<T: Serialize>(message: &T, other: &T) -> Option<String> {
    let mut fields = toml::Table::try_from(message).unwrap_or_default();
    let others = toml::Table::try_from(other).unwrap_or_default();
    fields.retain(|name, value| others.get(name) != Some(value));
    (!fields.is_empty()).then(|| toml::Value::from(fields).to_string())
}

/// Reads a table of a campaign file that is written on one line, such as `example`, into a message.
///
/// # Errors
/// The error names `field`, and the field of the table that is wrong.
pub fn of_toml_line<T: DeserializeOwned>(field: &str, line: &str, example: &str) -> Result<T, Invalid> {
    let refused = |why: &str| {
        let allowed = format!("a table of a campaign file on one line, such as {example}{why}");
        Invalid::new(field, text::quoted(line), allowed)
    };
    let file: toml::Table = format!("line = {line}").parse().map_err(|_| refused(""))?;
    // A line break would begin a second field.
    let mut values = file.into_iter().map(|(_, value)| value);
    match (values.next(), values.next()) {
        (Some(toml::Value::Table(table)), None) => {
            toml_file::read_section(field, &table.to_string()).map_err(|error| refused(&format!("; {error}")))
        }
        _ => Err(refused("")),
    }
}
