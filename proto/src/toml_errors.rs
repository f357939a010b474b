//! Errors in campaign files, in words for their authors. Serde's messages are for programmers.

use crate::{
    Text,
    spec_sections::{quoted_names, sections},
    text::nearest,
    training::{Recipe, Settings},
    v1,
};
use serde::{Deserialize, de::DeserializeOwned};
use std::ops::Range;
use toml::{
    Spanned,
    de::{DeTable, DeValue},
};

/// Characters of the longest line of a file that is repeated in an error.
const LONGEST_QUOTED: usize = 400;

/// An error in a campaign file: where it is, what is wrong, and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TomlError(Text);

/// The tables that the message of a campaign holds as texts, without their places in the file.
#[derive(Deserialize)]
struct TextTables {
    #[serde(rename = "training")]
    _training: Option<Settings>,
    #[serde(rename = "feedback")]
    _feedback: Option<RecipeTable>,
}

#[derive(Deserialize)]
struct RecipeTable {
    #[serde(rename = "recipe")]
    _recipe: Option<Recipe>,
}

/// Reads a campaign file.
pub(crate) fn campaign(text: &str) -> Result<v1::CampaignSpec, TomlError> {
    let message = read_toml(text)?;
    read_toml::<TextTables>(text)?;
    Ok(message)
}

/// Reads a campaign file that was put together as a table, so that errors have no position.
pub(crate) fn campaign_of_table(table: toml::Table) -> Result<v1::CampaignSpec, TomlError> {
    let read = || -> Result<v1::CampaignSpec, toml::de::Error> {
        let message = table.clone().try_into()?;
        table.clone().try_into::<TextTables>()?;
        Ok(message)
    };
    read().map_err(|error| TomlError(Text::line(&within("", &error))))
}

/// Reads a file that people write, whose fields are those of `T`. A byte order mark and the kind of line ends make no
/// difference.
///
/// # Errors
/// Says where the text is not TOML, which field is unknown, or which value is of the wrong type.
pub fn read_toml<T: DeserializeOwned>(text: &str) -> Result<T, TomlError> {
    let text = text
        .strip_prefix('\u{feff}')
        .unwrap_or(text)
        .replace("\r\n", "\n");
    toml::from_str(&text).map_err(|error| {
        let shown = error.to_string();
        let place = shown.trim_end().strip_suffix(error.message()).unwrap_or_default();
        let what = match DeTable::parse(&text) {
            Ok(table) => {
                let field = error.span().and_then(|span| find(table.get_ref(), &span));
                what_is_wrong(error.message(), &field.unwrap_or_default())
            }
            Err(_) => what_is_no_toml(error.message()),
        };
        TomlError(Text::lines(&format!("{}{}", readable(place), Text::line(&what))))
    })
}

/// The place of an error with the line of the file that it quotes, or without a line that is longer than a person reads.
fn readable(place: &str) -> &str {
    let is_long = |line: &str| line.chars().nth(LONGEST_QUOTED).is_some();
    match place.lines().any(is_long) {
        true => place.split_inclusive('\n').next().unwrap_or_default(),
        false => place,
    }
}

/// The error in `section`, which was read from a table and so has no position in the file.
pub(crate) fn within(section: &str, error: &toml::de::Error) -> String {
    let shown = error.to_string();
    let inner = shown
        .trim_end()
        .rsplit_once("\nin `")
        .map(|(_, rest)| rest.trim_end_matches('`'));
    let keys = inner.into_iter().flat_map(|keys| keys.split('.'));
    let field = Field {
        path: section
            .split('.')
            .chain(keys)
            .filter(|key| !key.is_empty())
            .map(str::to_owned)
            .collect(),
        inner: Vec::new(),
    };
    what_is_wrong(error.message(), &field)
}

/// The field of an error.
#[derive(Debug, Default)]
struct Field {
    /// The names of its tables and its own name; without a position in the file, only those of the tables.
    path: Vec<String>,
    /// The fields in it, if it is a table.
    inner: Vec<String>,
}

/// Translates serde's `message` about a field.
fn what_is_wrong(message: &str, field: &Field) -> String {
    let path = &field.path[..];
    let Some((what, expected)) = message.rsplit_once(", expected ") else {
        return message.to_owned();
    };
    let found = what
        .strip_prefix("invalid type: ")
        .or_else(|| what.strip_prefix("invalid value: "))
        .or_else(|| what.strip_prefix("invalid "));
    if let Some(found) = found {
        let named = match path {
            [] => String::new(),
            path => format!("{} ", path.join(".")),
        };
        let found = quoted_names(found).next().unwrap_or(found);
        let found = match found.strip_prefix("string ").unwrap_or(found) {
            "map" => "a table",
            "sequence" => "a list",
            other => other,
        };
        return format!("{named}must be {}, not {found}", allowed(expected, found));
    }
    let Some(name) = quoted_names(what).next() else {
        return message.to_owned();
    };
    let known: Vec<&str> = quoted_names(expected).collect();
    if what.starts_with("unknown variant") {
        let meant = nearest(name, known.iter().copied());
        let meant = meant.map_or(String::new(), |meant| format!("did you mean `{meant}`? "));
        return format!("unknown value `{name}`: {meant}It may be {}", list(&known, "or"));
    }
    // With a position, the path ends with the field itself.
    let section = match path.split_last() {
        Some((last, outer)) if last == name => outer.join("."),
        _ => path.join("."),
    };
    unknown_field(name, &field.inner, &section, &known)
}

/// Translates the `message` about a text that is not TOML.
fn what_is_no_toml(message: &str) -> String {
    match message {
        "invalid basic string, expected `\"`" => {
            "this text has no \" at its end: it must end on the line where it begins".to_owned()
        }
        "invalid literal string, expected `'`" => {
            "this text has no ' at its end: it must end on the line where it begins".to_owned()
        }
        "string values must be quoted, expected literal string" => {
            "a value must be a number, true, false, a text in quotes, a list in [ ] or a table in { }"
                .to_owned()
        }
        "duplicate key" => "this field, or its section, is there twice".to_owned(),
        other => other.to_owned(),
    }
}

/// The message about an unknown field: which field may have been meant, judging by its name and contents, and which fields
/// exist.
fn unknown_field(name: &str, inner: &[String], section: &str, known: &[&str]) -> String {
    let sections = sections();
    // The path of a recipe's field contains the recipe's name, but the path of an error about it does not. A robot's sensors may
    // be in a species.
    let bare = without_places(section);
    let same = sections.iter().find(|(name, fields)| {
        let near = name.starts_with(&bare) || (!name.is_empty() && bare.ends_with(name));
        near && fields.iter().eq(known)
    });
    let (within, here) = match same.map_or(section, |(name, _)| *name) {
        "" => (String::new(), "The top of the file".to_owned()),
        section => (format!(" in [{section}]"), format!("[{section}]")),
    };
    let meant = meant(name, inner, known, &sections);
    let meant = meant.map_or(".".to_owned(), |meant| format!(": {meant}"));
    let fields = list(known, "and");
    format!("unknown field `{name}`{within}{meant} {here} has {fields}")
}

/// `species.robot.sensors` of `species[0].robot.sensors[1]`.
fn without_places(section: &str) -> String {
    let mut parts = section.split('[');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |bare, part| match part.split_once(']') {
        Some((place, rest)) if place.parse::<usize>().is_ok() => bare + rest,
        _ => bare + "[" + part,
    })
}

/// The section where a misplaced field belongs, or the field that may have been meant.
fn meant(name: &str, inner: &[String], known: &[&str], sections: &[(&str, Vec<String>)]) -> Option<String> {
    let homes = |name: &str| {
        let has = |fields: &[String]| fields.iter().any(|field| field == name);
        let homes = sections.iter().filter(|(_, fields)| has(fields));
        let homes: Vec<String> = homes.map(|(section, _)| place(section)).collect();
        (!homes.is_empty()).then(|| homes.join(" or "))
    };
    let near = |known: &mut dyn Iterator<Item = &str>| nearest(name, known).map(str::to_owned);
    if let Some(homes) = homes(name) {
        return Some(format!("it belongs {homes}."));
    }
    if let Some(meant) = near(&mut known.iter().copied()) {
        return Some(format!("did you mean `{meant}`?"));
    }
    let mut inner = inner.iter();
    if let Some((name, homes)) = inner.find_map(|name| Some((name, homes(name)?))) {
        return Some(format!("its `{name}` belongs {homes}."));
    }
    let mut fields = sections.iter().flat_map(|(_, fields)| fields).map(String::as_str);
    let meant = near(&mut fields)?;
    let homes = homes(&meant)?;
    Some(format!("did you mean `{meant}`, which belongs {homes}?"))
}

/// The place of a section's fields in a campaign file.
fn place(section: &str) -> String {
    match section {
        "" => "at the top of the file, before every [section]".to_owned(),
        section => format!("in [{section}]"),
    }
}

/// The allowed values for a type that serde names, where the value is `found`. The limits of a field are said by the field,
/// once its value is of the type at all.
fn allowed(expected: &str, found: &str) -> String {
    match expected {
        "u8" | "u16" | "u32" | "u64" | "usize" => match found.parse::<u64>() {
            Ok(_) => "a smaller whole number".to_owned(),
            Err(_) => "a whole number, 0 or more".to_owned(),
        },
        "i32" | "i64" => "a whole number".to_owned(),
        "f32" | "f64" => "a number".to_owned(),
        "a boolean" => "true or false".to_owned(),
        "a string" => "a text in quotes".to_owned(),
        "a sequence" => match found {
            "a table" => {
                "a list of tables: [{ ... }], or tables with two brackets around the name".to_owned()
            }
            _ if found.starts_with('"') => format!("a list such as [{found}]"),
            _ => "a list such as [1, 2]".to_owned(),
        },
        "a map" => "a table".to_owned(),
        other if other.starts_with("struct ") => "a table".to_owned(),
        other => match other.strip_prefix("an array of length ") {
            Some(length) => format!("a list of {length}"),
            None => other.to_owned(),
        },
    }
}

fn list(names: &[&str], before_last: &str) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        None => "nothing".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} {before_last} {last}", others.join(", ")),
    }
}

/// The field whose name or value is at `span`.
fn find(table: &DeTable<'_>, span: &Range<usize>) -> Option<Field> {
    let names = |table: &DeTable<'_>| table.keys().map(|name| name.get_ref().to_string()).collect();
    table.iter().find_map(|(name, value)| {
        if name.span() == *span || value.span() == *span || is_item(value.get_ref(), span) {
            return Some(Field {
                path: vec![name.get_ref().to_string()],
                inner: value.get_ref().as_table().map_or_else(Vec::new, names),
            });
        }
        let (mut field, name) = match value.get_ref() {
            DeValue::Table(inner) => (find(inner, span)?, name.get_ref().to_string()),
            DeValue::Array(values) => {
                let mut tables = values.iter().map(|value| value.get_ref().as_table()).enumerate();
                let (place, found) = tables.find_map(|(place, table)| Some((place, find(table?, span)?)))?;
                (found, format!("{}[{place}]", name.get_ref()))
            }
            _ => return None,
        };
        field.path.insert(0, name);
        Some(field)
    })
}

/// Whether an item of a list, or of a list in it, is at `span`.
fn is_item(value: &DeValue<'_>, span: &Range<usize>) -> bool {
    let is_here = |item: &Spanned<DeValue<'_>>| item.span() == *span || is_item(item.get_ref(), span);
    value.as_array().is_some_and(|items| items.iter().any(is_here))
}

#[cfg(test)]
mod tests;
