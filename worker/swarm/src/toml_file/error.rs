//! Messages of errors in files that people write. Serde's own messages are for programmers.

use super::deserializer::{ErrorKind, FieldError};
use crate::{
    Text,
    spec_sections::{SECTIONS, Section},
    text::{beginning, nearest},
};
use std::{fmt, ops::Range};

/// Maximum number of characters of a line that an error quotes.
const LONGEST_QUOTED: usize = 400;

/// An error in a file that people write: where it is, what is wrong, and what is allowed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TomlError {
    field: String,
    wrong_type: Option<Box<WrongType>>,
    place: Option<Box<Place>>,
    words: Text,
}

/// A value of a wrong type.
#[derive(Debug, Clone, PartialEq, Eq)]
struct WrongType {
    found: String,
    allowed: String,
}

/// A place in a file.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Place {
    /// The line of the file, from 1, like the column.
    line: usize,
    column: usize,
    /// The line with marks below it; empty if the line is too long to read.
    quoted: String,
}

impl TomlError {
    /// Path of the field, such as `search.population`; empty if the text is not TOML.
    #[must_use]
    pub fn field(&self) -> &str {
        &self.field
    }

    /// The value, if its type is wrong.
    #[must_use]
    pub fn value(&self) -> Option<&str> {
        self.wrong_type.as_ref().map(|wrong| wrong.found.as_str())
    }

    /// The allowed values, if the type of [`TomlError::value`] is wrong.
    #[must_use]
    pub fn allowed(&self) -> Option<&str> {
        self.wrong_type.as_ref().map(|wrong| wrong.allowed.as_str())
    }

    /// The line of the file, from 1; `None` if the fields were not read from a file.
    #[must_use]
    pub fn line(&self) -> Option<usize> {
        self.place.as_ref().map(|place| place.line)
    }

    pub(super) fn of_syntax(text: &str, error: &toml::de::Error) -> Self {
        Self {
            field: String::new(),
            wrong_type: None,
            place: error.span().map(|span| Box::new(Place::of(text, &span))),
            words: Text::line(&not_toml(error.message())),
        }
    }

    /// An error about a field of `section`.
    pub(super) fn of_field(text: &str, section: &str, error: FieldError) -> Self {
        let mut path: Vec<&str> = section.split('.').filter(|name| !name.is_empty()).collect();
        path.extend(error.path.iter().map(String::as_str));
        let wrong_type = match &error.kind {
            ErrorKind::WrongType { found, allowed } => Some(Box::new(WrongType {
                found: beginning(found, LONGEST_QUOTED).into_owned(),
                allowed: allowed.clone(),
            })),
            _ => None,
        };
        Self {
            words: Text::line(&field_words(&path, &error.kind)),
            field: path.join("."),
            wrong_type,
            place: error.span.map(|span| Box::new(Place::of(text, &span))),
        }
    }

    pub(super) fn without_place(self) -> Self {
        Self { place: None, ..self }
    }
}

impl fmt::Display for TomlError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            let Place { line, column, quoted } = &**place;
            writeln!(f, "TOML parse error at line {line}, column {column}")?;
            f.write_str(quoted)?;
        }
        write!(f, "{}", self.words)
    }
}

impl std::error::Error for TomlError {}

impl Place {
    fn of(text: &str, span: &Range<usize>) -> Self {
        let before = text.get(..span.start).unwrap_or(text);
        let begin = before.rfind('\n').map_or(0, |end| end + 1);
        let line = 1 + before.matches('\n').count();
        let column = 1 + before.get(begin..).unwrap_or_default().chars().count();
        let quoted = text.get(begin..).unwrap_or_default();
        let quoted = quoted.lines().next().unwrap_or_default();
        let marked = text.get(span.clone()).unwrap_or_default();
        let marked = marked.lines().next().unwrap_or_default().chars().count().max(1);
        Self {
            line,
            column,
            quoted: match quoted.chars().nth(LONGEST_QUOTED) {
                Some(_) => String::new(),
                None => Self::quote(line, column, quoted, marked),
            },
        }
    }

    /// The line with marks below the `marked` characters from `column` on.
    fn quote(line: usize, column: usize, quoted: &str, marked: usize) -> String {
        let gutter = " ".repeat(line.to_string().len());
        let indent = " ".repeat(column - 1);
        let marks = "^".repeat(marked);
        let quote = format!("{gutter} |\n{line} | {quoted}\n{gutter} | {indent}{marks}\n");
        Text::lines(&quote).to_string()
    }
}

/// The error about the field at `path`, as a sentence.
fn field_words(path: &[&str], kind: &ErrorKind) -> String {
    let (name, section) = match path.split_last() {
        Some((name, outer)) => (*name, outer.join(".")),
        None => ("", String::new()),
    };
    match kind {
        ErrorKind::WrongType { found, allowed } => {
            let named = match path {
                [] => String::new(),
                path => format!("{} ", path.join(".")),
            };
            format!("{named}must be {allowed}, not {found}")
        }
        ErrorKind::UnknownValue { value, known } => {
            let meant = nearest(value, known.iter().copied());
            let meant = meant.map_or(".".to_owned(), |meant| format!(": did you mean `{meant}`?"));
            let named = match path {
                [] => String::new(),
                path => format!(" of {}", path.join(".")),
            };
            format!(
                "unknown value `{value}`{named}{meant} It may be {}",
                list(known, "or")
            )
        }
        ErrorKind::UnknownField { inner, known } => unknown_field(name, inner, &section, known),
        ErrorKind::MissingField { name } => match path {
            [] => format!("the field `{name}` is missing"),
            path => format!("{}: the field `{name}` is missing", path.join(".")),
        },
        ErrorKind::Other(words) => words.clone(),
    }
}

/// The parser's `message` about a text that is not TOML. Messages of frequent errors become plain words.
fn not_toml(message: &str) -> String {
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
        "duplicate key" => "this field, or its section, occurs twice".to_owned(),
        other => other.to_owned(),
    }
}

/// The message about an unknown field. The message names the known fields, and the field that its author probably meant, judging
/// by name and contents.
fn unknown_field(name: &str, inner: &[String], section: &str, known: &[&str]) -> String {
    // The path of a field in a separate text has no name of the text's table. A robot's sensors may be in a species.
    let bare = without_places(section);
    let same = SECTIONS.iter().find(|Section { path, fields }| {
        let near = path.starts_with(&bare) || (!path.is_empty() && bare.ends_with(path));
        near && fields.iter().map(|field| field.name).eq(known.iter().copied())
    });
    let (within, here) = match same.map_or(section, |section| section.path) {
        "" => (String::new(), "The top of the file".to_owned()),
        section => (format!(" in [{section}]"), format!("[{section}]")),
    };
    let meant = meant(name, inner, known);
    let meant = meant.map_or(".".to_owned(), |meant| format!(": {meant}"));
    let fields = list(known, "and");
    format!("unknown field `{name}`{within}{meant} {here} has {fields}")
}

/// Removes the places in lists: `species.robot.sensors` of `species[0].robot.sensors[1]`.
fn without_places(section: &str) -> String {
    let mut parts = section.split('[');
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |bare, part| match part.split_once(']') {
        Some((place, rest)) if place.parse::<usize>().is_ok() => bare + rest,
        _ => bare + "[" + part,
    })
}

/// Names that other simulators give to fields, those fields, and how the values differ.
const ELSEWHERE: [(&str, &str, &str); 9] = [
    ("fov", "half_angle", HALF),
    ("field_of_view", "half_angle", HALF),
    ("view_angle", "half_angle", HALF),
    ("cone", "half_angle", HALF),
    ("bearing", "angle", ", in radians from straight ahead"),
    ("direction", "angle", ", in radians from straight ahead"),
    ("distance", "range", ""),
    ("max_range", "range", ""),
    ("detects", "sees", ""),
];

const HALF: &str = ", half of the field of view, in radians";

/// The section where a misplaced field belongs, or the field that may have been meant.
fn meant(name: &str, inner: &[String], known: &[&str]) -> Option<String> {
    let homes = |name: &str| {
        let homes = SECTIONS.iter().filter(|section| section.has(name));
        let homes: Vec<String> = homes.map(|section| place(section.path)).collect();
        (!homes.is_empty()).then(|| homes.join(" or "))
    };
    let near = |known: &mut dyn Iterator<Item = &str>| nearest(name, known).map(str::to_owned);
    if let Some(homes) = homes(name) {
        return Some(format!("it belongs {homes}."));
    }
    let elsewhere = ELSEWHERE
        .iter()
        .find(|(other, meant, _)| *other == name && known.contains(meant));
    if let Some((_, meant, how)) = elsewhere {
        return Some(format!("here it is `{meant}`{how}."));
    }
    if let Some(meant) = near(&mut known.iter().copied()) {
        return Some(format!("did you mean `{meant}`?"));
    }
    let mut inner = inner.iter();
    if let Some((name, homes)) = inner.find_map(|name| Some((name, homes(name)?))) {
        return Some(format!("its `{name}` belongs {homes}."));
    }
    let mut fields = SECTIONS
        .iter()
        .flat_map(|section| section.fields.iter().map(|field| field.name));
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

fn list(names: &[&str], before_last: &str) -> String {
    let quoted: Vec<String> = names.iter().map(|name| format!("`{name}`")).collect();
    match quoted.split_last() {
        None => "nothing".to_owned(),
        Some((last, [])) => last.clone(),
        Some((last, others)) => format!("{} {before_last} {last}", others.join(", ")),
    }
}
