//! The glossary (`docs/glossary.md`) as a page, to which the words of other pages link.

use super::{
    layout::{GLOSSARY, layout},
    visitor::Visitor,
};
use maud::{Markup, html};

const TEXT: &str = include_str!("../../../docs/glossary.md");

pub(super) async fn page(visitor: Visitor) -> Markup {
    layout(
        GLOSSARY,
        &visitor,
        html! {
            h1 { (GLOSSARY) }
            div.glossary { @for paragraph in TEXT.split("\n\n").skip(1) { (block(paragraph.trim())) } }
        },
    )
}

/// A word that links to its entry.
pub(super) fn term(word: &str, entry: &str) -> Markup {
    html! { a.term href={ "/glossary#" (entry) } { (word) } }
}

/// A heading, an entry, or a paragraph between entries.
fn block(text: &str) -> Markup {
    if let Some(title) = text.strip_prefix("## ") {
        return html! { h2 { (title) } };
    }
    let entry = text.strip_prefix("**").and_then(|text| text.split_once("**"));
    match entry {
        Some((word, message)) => html! { p id=(slug(word)) { strong { (word) } (inline(message)) } },
        None => html! { p { (inline(text)) } },
    }
}

/// An entry's anchor: the first word or words of the entry in lower case, with hyphens.
fn slug(word: &str) -> String {
    let first = word.split([',', '.', '(']).next().unwrap_or_default();
    first.trim().to_lowercase().replace(' ', "-")
}

/// A paragraph with its code, emphasis and web links. Links to other files become plain text.
pub(super) fn inline(text: &str) -> Markup {
    let mut rest = text;
    let mut parts = Vec::new();
    while let Some(at) = rest.find(['`', '*', '[']) {
        let (before, marked) = rest.split_at(at);
        let Some((part, after)) = marked_part(marked) else {
            break;
        };
        parts.push(html! { (before) (part) });
        rest = after;
    }
    html! { @for part in parts { (part) } (rest) }
}

/// The code, emphasis or link that `text` begins with, and the text after it; `None` if its closing character is missing.
fn marked_part(text: &str) -> Option<(Markup, &str)> {
    if let Some(text) = text.strip_prefix('`') {
        let (code, after) = text.split_once('`')?;
        return Some((html! { code { (code) } }, after));
    }
    if let Some(text) = text.strip_prefix('*') {
        let (message, after) = text.split_once('*')?;
        return Some((html! { em { (message) } }, after));
    }
    let (message, after) = text.strip_prefix('[')?.split_once("](")?;
    let (address, after) = after.split_once(')')?;
    let part = match address.starts_with("https://") {
        true => html! { a href=(address) { (message) } },
        false => html! { (message) },
    };
    Some((part, after))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::Verdict;

    #[test]
    fn entries_have_their_places_and_marks_are_none_of_the_text() {
        let entry = block(
            "**Gene, genome.** One `number` of a *controller*: [here](robots.md), [there](https://a.b/c).",
        );
        assert_eq!(
            entry.into_string(),
            "<p id=\"gene\"><strong>Gene, genome.</strong> One <code>number</code> of a <em>controller</em>: here, \
             <a href=\"https://a.b/c\">there</a>.</p>"
        );
        assert_eq!(block("## Robots").into_string(), "<h2>Robots</h2>");
        assert_eq!(inline("2 * 3").into_string(), "2 * 3");
    }

    #[test]
    fn the_words_that_pages_link_to_are_there() {
        let page: String = TEXT.split("\n\n").map(|text| block(text).into_string()).collect();
        let places: Vec<&str> = page
            .split(" id=\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next())
            .collect();
        let distinct: std::collections::BTreeSet<_> = places.iter().collect();
        assert_eq!(distinct.len(), places.len(), "two entries have one name");
        let kinds = Verdict::all().map(|verdict| slug(&verdict.name().replace('_', " ")));
        let linked = ["medoid", "novelty", "filter", "round", "seed", "embedder"].map(str::to_owned);
        for entry in linked.into_iter().chain(kinds) {
            assert!(page.contains(&format!("id=\"{entry}\"")), "{entry}");
        }
    }
}
