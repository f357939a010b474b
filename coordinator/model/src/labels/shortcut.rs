//! The keys on the keyboard with which annotators answer on the pages.

use murmuration_swarm::{Invalid, text::quoted};
use std::{fmt, str::FromStr};

/// A key of a class: a digit from 1 to 9, or a letter that the pages do not use themselves. The text of a key is its character; a
/// capital letter means the same key as its small letter.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Shortcut(char);

impl Shortcut {
    /// Letters with another meaning on the pages: new class, restart, skip, undo.
    const TAKEN: [char; 4] = ['n', 'r', 's', 'u'];

    /// Every key that a class can have, in the order in which classes without a chosen key get them.
    pub fn all() -> impl Iterator<Item = Self> {
        ('1'..='9')
            .chain('a'..='z')
            .filter(|key| !Self::TAKEN.contains(key))
            .map(Self)
    }
}

impl fmt::Display for Shortcut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.0)
    }
}

impl FromStr for Shortcut {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let key = text.trim().to_lowercase();
        Self::all().find(|known| known.to_string() == key).ok_or_else(|| {
            let allowed = "a digit from 1 to 9, or a letter other than n, r, s and u";
            Invalid::new("shortcut", quoted(text), allowed)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shortcut_is_a_digit_or_a_letter_that_the_pages_leave_free() {
        assert_eq!("W".parse::<Shortcut>().unwrap().to_string(), "w");
        assert_eq!(Shortcut::all().count(), 9 + 22);
        for bad in ["", "0", "n", "U", "ab", "é", "?", " "] {
            assert_eq!(bad.parse::<Shortcut>().unwrap_err().field, "shortcut");
        }
    }
}
