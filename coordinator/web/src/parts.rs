//! Parts that several pages are made of.

use maud::{Markup, html};
use murmuration_accuracy::RANDOM;
use murmuration_model::{CampaignRecord, CampaignState};

/// Where a motion is played, with what plays it.
pub(super) fn stage(label: &str) -> Markup {
    html! {
        div.player.scripted {
            div.stage { canvas role="img" aria-label=(label) {} p.waiting hidden {} }
            div.transport {
                button.toggle type="button" aria-label="Play" disabled {}
                input.scrub type="range" min="0" max="1" value="0" aria-label="Step" disabled;
                output.step { "–" }
                label { span.unseen { "Speed" } select.speed {
                    @for (speed, name) in [("0.5", "½×"), ("1", "1×"), ("2", "2×"), ("4", "4×"), ("8", "8×"), ("16", "16×")] {
                        option value=(speed) selected[speed == "4"] { (name) }
                    }
                } }
            }
        }
    }
}

/// Buttons for the classes, filled by a script, and other answers; `single` where one behaviour is asked about.
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
                    button.plain type="button" data-do="instead" { "Say the other instead" }
                    button.plain type="button" data-do="differ" { "They differ" }
                }
            }
            p.reason { "What fits no class is " strong { (RANDOM) } ": two of those need not be alike." }
        }
    }
}

/// Has the campaign learn from what was said; nothing where it has no embedding that could.
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

/// Asks for the annotator's name, until the browser knows it; nothing with the class `once-named` is shown meanwhile.
pub(super) fn who() -> Markup {
    html! {
        form #who.who hidden {
            label { "Your name, to be kept with your answers "
                input name="annotator" maxlength="64" required autocomplete="nickname";
            }
            button { "Begin" }
        }
    }
}

/// Where somebody changes the name that they answer by.
pub(super) fn rename() -> Markup {
    html! { label { "Answering as " input #annotator maxlength="64" autocomplete="nickname"; } }
}

/// What the script says about saving, and what went wrong.
pub(super) fn status_line() -> Markup {
    html! { p #status.status role="status" {} }
}
