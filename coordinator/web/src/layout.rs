//! The parts that all pages have around their content.

use super::visitor::Visitor;
use maud::{DOCTYPE, Markup, html};
use murmuration_model::{ArchiveVersion, CampaignRecord, CampaignState};
use murmuration_report::atlas::Layout;

/// The title of the page Play.
pub(super) const PLAY: &str = "Play";
/// The title of the glossary.
pub(super) const GLOSSARY: &str = "Glossary";
/// The title of the list of studies.
pub(super) const STUDIES: &str = "Studies";

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Progress,
    Label,
    Sheet,
    Map,
    Answers,
    Classes,
    Taxonomy,
    Atlas,
}

/// A purpose for which people are on the pages of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Purpose {
    Watch,
    Label,
    Analyse,
}

impl Purpose {
    const ALL: [(Self, &str); 3] = [
        (Self::Watch, "Watch"),
        (Self::Label, "Label"),
        (Self::Analyse, "Analyse"),
    ];

    /// The pages of the campaign for this purpose; the first of them is the page that a click on the purpose leads to.
    fn parts(self, record: &CampaignRecord) -> impl Iterator<Item = (Part, &'static str, &'static str)> {
        let parts = Part::ALL.into_iter();
        let own = parts.filter(move |(_, purpose, ..)| *purpose == self);
        own.filter(|(part, ..)| part.is_of(record))
            .map(|(part, _, path, name)| (part, path, name))
    }
}

impl Part {
    const ALL: [(Self, Purpose, &str, &str); 8] = [
        (Self::Progress, Purpose::Watch, "", "Progress"),
        (Self::Label, Purpose::Label, "/label", "Label"),
        (Self::Sheet, Purpose::Label, "/sheet", "Sheet"),
        (Self::Answers, Purpose::Label, "/answers", "Answers"),
        (Self::Classes, Purpose::Label, "/classes", "Classes"),
        (Self::Taxonomy, Purpose::Analyse, "/taxonomy", "Taxonomy"),
        (Self::Map, Purpose::Analyse, "/map", "Map"),
        (Self::Atlas, Purpose::Analyse, "/atlas", "Atlas"),
    ];

    fn is_of(self, record: &CampaignRecord) -> bool {
        self != Self::Atlas || atlas_of(record).is_some()
    }
}

/// The layout of the atlas of a campaign; `None` if the campaign has no atlas.
pub(super) fn atlas_of(record: &CampaignRecord) -> Option<Layout> {
    // A page would have to hold every individual.
    let is_sampled = record.spec.sample().is_some();
    Layout::of(&record.spec).filter(|_| record.spec.judges() && !is_sampled)
}

/// A page around `content`; the script `live.js` keeps the page up to date.
pub(super) fn layout(title: &str, visitor: &Visitor, content: Markup) -> Markup {
    layout_with(title, visitor, &["live.js"], content)
}

/// A page around `content`, with the given scripts.
pub(super) fn layout_with(title: &str, visitor: &Visitor, scripts: &[&str], content: Markup) -> Markup {
    document(
        title,
        visitor.account(),
        scripts,
        html! { main #content { (content) } },
    )
}

/// A page of a campaign, with the script that has the name of the page.
pub(super) fn campaign_page(
    record: &CampaignRecord,
    part: Part,
    visitor: &Visitor,
    content: Markup,
) -> Markup {
    let id = record.id.as_str();
    let known = Part::ALL.iter().find(|(known, ..)| *known == part);
    let (purpose, name) = known.map_or((Purpose::Watch, ""), |(_, purpose, _, name)| (*purpose, *name));
    let title = format!("{name} · {id}");
    let links = html! {
        span.campaign { (id) }
        nav aria-label="Campaign" {
            @for (other, name) in Purpose::ALL {
                @if let Some((_, path, _)) = other.parts(record).next() {
                    a href={ "/campaigns/" (id) (path) } aria-current=[(other == purpose).then_some("true")] { (name) }
                }
            }
        }
        (visitor.account())
        @if purpose.parts(record).count() > 1 {
            nav.parts aria-label="Pages" {
                @for (other, path, name) in purpose.parts(record) {
                    a href={ "/campaigns/" (id) (path) } aria-current=[(other == part).then_some("page")] { (name) }
                }
            }
        }
    };
    let main = html! {
        main #content data-campaign=(id) data-created=(record.archive_version().origin())
            data-archive-state=(ArchiveState::of(record).word())
        {
            noscript { p.scriptless { (without_scripts(record, part)) } }
            (content)
        }
    };
    document(&title, links, &[&format!("{}.js", name.to_lowercase())], main)
}

/// Notice for browsers that do not run scripts.
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
            Part::Label | Part::Sheet | Part::Map | Part::Answers | Part::Classes | Part::Atlas => {
                "This page needs JavaScript, which is not running in this browser. Without JavaScript, see the "
                (page("", "progress")) " and the " (page("/taxonomy", "taxonomy")) " of the campaign, or read answers from a "
                "file with the command " code { "murmuration label " (record.id) " --csv FILE" } "."
            },
        }
    }
}

/// Scripts of the pages that show cards of behaviours.
const WITH_CARDS: [&str; 3] = ["progress.js", "sidebyside.js", "taxonomy.js"];

fn document(title: &str, links: Markup, scripts: &[&str], main: Markup) -> Markup {
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                title { (title) " · Murmuration" }
                // Browsers paint the page only once they have read all of it, because later parts can move earlier parts.
                link rel="expect" href="#whole" blocking="render";
                link rel="icon" type="image/svg+xml" href="/assets/icon.svg";
                link rel="stylesheet" href="/assets/style.css";
                link rel="stylesheet" href="/assets/teach.css";
                link rel="stylesheet" href="/assets/play.css";
                @if scripts.contains(&"map.js") { link rel="stylesheet" href="/assets/pins.css"; }
                @if scripts.iter().any(|script| WITH_CARDS.contains(script)) { link rel="stylesheet" href="/assets/card.css"; }
                @if scripts.contains(&"atlas.js") { link rel="stylesheet" href="/assets/atlas.css"; }
                @if scripts.contains(&"study.js") {
                    link rel="stylesheet" href="/assets/tables.css";
                    link rel="stylesheet" href="/assets/study.css";
                }
                @if scripts.contains(&"roboteditor.js") { link rel="stylesheet" href="/assets/roboteditor.css"; }
                noscript { link rel="stylesheet" href="/assets/noscript.css"; }
                @for script in scripts { script type="module" src={ "/assets/" (script) } {} }
            }
            body {
                a.skip href="#content" { "Skip to the content" }
                header {
                    a.home href="/" { "Murmuration" }
                    a.site href="/play" aria-current=[(title == PLAY).then_some("page")] { (PLAY) }
                    a.site href="/studies" aria-current=[(title == STUDIES).then_some("page")] { (STUDIES) }
                    a.site href="/glossary" aria-current=[(title == GLOSSARY).then_some("page")] { (GLOSSARY) }
                    (links)
                }
                p.stale-note role="status" hidden {}
                (main)
                span #whole hidden {}
            }
        }
    }
}

/// The state of an archive. A page that shows the archive reloads when this state changes.
#[derive(PartialEq, Eq)]
pub(super) struct ArchiveState {
    pub(super) version: ArchiveVersion,
    pub(super) individuals: u64,
    pub(super) completed: bool,
}

impl ArchiveState {
    pub(super) fn of(record: &CampaignRecord) -> Self {
        Self {
            version: record.archive_version(),
            individuals: record.individuals(),
            completed: record.state == CampaignState::Completed,
        }
    }

    /// The state as one word in the markup of a page. A script compares words to find out whether the page is up to date.
    pub(super) fn word(&self) -> String {
        let completed = if self.completed { "completed" } else { "growing" };
        format!("{}-{}-{completed}", self.version, self.individuals)
    }
}
