//! The part of the page Play that shows the motion over time: features, the judge's names, and marked moments.

use maud::{Markup, html};
use murmuration_sim::{features::FEATURE_STEPS, moments::FEWEST_ROBOTS};
use murmuration_swarm::{FEATURE_NAMES, Verdict};
use serde_json::json;

/// The part of the page; a script fills the charts and the table of moments.
pub(super) fn section() -> Markup {
    let verdicts: Vec<String> = Verdict::all().map(Verdict::words).collect();
    let features = FEATURE_NAMES.map(words);
    html! {
        section #timeline.timeline.scripted aria-label="Over time" data-verdicts=(json!(verdicts)) data-features=(json!(features))
            data-least=(FEWEST_ROBOTS) {
            h2 { "Over time" }
            div.charts {
                @for feature in &features { div { h3 { (feature) } div.chart {} } }
            }
            p.reason {
                "Each feature is the mean of the last " (FEATURE_STEPS) " steps, as in an evaluation that ends at this step. A flag marks a "
                "step at which the judge’s name changes. A click on a chart goes to the step."
            }
        }
        section #marks.scripted aria-label="Marked moments" hidden {
            h2 { "Marked moments" }
            div.wide tabindex="0" role="region" aria-label="Table of marked moments" { table {} }
            p.reason { "Your browser keeps these moments until you close the window. A click on a picture goes to its moment." }
        }
    }
}

/// The name of a feature for people.
fn words(name: &str) -> String {
    name.replace("_x20", " × 20").replace('_', " ")
}
