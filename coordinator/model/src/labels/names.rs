//! Texts of annotators: names of classes, annotators and requests, answers, colours.

use icu_casemap::CaseMapper;
use icu_normalizer::{ComposingNormalizer, DecomposingNormalizer};
use murmuration_swarm::{
    Class, Invalid,
    text::{name, quoted},
};
use std::{fmt, str::FromStr};

/// Maximum number of characters of a name.
const MAX_CHARS: usize = 64;

/// The displayed name of a class: 1 to 64 visible characters, no space at either end, and neither of the words for
/// [`Answer::NotSure`] and [`Answer::Skip`]. The name's [`ClassKey`] identifies the class.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassName(String);

/// Identifies a class: names that differ only in case (`Straße` and `STRASSE`), in the Unicode form of their letters, or in the
/// separators of their words (spaces, hyphens, underscores), mean the same class.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ClassKey(String);

/// The name of an annotator: 1 to 64 visible characters, no space at either end. A person cannot have the name of the synthetic
/// annotator, whose answers do not count as a person's.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Annotator(String);

/// Id of a client's request, by which a repeated request is recognised: 1 to 64 visible characters, no space at either end. A
/// client's id must not begin like the coordinator's own ids: `synthetic-round-` and `withdrawal`.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct RequestId(String);

/// An annotator's answer about the class of a behaviour. As text, an answer is a class, `not sure` or `skip`. The words
/// `not sure` and `skip` can have any spelling with the same [`ClassKey`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Answer {
    Class(ClassName),
    /// The annotator looked at the behaviour, and could not decide.
    NotSure,
    /// The annotator declined to answer.
    Skip,
}

/// A colour of a class: red, green and blue in sRGB. As text, a colour is `#rrggbb`, hexadecimal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour([u8; 3]);

/// `text` with `_` between its words, in one form for all texts that differ only in case or in the Unicode form of their letters
/// (canonical caseless matching, Unicode's definition D145).
fn folded(text: &str) -> String {
    let words = text.split(|letter: char| letter.is_whitespace() || letter == '-' || letter == '_');
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let joined = match words.is_empty() {
        // The text consists of separators only.
        true => text.to_owned(),
        false => words.join("_"),
    };
    if joined.is_ascii() {
        return joined.to_ascii_lowercase();
    }
    let decomposed = DecomposingNormalizer::new_nfd().normalize(&joined);
    let folded = CaseMapper::new().fold_string(&decomposed);
    ComposingNormalizer::new_nfc().normalize(&folded).into_owned()
}

macro_rules! names {
    ($($type:ident),*) => { $(
        impl $type {
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

impl ClassKey {
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl ClassName {
    pub fn key(&self) -> ClassKey {
        ClassKey(folded(&self.0))
    }

    /// The name in the paper's spelling, if it means one of the paper's classes, or else unchanged.
    #[must_use]
    pub fn spelled(self) -> Self {
        let key = self.key();
        // The names of the paper's classes are their own keys.
        let paper = Class::ALL.into_iter().find(|class| class.name() == key.as_str());
        paper.map_or(self, Self::from)
    }

    /// The name in pages and reports: with spaces in place of underscores. Files and commands show the name with its own
    /// spelling.
    pub fn shown(&self) -> String {
        let words: Vec<&str> = self.0.split('_').filter(|word| !word.is_empty()).collect();
        match words.is_empty() {
            true => self.0.clone(),
            false => words.join(" "),
        }
    }
}

impl From<&str> for ClassKey {
    /// The key of a text as a class name.
    fn from(text: &str) -> Self {
        Self(folded(text))
    }
}

impl Annotator {
    const SYNTHETIC: &str = "synthetic";

    /// The synthetic annotator: the judge, which answers in place of a person.
    pub fn synthetic() -> Self {
        Self(Self::SYNTHETIC.to_owned())
    }

    /// Whether a name is the synthetic annotator's name, or reads like it. The comparison uses only letters and digits, and
    /// ignores case.
    pub fn is_synthetic(name: &str) -> bool {
        let read = name.chars().filter(|letter| letter.is_alphanumeric());
        read.flat_map(char::to_lowercase).eq(Self::SYNTHETIC.chars())
    }

    /// An annotator of an existing answer: a person, or the synthetic annotator, whose name [`str::parse`] refuses.
    ///
    /// # Errors
    /// If the text is not a valid name.
    pub fn known(text: &str) -> Result<Self, Invalid> {
        name("annotator", text, MAX_CHARS).map(Self)
    }
}

impl RequestId {
    const ROUND: &str = "synthetic-round-";
    const WITHDRAWAL: &str = "withdrawal";

    /// The request id of the synthetic annotator's answers in an unattended round (from 1).
    pub fn of_round(round: u32) -> Self {
        Self(format!("{}{round}", Self::ROUND))
    }

    /// The id of a request to another store, by a client or by that store's coordinator.
    ///
    /// # Errors
    /// If the text is not a valid id.
    pub fn known(text: &str) -> Result<Self, Invalid> {
        name("request_id", text, MAX_CHARS).map(Self)
    }

    /// The request id of withdrawals of answers whose individuals were rolled back. No client makes a request with this id.
    pub fn of_withdrawal() -> Self {
        Self(Self::WITHDRAWAL.to_owned())
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
                    "a name other than \"{}\" and \"{}\"",
                    Answer::NOT_SURE,
                    Answer::SKIP
                );
                Err(Invalid::new("class", quoted(text), allowed))
            }
        }
    }
}

impl FromStr for Annotator {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        match Self::is_synthetic(text) {
            true => {
                let allowed = "a person's name: `synthetic` is the rule-based judge (`murmuration label --synthetic N`)";
                Err(Invalid::new("annotator", quoted(text), allowed))
            }
            // Two Unicode forms of a name are one annotator.
            false => Self::known(&ComposingNormalizer::new_nfc().normalize(text)),
        }
    }
}

impl FromStr for RequestId {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let id = name("request_id", text, MAX_CHARS)?;
        // If a client used one of the coordinator's ids, its request would pass for the coordinator's, and the coordinator could
        // not use the id.
        match [Self::ROUND, Self::WITHDRAWAL]
            .iter()
            .find(|own| id.starts_with(**own))
        {
            Some(own) => {
                let allowed =
                    format!("an id that does not begin with \"{own}\", which the coordinator reserves");
                Err(Invalid::new("request_id", quoted(text), allowed))
            }
            None => Ok(Self(id)),
        }
    }
}

impl Answer {
    const NOT_SURE: &str = "not sure";
    const SKIP: &str = "skip";

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
        Ok(match name("class", text, MAX_CHARS)? {
            word if folded(&word) == folded(Self::NOT_SURE) => Self::NotSure,
            word if folded(&word) == Self::SKIP => Self::Skip,
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
                quoted(text),
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
        for bad in [
            "",
            "  ",
            &"x".repeat(65),
            "a\nb",
            "a\0",
            "\u{200b}",
            "ring\u{200b}",
            "gn\u{202e}ir",
            "\u{2066}a",
        ] {
            assert_eq!(bad.parse::<ClassName>().unwrap_err().field, "class");
            assert_eq!(bad.parse::<Annotator>().unwrap_err().field, "annotator");
            assert_eq!(bad.parse::<RequestId>().unwrap_err().field, "request_id");
        }
    }

    #[test]
    fn names_in_other_forms_of_unicode_are_one_class() {
        let key = |name: &str| name.parse::<ClassName>().unwrap().key();
        // Composed and decomposed, with one letter or two.
        assert_eq!(key("M\u{fc}hle"), key("Mu\u{308}hle"));
        assert_eq!(key("Stra\u{df}e"), key("STRASSE"));
        assert_eq!(key("\u{3a3}\u{391}\u{3a3}"), key("\u{3c3}\u{3b1}\u{3c2}"));
        assert_eq!(key("Wall-Following"), key("wall following"));
        assert_ne!(key("Mühle"), key("Muhle"));
    }

    #[test]
    fn nobody_is_called_as_the_synthetic_annotator_is() {
        for taken in [
            "synthetic",
            " Synthetic ",
            "SYN THETIC",
            "syn-thetic_",
            "(synthetic)",
        ] {
            let error = taken.parse::<Annotator>().unwrap_err();
            assert_eq!(error.field, "annotator");
            assert!(error.allowed.contains("a person's name"), "{error}");
            assert!(Annotator::is_synthetic(taken));
            // Existing logs can contain names like the synthetic annotator's.
            assert!(Annotator::known(taken).is_ok());
        }
        for free in ["synthetic 2", "ana", "synthia"] {
            assert_eq!(free.parse::<Annotator>().unwrap().as_str(), free);
        }
        let own = Annotator::synthetic();
        assert_eq!(Annotator::known(own.as_str()), Ok(own));
    }

    #[test]
    fn answers_that_are_no_class_are_no_names_of_classes() {
        for (word, answer) in [
            ("not sure", Answer::NotSure),
            ("Not_Sure", Answer::NotSure),
            (" skip", Answer::Skip),
            ("SKIP", Answer::Skip),
        ] {
            assert_eq!(word.parse::<Answer>().unwrap(), answer);
            let message = word.parse::<ClassName>().unwrap_err().to_string();
            assert!(message.contains("a name other than"), "{message}");
        }
        assert!(matches!("skipping".parse(), Ok(Answer::Class(_))));
    }

    #[test]
    fn what_the_coordinator_calls_its_own_requests_nobody_else_may() {
        for own in [
            RequestId::of_round(1),
            RequestId::of_round(u32::MAX),
            RequestId::of_withdrawal(),
        ] {
            for taken in [own.to_string(), format!(" {own} "), format!("{own}-more")] {
                let error = taken.parse::<RequestId>().unwrap_err();
                assert_eq!(error.field, "request_id");
                assert!(
                    error.allowed.contains("which the coordinator reserves"),
                    "{error}"
                );
            }
        }
        for free in ["synthetic", "a withdrawal", "synthetic-rounds"] {
            assert_eq!(free.parse::<RequestId>().unwrap().as_str(), free);
        }
    }

    #[test]
    fn case_and_what_stands_between_words_do_not_tell_classes_apart() {
        let key = |name: &str| name.parse::<ClassName>().unwrap().key();
        for same in [
            "wall following",
            "Wall-Following",
            "wall__following",
            " WALL _following-",
        ] {
            assert_eq!(key(same), key("wall_following"), "{same}");
        }
        for other in ["wallfollowing", "wall_followed", "-", "_"] {
            assert_ne!(key(other), key("wall_following"), "{other}");
        }
        assert_ne!(key("-"), key("_"));
    }

    #[test]
    fn the_papers_classes_have_one_spelling_and_others_their_own() {
        let check = |name: &str, spelled: &str| {
            assert_eq!(name.parse::<ClassName>().unwrap().spelled().as_str(), spelled);
        };
        check("Wall following", "wall_following");
        check("MILLING", "milling");
        check("nested-cycle", "nested_cycle");
        check("Two Rings", "Two Rings");
    }

    #[test]
    fn a_name_is_shown_with_spaces_and_means_the_same_class() {
        for (name, shown) in [
            ("wall_following", "wall following"),
            ("two-rings", "two-rings"),
            ("__", "__"),
        ] {
            let name: ClassName = name.parse().unwrap();
            assert_eq!(name.shown(), shown);
            assert_eq!(shown.parse::<ClassName>().unwrap().key(), name.key());
        }
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
