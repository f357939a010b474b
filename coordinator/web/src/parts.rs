//! Parts that several pages share.

use super::keys;
use maud::{Markup, html};
use murmuration_accuracy::RANDOM;
use murmuration_model::{CampaignRecord, Timestamp};
use murmuration_swarm::{CampaignSpec, Class, World, counted};

/// The paper's classes that robots with any of the paper's capability models can show, `random` last.
const OFFERED: [Class; 6] = [
    Class::CyclicPursuit,
    Class::Milling,
    Class::Aggregation,
    Class::Dispersal,
    Class::WallFollowing,
    Class::Random,
];

/// A point in time to the minute, given in milliseconds since 1970-01-01 UTC.
pub(super) fn moment(ms: u64) -> Markup {
    let text = Timestamp::from_ms(ms).to_string();
    // 2026-11-21T12:00:00.5Z
    let minute = text.get(..16).unwrap_or(&text).replace('T', " ");
    html! { time datetime=(text) { (minute) " UTC" } }
}

/// Gives a stage the shape of `world` before its motion arrives, so that the page does not move when the motion arrives. The
/// shape is an empty SVG with a viewBox, because the pages' Content-Security-Policy forbids style attributes.
pub(super) fn shape(world: &World) -> Markup {
    html! { svg.shape viewBox={ "0 0 " (world.width()) " " (world.height()) } aria-hidden="true" {} }
}

/// A canvas that plays a motion of `world`, and its controls.
pub(super) fn stage(label: &str, world: &World) -> Markup {
    html! {
        div.player.scripted {
            div.stage { (shape(world)) canvas role="img" aria-label=(label) {} p.waiting hidden {} }
            div.transport {
                button.toggle type="button" aria-label="Play" disabled {}
                input.scrub type="range" min="0" max="1" value="0" aria-label="Step" disabled;
                output.step { "–" }
                label { span.unseen { "Speed" } (speeds()) }
            }
        }
    }
}

pub(super) fn speeds() -> Markup {
    html! {
        select.speed {
            @for (speed, name) in [("0.5", "½×"), ("1", "1×"), ("2", "2×"), ("4", "4×"), ("8", "8×"), ("16", "16×")] {
                option value=(speed) selected[speed == "4"] { (name) }
            }
        }
    }
}

/// The palette: buttons for the classes, which a script adds, and for other answers. The palette offers the paper's classes that
/// make sense in `world`. `single` is true on a page that asks about one behaviour.
pub(super) fn palette(world: &World, single: bool) -> Markup {
    let offered = OFFERED
        .iter()
        .filter(|class| class.without_meaning(world).is_none());
    let offered: Vec<&str> = offered.map(|class| class.name()).collect();
    html! {
        div.palette.scripted aria-label="Classes" role="group" data-offered=(offered.join(" ")) {
            div.classes {}
            div.offered hidden {
                p.reason { "Classes with a dashed border are the paper’s. They have no answers yet." }
                button.plain type="button" data-do="own" { "Hide these" }
            }
            form.naming.new {
                label { span.unseen { "Class" }
                    input name="class" list="known" maxlength="64" autocomplete="off" placeholder="A class";
                }
                button.plain { "New class " (keys::mark("name")) }
                datalist #known {}
            }
            div.others {
                @if single {
                    button.plain type="button" data-answer="not sure" { "Not sure " (keys::mark("not-sure")) }
                    button.plain type="button" data-answer="skip" { "Skip " (keys::mark("skip")) }
                }
                button.plain type="button" data-do="undo" { "Undo " (keys::mark("undo")) }
            }
            div.near role="status" hidden {
                p.reason {}
                div.others {
                    button.plain type="button" data-do="instead" { "Use the other class" }
                    button.plain type="button" data-do="differ" { "Keep both classes" }
                }
            }
            p.reason { "Use the class " strong { (RANDOM) } " for behaviours that fit no other class; two of them need not be alike." }
        }
    }
}

/// The form for the annotator's name, shown until the browser has stored a name. Until then, parts with the class `once-named`
/// are hidden.
pub(super) fn who() -> Markup {
    html! {
        form #who.who hidden {
            label { "Your name, which is stored with your answers "
                input name="annotator" maxlength="64" required autocomplete="nickname";
            }
            button { "Begin" }
        }
    }
}

/// The field for changing the annotator's name.
pub(super) fn rename() -> Markup {
    html! { label { "Answering as " input #annotator maxlength="64" autocomplete="nickname"; } }
}

/// The line for messages of the page's script: saved answers and errors.
pub(super) fn status_line() -> Markup {
    html! { p #status.status role="status" {} }
}

/// The dialog in which a script asks before it replaces or withdraws several answers.
pub(super) fn confirm() -> Markup {
    html! {
        dialog #confirm aria-labelledby="confirm-title" {
            h2 #confirm-title {}
            p {}
            form method="dialog" {
                button.plain value="" { "Go back" }
                button value="yes" { "Yes" }
            }
        }
    }
}

/// A menu that unfolds under a button with three dots; `of` says what it is a menu of.
pub(super) fn menu(of: &str, content: &Markup) -> Markup {
    html! {
        details.menu {
            summary aria-label={ "More for " (of) } { "⋯" }
            div { (content) }
        }
    }
}

/// The controllers that the first generation of a campaign begins with, in words; `None` if it is sampled as a whole.
pub(super) fn beginning(spec: &CampaignSpec) -> Option<String> {
    let initial = spec.controllers().initial().len() as u64;
    let controllers = counted(initial, "controller");
    match (spec.sweep_centre(), initial) {
        (Some(_), _) => Some(format!("sweep of {controllers}")),
        (None, 0) => None,
        (None, _) => Some(format!("begins with {controllers}")),
    }
}

pub(super) fn downloads(record: &CampaignRecord) -> Markup {
    html! {
        p.reason {
            "Download as CSV: "
            a href={ "/campaigns/" (record.id) "/labels.csv" } download { "labels" } ", "
            a href={ "/campaigns/" (record.id) "/archive.csv" } download { "archive" }
        }
    }
}
