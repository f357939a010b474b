//! Reads the TOML files that people write. An error names the field, its line, and the allowed values.

mod deserializer;
mod error;
#[cfg(test)]
mod tests;

use deserializer::{FieldError, Node};
use murmuration_proto::v1;
use serde::de::DeserializeOwned;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

pub use error::TomlError;

/// Reads a campaign file.
pub(crate) fn campaign(text: &str) -> Result<v1::CampaignSpec, TomlError> {
    read_toml(text)
}

/// Reads a campaign file from a table in memory. Errors have no line.
pub(crate) fn campaign_of_table(table: &toml::Table) -> Result<v1::CampaignSpec, TomlError> {
    campaign(&table.to_string()).map_err(TomlError::without_place)
}

/// Reads a file that people write, whose fields are those of `T`. Ignores a byte order mark, and accepts any kind of line ends.
///
/// # Errors
/// The error names the place that is not TOML, the unknown field, or the value of the wrong type.
pub fn read_toml<T: DeserializeOwned>(text: &str) -> Result<T, TomlError> {
    read(text, "", |file| T::deserialize(file))
}

/// Reads the table `section` of a campaign file from a separate text, as messages hold the table. Errors have no line.
pub(crate) fn read_section<T: DeserializeOwned>(section: &str, text: &str) -> Result<T, TomlError> {
    read(text, section, |file| T::deserialize(file)).map_err(TomlError::without_place)
}

/// Parses a text; `fields` reads the parsed text as the table `section` of a campaign file.
fn read<T>(
    text: &str,
    section: &str,
    fields: impl FnOnce(Node<'_>) -> Result<T, FieldError>,
) -> Result<T, TomlError> {
    let text = text
        .strip_prefix('\u{feff}')
        .unwrap_or(text)
        .replace("\r\n", "\n");
    let table = DeTable::parse(&text).map_err(|error| TomlError::of_syntax(&text, &error))?;
    let span = table.span();
    let root = Spanned::new(span, DeValue::Table(table.into_inner()));
    fields(Node(&root)).map_err(|error| TomlError::of_field(&text, section, error))
}
