//! The versions of a taxonomy, in words and as links.

use super::shown_version::ShownVersion;
use crate::parts;
use maud::{Markup, html};
use murmuration_engine::taxonomy::{NotCarried, Uncarried};
use murmuration_model::CampaignRecord;
use murmuration_store::TaxonomyVersion;
use murmuration_swarm::{counted, grouped};

/// Says after which round of its campaign a version was made.
pub(super) fn in_words(version: &TaxonomyVersion) -> String {
    match version.rounds {
        0 => "before learning from labels".to_owned(),
        rounds => format!("after round {} of learning", grouped(rounds.into())),
    }
}

pub(super) fn link(record: &CampaignRecord, version: u32) -> Markup {
    html! { a href={ "/campaigns/" (record.id) "/taxonomy?version=" (version) } { "version " (version) } }
}

/// Links to the versions, if there are several, and a note if the version shown is not current.
pub(super) fn list(record: &CampaignRecord, shown: &ShownVersion) -> Markup {
    let version = &shown.version;
    html! {
        @if shown.versions.len() > 1 {
            nav.versions aria-label="Versions of the taxonomy" {
                @for known in &shown.versions {
                    a href={ "/campaigns/" (record.id) "/taxonomy?version=" (known.version) }
                        aria-current=[(known == version).then_some("page")] {
                        "Version " (known.version) " · " (in_words(known))
                    }
                }
            }
        }
        @if !version.stands {
            p.note {
                "This is version " (version.version) ", made " (in_words(version))
                @if let Some(made) = version.made_ms { " on " (parts::moment(made)) }
                ". "
                @if shown.versions.iter().any(|known| known.stands) {
                    "It no longer changes: name the behaviours of the newest version instead."
                } @else {
                    "The campaign has learned since then. The next version is computed when the search has ended."
                }
            }
        }
    }
}

/// The names of the previous version that were not carried over, and the reasons.
pub(super) fn uncarried(shown: &ShownVersion) -> Markup {
    let lost = &shown.names.uncarried;
    html! {
        @if !lost.is_empty() {
            details.uncarried {
                summary { (counted(lost.len() as u64, "name")) " of the version before " (if lost.len() == 1 { "was" } else { "were" }) " not carried over" }
                ul { @for name in lost { li { (why_not(name)) } } }
            }
        }
    }
}

/// Why a name was not carried over.
pub(super) fn why_not(lost: &Uncarried) -> Markup {
    html! {
        strong { (lost.class.shown()) } ", the name of behaviour " (lost.place + 1) " before, was not carried over: "
        @match &lost.why {
            NotCarried::Spread { most_in: Some(most_in), shared, of } => {
                "its " (counted(*of, "individual")) " are spread over several clusters; most of them, " (grouped(*shared))
                ", are in behaviour " (most_in + 1) "."
            },
            NotCarried::Spread { most_in: None, .. } => "none of its individuals is left.",
            NotCarried::Outdone { place, by } => {
                "most of its individuals are now in behaviour " (place + 1) ", which is named " strong { (by.shown()) } "."
            },
        }
    }
}
