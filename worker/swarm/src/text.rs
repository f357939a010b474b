//! Text from outside, made safe to store, log, and show on a terminal or a page.
//!
//! A stranger's text can have any length, move the cursor of a terminal (control characters), reverse the text around it
//! (bidirectional overrides) or be invisible (zero-width characters). Free text is cleaned and cut. A bad name is refused, so
//! that its author chooses another name.

pub use crate::invalid::beginning;

use crate::{Invalid, counted};
use icu_properties::{CodePointSetData, props::DefaultIgnorableCodePoint};
use std::fmt;

/// Free text from outside, without invisible characters and of bounded length.
#[derive(Debug, Clone, Default, PartialEq, Eq, Hash)]
pub struct Text(String);

impl Text {
    /// Maximum number of characters; a longer text is cut and ends with an ellipsis.
    pub const MAX_CHARS: usize = 2_000;
    /// Maximum number of characters of a text of several lines.
    pub(crate) const MAX_CHARS_OF_LINES: usize = 64 << 10;

    /// `words` as one line: line ends and tabs become spaces.
    #[must_use]
    pub fn line(words: &str) -> Self {
        let spaced = words.chars().map(|c| if is_space(c) { ' ' } else { c });
        Self::kept(spaced, Self::MAX_CHARS)
    }

    /// `words` as several lines: line ends and tabs stay.
    #[must_use]
    pub fn lines(words: &str) -> Self {
        Self::kept(words.chars(), Self::MAX_CHARS_OF_LINES)
    }

    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }

    fn kept(words: impl Iterator<Item = char>, most: usize) -> Self {
        let mut rest = visible(words);
        let mut kept: String = rest.by_ref().take(most).collect();
        if rest.next().is_some() {
            kept.push('…');
        }
        Self(kept)
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl From<Text> for String {
    fn from(text: Text) -> Self {
        text.0
    }
}

/// `words` made safe for a terminal: without hidden characters, but with their line ends and tabs.
#[must_use]
pub fn printable(words: &str) -> String {
    visible(words.chars()).collect()
}

/// A message of one or more lines, made safe for a terminal. A line of more than [`Text::MAX_CHARS`] characters is cut, and
/// ends with the number of characters left out.
#[must_use]
pub fn message(words: &str) -> String {
    let lines = words.split('\n').map(|line| {
        let line = printable(line);
        match line.char_indices().nth(Text::MAX_CHARS) {
            None => line,
            Some((end, _)) => {
                let left_out = counted(line[end..].chars().count() as u64, "more character");
                format!("{}… ({left_out})", &line[..end])
            }
        }
    });
    lines.collect::<Vec<_>>().join("\n")
}

/// `name` without surrounding spaces: 1 to `most` characters, at least one of them visible and none hidden.
///
/// # Errors
/// The error names `field`, and the character that is not allowed.
pub fn name(field: &str, name: &str, most: usize) -> Result<String, Invalid> {
    let trimmed = name.trim();
    let refused = |allowed| Err(Invalid::new(field, quoted(name), allowed));
    if let Some(c) = hidden(trimmed).find_map(|(c, is_hidden)| is_hidden.then_some(c)) {
        return refused(format!(
            "without the character U+{:04X}, which cannot be seen",
            u32::from(c)
        ));
    }
    let count = trimmed.chars().count();
    if !(1..=most).contains(&count) || !trimmed.chars().any(is_visible) {
        return refused(format!("1 to {most} characters that can be seen"));
    }
    Ok(trimmed.to_owned())
}

/// The `known` word most similar to `word`; `None` if no word is similar enough. Similarity is measured as clap does for
/// options (Jaro), but must be over 0.8 instead of 0.7, because names of fields are short.
#[must_use]
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let len = word.chars().count();
    // Jaro is at most (2 + shorter / longer) / 3, so it exceeds 0.8 only above two fifths. The comparison of a long word would take
    // long.
    let comparable = known.into_iter().filter(|known| {
        let other = known.chars().count();
        len.min(other) * 5 > len.max(other) * 2
    });
    let likeness = comparable.map(|known| (strsim::jaro(word, known), known));
    let near = likeness.filter(|(likeness, _)| *likeness > 0.8);
    Some(near.max_by(|(one, _), (other, _)| one.total_cmp(other))?.1)
}

/// The beginning of a text from outside, quoted and escaped, for an error.
#[must_use]
pub fn quoted(text: &str) -> String {
    format!("\"{}\"", beginning(text, 80).escape_debug())
}

/// A URL without the user name, password and query that it may hold, for messages and logs: `s3://***@bucket`. A password
/// may hold any character: everything up to the last `@` is left out.
#[must_use]
pub fn masked_url(url: &str) -> String {
    let begin = url.find("://").map_or(0, |colon| colon + 3);
    let (scheme, rest) = url.split_at(begin);
    let masked = rest
        .rfind('@')
        .map_or_else(|| rest.to_owned(), |at| format!("***{}", &rest[at..]));
    match masked.split_once('?') {
        Some((before, _)) => format!("{scheme}{before}?***"),
        None => format!("{scheme}{masked}"),
    }
}

/// The characters that are not hidden, including line ends and tabs.
fn visible(words: impl Iterator<Item = char>) -> impl Iterator<Item = char> {
    let mut before = None;
    words.filter(move |&c| {
        let stays = matches!(c, '\n' | '\t') || !is_hidden(c, before);
        if stays {
            before = Some(c);
        }
        stays
    })
}

/// Each character, and whether it is hidden.
fn hidden(text: &str) -> impl Iterator<Item = (char, bool)> {
    let before = std::iter::once(None).chain(text.chars().map(Some));
    text.chars()
        .zip(before)
        .map(|(c, before)| (c, is_hidden(c, before)))
}

const fn is_space(c: char) -> bool {
    matches!(c, '\n' | '\r' | '\t' | '\u{85}' | '\u{2028}' | '\u{2029}')
}

/// Whether Unicode never assigns a character to this code point. XML, and therefore SVG, forbids some of these code points.
const fn is_noncharacter(c: char) -> bool {
    matches!(c, '\u{fdd0}'..='\u{fdef}') || c as u32 & 0xfffe == 0xfffe
}

/// Whether the character joins other characters, or selects how the character before it is drawn.
const fn is_joiner(c: char) -> bool {
    matches!(c, '\u{200c}' | '\u{200d}' | '\u{fe0e}' | '\u{fe0f}')
}

/// Whether a character after `before` is invisible, or changes the text around it.
fn is_hidden(c: char, before: Option<char>) -> bool {
    if c.is_ascii() {
        return c.is_ascii_control();
    }
    if is_joiner(c) {
        // Indic scripts, Persian and compound emoji need joiners; after Latin letters, joiners only hide text.
        let joins = |before: char| {
            !before.is_ascii() && !before.is_whitespace() && before != c && !is_joiner_of_letters(before)
        };
        return !before.is_some_and(joins);
    }
    c.is_control()
        || is_space(c)
        || is_noncharacter(c)
        || matches!(c, '\u{fff9}'..='\u{fffb}')
        || CodePointSetData::new::<DefaultIgnorableCodePoint>().contains(c)
}

const fn is_joiner_of_letters(c: char) -> bool {
    matches!(c, '\u{200c}' | '\u{200d}')
}

/// Whether a character that is not hidden is visible. The braille pattern without dots is not visible.
fn is_visible(c: char) -> bool {
    !c.is_whitespace() && c != '\u{2800}' && !is_joiner(c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_moves_the_cursor_turns_or_hides_is_taken_out() {
        let check = |words: &str, kept: &str| assert_eq!(Text::line(words).as_str(), kept, "{words:?}");
        check("no room on /dev/sda1: 5 %", "no room on /dev/sda1: 5 %");
        check("a\u{1b}[2Jb\u{9b}31mc\u{7f}\0", "a[2Jb31mc");
        check("one\ntwo\r\nthree\tfour\u{2028}five", "one two  three four five");
        check(
            "pay \u{202e}niart\u{202c} \u{2066}x\u{2069}\u{200e}",
            "pay niart x",
        );
        check("a\u{200b}b\u{feff}c\u{ad}d\u{e0041}", "abcd");
        check("naïve übermäßig नमस्ते สวัสดี 雪", "naïve übermäßig नमस्ते สวัสดี 雪");
        check("क्‍ष 👩‍🚀 ❤️ می‌خواهم", "क्‍ष 👩‍🚀 ❤️ می‌خواهم");
        check("ri\u{200d}ng", "ring");
        check(
            "a\u{fdd0}b\u{fdef}c\u{fffe}d\u{ffff}e\u{1fffe}f\u{10ffff}",
            "abcdef",
        );
        check(
            "\u{fdcf}\u{fdf0}\u{fffd}\u{10000}",
            "\u{fdcf}\u{fdf0}\u{fffd}\u{10000}",
        );
        assert_eq!(Text::lines("a = 1\n\tb = \u{1b}2").as_str(), "a = 1\n\tb = 2");
    }

    #[test]
    fn the_most_similar_word_is_near_and_a_long_word_takes_no_time() {
        assert_eq!(
            nearest("popluation", ["population", "generations"]),
            Some("population")
        );
        assert_eq!(nearest("xyzzy", ["population", "generations"]), None);
        let long = "population".repeat(200_000);
        let known = vec!["population"; 10_000];
        assert_eq!(nearest(&long, known), None);
        assert_eq!(nearest("population", [long.as_str()]), None);
    }

    #[test]
    fn what_is_too_long_is_cut() {
        let long = Text::line(&"é".repeat(Text::MAX_CHARS + 1));
        assert_eq!(long.as_str().chars().count(), Text::MAX_CHARS + 1);
        assert!(long.as_str().ends_with("é…"));
        let fits = "x".repeat(Text::MAX_CHARS);
        assert_eq!(Text::line(&fits).as_str(), fits);
    }

    #[test]
    fn a_message_keeps_its_own_lines_and_none_is_endless() {
        assert_eq!(
            message("error: a\u{1b}]0;b\u{7}\n\t^ \u{202e}c\n"),
            "error: a]0;b\n\t^ c\n"
        );
        let fits = "é".repeat(Text::MAX_CHARS);
        assert_eq!(message(&fits), fits);
        assert_eq!(
            message(&format!("{fits}abc\nd")),
            format!("{fits}… (3 more characters)\nd")
        );
        let long = "x".repeat(3 * Text::MAX_CHARS);
        assert_eq!(printable(&long), long);
    }

    #[test]
    fn of_what_is_quoted_the_beginning_is_enough() {
        assert_eq!(quoted("a\n"), "\"a\\n\"");
        let long = quoted(&"é".repeat(81));
        assert_eq!(long, format!("\"{}…\"", "é".repeat(80)));
        assert_eq!(quoted(&"x".repeat(80)), format!("\"{}\"", "x".repeat(80)));
    }

    #[test]
    fn a_url_is_shown_without_its_password() {
        for (url, shown) in [
            ("http://ana:secret@10.0.0.7:7700", "http://***@10.0.0.7:7700"),
            ("s3://key:se@cret@bucket/a?token=c", "s3://***@bucket/a?***"),
            ("http://ana:sec/ret@10.0.0.7", "http://***@10.0.0.7"),
            ("http://ana:sec?r@e#t@10.0.0.7", "http://***@10.0.0.7"),
            ("ana:secret@10.0.0.7", "***@10.0.0.7"),
            ("s3://bucket/a@b", "s3://***@b"),
            ("http://127.0.0.1:7700", "http://127.0.0.1:7700"),
            ("", ""),
        ] {
            assert_eq!(masked_url(url), shown);
        }
    }

    #[test]
    fn a_name_can_be_seen() {
        let check = |given: &str, taken: &str| assert_eq!(name("class", given, 64).unwrap(), taken);
        check(" a ring ", "a ring");
        check("e\u{301}toile", "e\u{301}toile");
        check("क्‍ष", "क्‍ष");
        check("👩‍🚀", "👩‍🚀");
        let refused = |given: &str, expected: &str| {
            let error = name("class", given, 64).unwrap_err();
            assert_eq!(error.field, "class");
            assert!(error.allowed.contains(expected), "{given:?}: {error}");
        };
        refused("", "1 to 64 characters that can be seen");
        refused("\u{2800}", "1 to 64 characters that can be seen");
        refused(&"x".repeat(65), "1 to 64 characters");
        refused("\u{200b}", "U+200B");
        refused("ring\u{200b}", "U+200B");
        refused("ri\u{202e}gn", "U+202E");
        refused("ring\u{200d}", "U+200D");
        refused("\u{3164}", "U+3164");
        refused("a\u{1b}[31m", "U+001B");
        refused("a\nb", "U+000A");
    }

    proptest! {
        #[test]
        fn what_was_cleaned_stays_as_it_is(words: String) {
            let line = Text::line(&words);
            prop_assert_eq!(&Text::line(line.as_str()), &line);
            prop_assert!(!line.as_str().chars().any(char::is_control));
        }
    }
}
