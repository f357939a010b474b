//! The pages on which people label behaviours: one behaviour at a time, or a whole cluster at once.

use super::{
    keys,
    layout::{Part, campaign_page},
    learning,
    of_campaign::OfCampaign,
    page_error::PageError,
    parts,
};
use maud::{Markup, html};
use murmuration_swarm::{Feedback, Strategy};

/// The page on which people label one behaviour at a time.
pub(super) async fn one(OfCampaign { web, record, visitor }: OfCampaign) -> Result<Markup, PageError> {
    let usual = record
        .spec
        .feedback()
        .map_or(Strategy::Medoids, Feedback::strategy);
    let content = html! {
        div.wide-bar {
            h1 { "What does this swarm do?" }
            (keys::list(&[keys::CLASSES], keys::Page::Label))
            p.counted.once-named.scripted {
                progress #share max="1" value="0" aria-label="Answered by you" {}
                span #count { "…" }
                span #others {}
            }
        }
        (parts::who())
        div.columns.once-named {
            section.watch.scripted aria-label="The behaviour" { (parts::stage("Motion of the behaviour", record.spec.world())) }
            section.side aria-label="Your answer" {
                div.seen.scripted {
                    figure { canvas #paths role="img" aria-label="Paths of the robots" {} figcaption { "The paths" } }
                    figure { img #picture width="150" height="150" alt=""; figcaption { @if record.spec.space().embeds() { "What the network sees" } @else { "The stored picture" } } }
                    div aria-live="polite" { p #which { strong { "…" } } p #reason.reason {} }
                }
                (parts::palette(record.spec.world(), true))
                (parts::status_line())
                (learning::button(&web, &record, Part::Label).await?)
                (parts::downloads(&record))
            }
        }
        details.settings.once-named.scripted {
            summary { "Settings" }
            div.choices {
                label { "Ask " select #strategy {
                    @for (strategy, expected) in STRATEGIES {
                        option value=(strategy) selected[strategy == usual] { (expected) }
                    }
                } }
                label { "Goal " select #goal {
                    @for goal in ["50", "100", "200", "500"] {
                        option value=(goal) selected[goal == "200"] { (goal) " answers" }
                    }
                    option value="all" { "all behaviours" }
                } }
                label { input #agreement type="checkbox"; " Ask what others have answered, to measure agreement" }
                (parts::rename())
            }
        }
    };
    Ok(campaign_page(&record, Part::Label, &visitor, content))
}

/// The query strategies, with their names in the menu.
const STRATEGIES: [(Strategy, &str); 3] = [
    (Strategy::Medoids, "medoids first, then uncertain ones"),
    (Strategy::Coverage, "medoids first, then individuals unlike them"),
    (Strategy::Random, "at random"),
];

/// The keys of the sheet that people cannot change.
const SHEET_KEYS: [(&str, &str); 3] = [
    keys::CLASSES,
    ("Tab", "go from picture to picture, and play its motion"),
    ("Space", "mark the picture as different, or unmark it"),
];

/// The page on which people label a whole cluster at once.
pub(super) async fn sheet(OfCampaign { web, record, visitor }: OfCampaign) -> Result<Markup, PageError> {
    let content = html! {
        div.wide-bar {
            h1 { "Which of these differ?" }
            (keys::list(&SHEET_KEYS, keys::Page::Sheet))
            div.choices.once-named.scripted {
                button.plain #before type="button" { "Previous " (keys::mark("previous")) }
                label { "Cluster " select #cluster {} }
                button.plain #after type="button" { "Next " (keys::mark("next")) }
            }
        }
        (parts::who())
        p.lead.once-named.scripted {
            "These behaviours are of one cluster. Click the behaviours that differ, or draw a line around them, then name the "
            "rest. The behaviours that you mark stay unnamed and are shown again later. " span #so-far role="status" {} " "
            button.plain #fresh type="button" hidden { "Show the new clusters" }
        }
        div.columns.sheeted.once-named {
            section.sheet.scripted aria-label="Members of the cluster" {
                div #sheet {}
                canvas #over aria-hidden="true" {}
                p.empty hidden {}
            }
            section.side aria-label="Your answer" {
                (parts::stage("Motion of the behaviour under the pointer", record.spec.world()))
                p #rest.reason.scripted { "…" }
                (parts::palette(record.spec.world(), false))
                (parts::status_line())
                (learning::button(&web, &record, Part::Sheet).await?)
            }
        }
    };
    Ok(campaign_page(&record, Part::Sheet, &visitor, content))
}
