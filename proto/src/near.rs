//! Which known word somebody may have meant.

/// The one of the `known` words that `word` may have been meant to be, by the measure that clap suggests options by (but a
/// stricter one: fields are short).
pub(crate) fn nearest<'a>(word: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let likeness = known.into_iter().map(|known| (strsim::jaro(word, known), known));
    let near = likeness.filter(|(likeness, _)| *likeness > 0.8);
    Some(near.max_by(|(one, _), (other, _)| one.total_cmp(other))?.1)
}
