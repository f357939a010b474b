//! Suggestions for misspelled words.

/// The `known` word most similar to `word`, if one is similar enough. The measure is clap's for options, with a stricter
/// limit because fields are short.
#[must_use]
pub fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = known.into_iter().map(|known| (strsim::jaro(word, known), known));
    let near = likeness.filter(|(likeness, _)| *likeness > 0.8);
    Some(near.max_by(|(one, _), (other, _)| one.total_cmp(other))?.1)
}
