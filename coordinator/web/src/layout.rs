//! The parts that all pages have around their content.

use super::visitor::Visitor;
use maud::{DOCTYPE, Markup, html};
use murmuration_model::CampaignRecord;

/// The title of the page on which people play.
const PLAY: &str = "Play";

/// The pages of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Progress,
    Label,
    Sheet,
    Map,
    Taxonomy,
}

impl Part {
    const ALL: [(Self, &str, &str); 5] = [
        (Self::Progress, "", "Progress"),
        (Self::Label, "/label", "Label"),
        (Self::Sheet, "/sheet", "Sheet"),
        (Self::Map, "/map", "Map"),
        (Self::Taxonomy, "/taxonomy", "Taxonomy"),
    ];
}

/// A whole page around `content`.
pub(super) fn layout(title: &str, visitor: &Visitor, content: Markup) -> Markup {
    document(
        title,
        visitor.account(),
        &["live.js"],
        html! { main #content { (content) } },
    )
}

/// The page on which people play, with its script.
pub(super) fn play_page(visitor: &Visitor, content: Markup) -> Markup {
    document(
        PLAY,
        visitor.account(),
        &["play.js"],
        html! { main #content { (content) } },
    )
}

/// A page of a campaign, with its script.
pub(super) fn campaign_page(
    record: &CampaignRecord,
    part: Part,
    visitor: &Visitor,
    script: &str,
    content: Markup,
) -> Markup {
    let id = record.id.as_str();
    let name = Part::ALL
        .iter()
        .find(|(known, ..)| *known == part)
        .map_or("", |(_, _, name)| *name);
    let title = format!("{name} · {id}");
    let links = html! {
        span.campaign { (id) }
        nav aria-label="Campaign" {
            @for (other, path, name) in Part::ALL {
                a href={ "/campaigns/" (id) (path) } aria-current=[(other == part).then_some("page")] { (name) }
            }
        }
        (visitor.account())
    };
    let main = html! {
        main #content data-campaign=(id) data-created=(record.archive_version().origin()) {
            noscript { p.scriptless { (without_scripts(record, part)) } }
            (content)
        }
    };
    document(&title, links, &[script], main)
}

/// The notice that a page shows where scripts do not run.
fn without_scripts(record: &CampaignRecord, part: Part) -> Markup {
    let page = |path: &str, name: &str| html! { a href={ "/campaigns/" (record.id) (path) } { (name) } };
    html! {
        @match part {
            Part::Progress => {
                "Without JavaScript this page does not update. Reload it to see the current state. The buttons work."
            },
            Part::Taxonomy => {
                "Without JavaScript the motions cannot be played and the behaviours cannot be named here. The report shows its "
                "pictures and numbers without JavaScript."
            },
            Part::Label | Part::Sheet | Part::Map => {
                "This page needs JavaScript, which is not running in this browser. Without JavaScript, see the "
                (page("", "progress")) " and the " (page("/taxonomy", "taxonomy")) " of the campaign, or read answers from a "
                "file with the command " code { "murmuration label " (record.id) " --csv FILE" } "."
            },
        }
    }
}

fn document(title: &str, links: Markup, scripts: &[&str], main: Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) " · Murmuration" }
                link rel="icon" type="image/svg+xml" href="/assets/icon.svg";
                link rel="stylesheet" href="/assets/style.css";
                link rel="stylesheet" href="/assets/teach.css";
                link rel="stylesheet" href="/assets/play.css";
                noscript { link rel="stylesheet" href="/assets/noscript.css"; }
                @for script in scripts { script type="module" src={ "/assets/" (script) } {} }
            }
            body {
                a.skip href="#content" { "Skip to the content" }
                header {
                    a.home href="/" { "Murmuration" }
                    a.site href="/play" aria-current=[(title == PLAY).then_some("page")] { (PLAY) }
                    (links)
                }
                p.stale-note role="status" hidden {}
                (main)
            }
        }
    }
}
