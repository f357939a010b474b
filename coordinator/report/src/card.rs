//! The parts of a behaviour's card that reports and the coordinator's pages share, and their style sheet.

use crate::{Purity, judged::RANDOM};
use maud::{Markup, html};
use murmuration_swarm::{Controller, Verdict};

/// The style of cards. A page defines the colours as custom properties: `--surface`, `--sunken`, `--ink`, `--muted`, `--line`,
/// `--accent`.
pub const STYLE: &str = include_str!("card.css");

/// The origin of a behaviour's name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Namer {
    /// An annotator gave the name to this behaviour.
    Annotator,
    /// Only the rule-based judge gave the name.
    Judge,
    /// The name comes from a cluster of an earlier version of the taxonomy.
    Earlier,
}

impl Namer {
    /// The origin of a name that no annotator gave to this behaviour: in short, and as a sentence.
    const fn in_words(self) -> Option<(&'static str, &'static str)> {
        match self {
            Self::Annotator => None,
            Self::Judge => Some(("judge", "Named by the rule-based judge, not by a person.")),
            Self::Earlier => Some((
                "carried over",
                "Carried over from an earlier version of the taxonomy. Nobody has given the name to this behaviour.",
            )),
        }
    }
}

/// The name on a card.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CardName {
    pub name: String,
    pub by: Namer,
}

impl CardName {
    /// The judge's verdict on a medoid as the name of its cluster, of this purity. Clusters of which few members are of the
    /// medoid's kind are mixed.
    #[must_use]
    pub fn of_verdict(verdict: Verdict, purity: Option<Purity>) -> Self {
        let is_mixed = verdict != RANDOM && purity.is_some_and(Purity::is_low);
        Self {
            name: match is_mixed {
                true => format!("mixed; medoid: {}", verdict.words()),
                false => verdict.words(),
            },
            by: Namer::Judge,
        }
    }

    /// Whether an annotator has given the name to this behaviour. Other names are shown with a question mark.
    #[must_use]
    pub fn is_sure(&self) -> bool {
        self.by == Namer::Annotator
    }

    /// The name, with a question mark unless an annotator gave it to this behaviour.
    #[must_use]
    pub fn shown(&self) -> String {
        match self.is_sure() {
            true => self.name.clone(),
            false => format!("{}?", self.name),
        }
    }
}

/// The heading of a card: its number, from 1, and its name. `colour`, if any, is the class's colour.
pub fn heading(number: usize, name: Option<&CardName>, colour: Option<&str>) -> Markup {
    let style = colour.map(|colour| format!("--class:{colour}"));
    let is_sure = name.is_none_or(CardName::is_sure);
    let class = match (colour.is_some(), is_sure) {
        (true, true) => Some("class"),
        (true, false) => Some("class unsure"),
        (false, true) => None,
        (false, false) => Some("unsure"),
    };
    html! {
        span.swatch aria-hidden="true" { (number) }
        @match name {
            Some(name) => {
                @let origin = name.by.in_words();
                span class=[class] style=[style] title=[origin.map(|(_, whole)| whole)] { (name.shown()) }
                @if let Some((short, _)) = origin { small { (short) } }
            },
            None => { "Behaviour " (number) },
        }
    }
}

/// The line below the heading: the share of the cluster in the archive, its purity and the robustness of its medoid.
pub fn measures(share: &str, purity: Option<Purity>, robust: Option<(usize, usize)>) -> Markup {
    html! { strong { (share) } " cluster" (quality(purity, robust)) }
}

/// The purity of a cluster and the robustness of its medoid, a count of trials out of all trials, as the end of a line.
pub(crate) fn quality(purity: Option<Purity>, robust: Option<(usize, usize)>) -> String {
    let purity = purity.map(|Purity { alike, known, .. }| format!(" · purity {alike} of {known}"));
    let robust = robust.map(|(robust, starts)| format!(" · robust in {robust} of {starts}"));
    purity.into_iter().chain(robust).collect()
}

/// A small picture on a card.
#[derive(Debug, Clone)]
pub struct Sight {
    /// Address of the picture.
    pub source: String,
    /// Text for those who do not see the picture.
    pub alt: String,
    pub caption: &'static str,
    /// Explanation that a pointer shows.
    pub title: String,
}

/// A figure with a small picture as the embedder sees it.
pub fn sight(sight: &Sight) -> Markup {
    html! {
        figure title=(sight.title) {
            img.grey src=(sight.source) loading="lazy" alt=(sight.alt);
            figcaption { (sight.caption) }
        }
    }
}

/// The genes of a controller with their names.
pub fn genes(controller: &Controller) -> Markup {
    let names = controller.model().gene_names();
    html! {
        dl.genes {
            @for (name, gene) in names.iter().zip(controller.genes()) { div { dt { (name) } dd { (gene) } } }
        }
    }
}
