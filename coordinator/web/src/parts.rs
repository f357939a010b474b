//! Parts that several pages share.

use maud::{Markup, html};
use murmuration_accuracy::RANDOM;
use murmuration_model::{CampaignRecord, CampaignState};

/// A canvas on which a motion is played, and its controls.
pub(super) fn stage(label: &str) -> Markup {
    html! {
        div.player.scripted {
            div.stage { canvas role="img" aria-label=(label) {} p.waiting hidden {} }
            div.transport {
                button.toggle type="button" aria-label="Play" disabled {}
                input.scrub type="range" min="0" max="1" value="0" aria-label="Step" disabled;
                output.step { "–" }
                label { span.unseen { "Speed" } (speeds()) }
            }
        }
    }
}

/// The menu of speeds.
pub(super) fn speeds() -> Markup {
    html! {
        select.speed {
            @for (speed, name) in [("0.5", "½×"), ("1", "1×"), ("2", "2×"), ("4", "4×"), ("8", "8×"), ("16", "16×")] {
                option value=(speed) selected[speed == "4"] { (name) }
            }
        }
    }
}

/// Buttons for the classes, which a script adds, and for other answers; `single` where the page asks about one behaviour.
pub(super) fn palette(single: bool) -> Markup {
    html! {
        div.palette.scripted aria-label="Classes" role="group" {
            div.classes {}
            form.naming.new {
                label { span.unseen { "Class" }
                    input name="class" list="known" maxlength="64" autocomplete="off" placeholder="A class";
                }
                button.plain { "New class " kbd { "n" } }
                datalist #known {}
            }
            div.others {
                @if single {
                    button.plain type="button" data-answer="not sure" { "Not sure " kbd { "?" } }
                    button.plain type="button" data-answer="skip" { "Skip " kbd { "s" } }
                }
                button.plain type="button" data-do="undo" { "Undo " kbd { "u" } }
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

/// The button that has the campaign learn from its labels; nothing where the campaign has no embedding.
pub(super) fn learn(record: &CampaignRecord) -> Markup {
    let offered = record.spec.method().embeds() && record.state != CampaignState::Cancelled;
    html! {
        @if offered {
            form.learn method="post" action={ "/campaigns/" (record.id) "/refine" } {
                button { "Learn from all labels" }
                p #doing.reason role="status" {}
            }
        }
    }
}

/// The form that asks for the annotator's name until the browser knows it; until then, parts with the class `once-named`
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

/// The field in which annotators change their name.
pub(super) fn rename() -> Markup {
    html! { label { "Answering as " input #annotator maxlength="64" autocomplete="nickname"; } }
}

/// The line on which the script reports what is saved, and errors.
pub(super) fn status_line() -> Markup {
    html! { p #status.status role="status" {} }
}
