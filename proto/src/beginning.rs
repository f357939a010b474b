//! The beginning of a text that may be long.

use std::borrow::Cow;

/// A text if it has at most `most` characters; or else so many, and an ellipsis.
#[must_use]
pub fn beginning(text: &str, most: usize) -> Cow<'_, str> {
    match text.char_indices().nth(most) {
        None => text.into(),
        Some((end, _)) => format!("{}…", &text[..end]).into(),
    }
}
