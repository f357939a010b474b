//! What people write: names of classes, of themselves and of requests, answers, colours.

use crate::judge::Class;
use murmuration_proto::Invalid;
use std::{fmt, str::FromStr};

/// Most characters of a name.
const MAX_CHARS: usize = 64;

/// The name of a class: 1 to 64 characters, none a control character, no space at either end, and neither of the words
/// for [`Answer::NotSure`] and [`Answer::Skip`].
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassName(String);

/// Who answered: 1 to 64 characters, none a control character, no space at either end.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Annotator(String);

/// What a client calls a request, so that a repetition is known as one: 1 to 64 characters, none a control character,
/// no space at either end.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestId(String);

/// What somebody answered when asked for the class of a behaviour. As text it is a class, `not sure` or `skip`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    /// It is of this class.
    Class(ClassName),
    /// They looked, and could not say.
    NotSure,
    /// They would not say.
    Skip,
}

/// A colour of a class: red, green and blue in sRGB. As text `#rrggbb`, hexadecimal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour([u8; 3]);

/// `text` without the space about it, if it can be a name.
fn name(field: &str, text: &str) -> Result<String, Invalid> {
    let trimmed = text.trim();
    let count = trimmed.chars().count();
    if (1..=MAX_CHARS).contains(&count) && !trimmed.chars().any(char::is_control) {
        return Ok(trimmed.to_owned());
    }
    let allowed = format!("1 to {MAX_CHARS} characters, none a control character");
    Err(Invalid::new(field, shown(text), allowed))
}

/// The beginning of a text that came from outside.
fn shown(text: &str) -> String {
    let beginning: String = text.chars().take(80).collect();
    format!("\"{}\"", beginning.escape_debug())
}

macro_rules! names {
    ($($type:ident),*) => { $(
        impl $type {
            /// The name as text.
            #[must_use]
            pub fn as_str(&self) -> &str {
                &self.0
            }
        }

        impl fmt::Display for $type {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(&self.0)
            }
        }
    )* };
}

names!(ClassName, Annotator, RequestId);

impl Annotator {
    /// The synthetic annotator: the judge that answers in a person's place.
    #[must_use]
    pub fn synthetic() -> Self {
        Self("synthetic".to_owned())
    }
}

impl RequestId {
    /// What the synthetic annotator calls its answers in a round (from 1) that nobody attends.
    #[must_use]
    pub fn of_round(round: u32) -> Self {
        Self(format!("synthetic-round-{round}"))
    }

    /// What answers are withdrawn by that are about individuals which are not there any more: nobody asked for it.
    #[must_use]
    pub fn of_withdrawal() -> Self {
        Self("withdrawal".to_owned())
    }
}

impl From<Class> for ClassName {
    fn from(class: Class) -> Self {
        Self(class.name().to_owned())
    }
}

impl FromStr for ClassName {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        match text.parse()? {
            Answer::Class(class) => Ok(class),
            Answer::NotSure | Answer::Skip => {
                let allowed = format!(
                    "another word than \"{}\" and \"{}\"",
                    Answer::NOT_SURE,
                    Answer::SKIP
                );
                Err(Invalid::new("class", shown(text), allowed))
            }
        }
    }
}

impl FromStr for Annotator {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        name("annotator", text).map(Self)
    }
}

impl FromStr for RequestId {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        name("request_id", text).map(Self)
    }
}

impl Answer {
    const NOT_SURE: &str = "not sure";
    const SKIP: &str = "skip";

    /// The answer as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        match self {
            Self::Class(class) => class.as_str(),
            Self::NotSure => Self::NOT_SURE,
            Self::Skip => Self::SKIP,
        }
    }
}

impl fmt::Display for Answer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.as_str())
    }
}

impl FromStr for Answer {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        Ok(match name("class", text)? {
            word if word == Self::NOT_SURE => Self::NotSure,
            word if word == Self::SKIP => Self::Skip,
            class => Self::Class(ClassName(class)),
        })
    }
}

impl From<[u8; 3]> for Colour {
    fn from(rgb: [u8; 3]) -> Self {
        Self(rgb)
    }
}

impl fmt::Display for Colour {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue] = self.0;
        write!(f, "#{red:02x}{green:02x}{blue:02x}")
    }
}

impl FromStr for Colour {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let digits = text
            .strip_prefix('#')
            .filter(|digits| digits.len() == 6 && digits.bytes().all(|byte| byte.is_ascii_hexdigit()))
            .and_then(|digits| u32::from_str_radix(digits, 16).ok());
        match digits.map(u32::to_be_bytes) {
            Some([_, red, green, blue]) => Ok(Self([red, green, blue])),
            None => Err(Invalid::new(
                "colour",
                shown(text),
                "#rrggbb, six hexadecimal digits",
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn names_are_trimmed_and_bounded() {
        assert_eq!(" a ring ".parse::<ClassName>().unwrap().as_str(), "a ring");
        assert_eq!("é".repeat(64).parse::<Annotator>().unwrap().as_str().len(), 128);
        for bad in ["", "  ", &"x".repeat(65), "a\nb", "a\0"] {
            assert_eq!(bad.parse::<ClassName>().unwrap_err().field, "class");
            assert_eq!(bad.parse::<Annotator>().unwrap_err().field, "annotator");
            assert_eq!(bad.parse::<RequestId>().unwrap_err().field, "request_id");
        }
    }

    #[test]
    fn answers_that_are_no_class_are_no_names_of_classes() {
        for (word, answer) in [("not sure", Answer::NotSure), (" skip", Answer::Skip)] {
            assert_eq!(word.parse::<Answer>().unwrap(), answer);
            let said = word.parse::<ClassName>().unwrap_err().to_string();
            assert!(said.contains("another word than"), "{said}");
        }
        assert!(matches!("skipping".parse(), Ok(Answer::Class(_))));
    }

    #[test]
    fn a_colour_is_six_digits() {
        assert_eq!("#1a2B3c".parse::<Colour>().unwrap().to_string(), "#1a2b3c");
        for bad in ["", "1a2b3c", "#1a2b3", "#1a2b3c4", "#+a2b3c", "#é2b3c"] {
            assert_eq!(bad.parse::<Colour>().unwrap_err().field, "colour");
        }
    }

    proptest! {
        #[test]
        fn what_parses_reads_back(text in any::<String>()) {
            if let Ok(answer) = text.parse::<Answer>() {
                prop_assert_eq!(answer.as_str().parse::<Answer>().unwrap(), answer);
            }
        }
    }
}
