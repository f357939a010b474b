//! The beginning of a text that may be long.

use std::borrow::Cow;

/// Returns a text of at most `most` characters; a longer text is cut there and gets an ellipsis.
#[must_use]
pub fn beginning(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        None => text.into(),
        Some((end, _)) => format!("{}…", &text[..end]).into(),
    }
}
