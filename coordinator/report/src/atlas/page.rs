//! The page of an atlas: the picture to zoom into. The page contains all its data except the pictures of swarms.

use super::{Atlas, Layout, layout::Place};
use crate::{Document, picture::columns::column};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, PreEscaped, html};
use murmuration_model::colours;
use murmuration_swarm::{CampaignSpec, FEATURE_NAMES, Verdict, World, counted, grouped};
use serde_json::{Value, json};

const STYLE: &str = include_str!("atlas.css");
const SCRIPT: &str = concat!(
    "\"use strict\";\n{\n",
    include_str!("atlas.js"),
    "showAtlas(JSON.parse(document.getElementById(\"data\").textContent));\n}\n"
);

/// Bit of a pixel's number in the map that marks a mirror image.
const MIRRORED: u32 = 1 << 31;
/// Number in the map of a pixel without an evaluated controller.
const NOTHING: u32 = MIRRORED - 1;

pub(super) fn render(atlas: &Atlas, layout: &Layout, places: &[Option<Place>], map: &[u8]) -> String {
    let map = format!("data:image/png;base64,{}", STANDARD.encode(map));
    let title = format!("Atlas of the robot {}", atlas.spec.model());
    let document = Document {
        title: &title,
        style: STYLE,
        scripts: true,
        pictures_beside: true,
    };
    document.with(&html! {
        main {
            (canvas())
            img #source src=(map) alt="" hidden;
            aside {
                h1 { "Every controller of the robot " (atlas.spec.model()) }
                ul #classes {}
                section #chosen aria-live="polite" { p { "Point at a controller." } }
                (explained(&atlas.spec, layout, atlas.entries.len() as u64))
                p { (HOW) " Close up, the pictures of the swarms appear." }
            }
        }
        // Without the escape, the data could end the `script` element.
        script type="application/json" #data { (PreEscaped(data(atlas, layout, places).to_string().replace('<', "\\u003c"))) }
        script { (PreEscaped(SCRIPT)) }
    })
}

/// How to use the map with a pointer and with keys.
pub const HOW: &str = "Scroll to zoom, drag to move, click for a controller. With keys: + and - zoom, Enter chooses the controller in the \
                       middle, arrow keys go on from it, with Shift by a tile, and Escape lets it go.";

pub fn canvas() -> Markup {
    html! {
        canvas #map tabindex="0" role="application"
            aria-label="Map of all controllers: a pixel each, coloured by class. Enter chooses one, arrow keys go to the next." {}
    }
}

/// Explains the map: how many controllers were simulated so far, their mirror images, and their positions.
pub fn explained(spec: &CampaignSpec, layout: &Layout, simulated: u64) -> Markup {
    html! {
        p {
            (grouped((layout.side() * layout.side()) as u64)) " controllers, a pixel each. "
            (grouped(simulated)) " of them were simulated from "
            (counted(spec.starts().get() as u64, "start")) " each; "
            @if simulated == spec.evaluations() { "the others are their mirror images." }
            @else { "their mirror images have the same colours. White ones are still to come." }
        }
        p {
            @let genes = spec.model().gene_names();
            @if let [right, up, right_within, up_within] = &genes[..] {
                "The tiles go by the speeds while nothing is seen: " (right) " from left to right, " (up)
                " from bottom to top. Within a tile the pixels go by the speeds while something is seen: "
                (right_within) " from left to right, " (up_within) " from bottom to top."
            }
        }
        p {
            "Colours are classes. A pixel is darker where fewer of its starts are of its class, and where the annotators of the labelled sets, "
            "each a vision model with a written brief, agree less often with the judge about that class."
        }
    }
}

/// The data of an atlas that the page's script draws.
pub(super) fn data(atlas: &Atlas, layout: &Layout, places: &[Option<Place>]) -> Value {
    let entries = || atlas.entries.iter();
    let number = |place: &Option<Place>| {
        let number = place.map_or(NOTHING, |place| {
            place.entry | if place.mirrored { MIRRORED } else { 0 }
        });
        number.to_le_bytes()
    };
    let verdicts: Vec<_> = Verdict::all()
        .map(|verdict| json!({ "name": verdict.name(), "class": verdict.class().name(), "colour": colours::hex(colours::class_colour(verdict.class())) }))
        .collect();
    json!({
        "values": layout.values(),
        "speeds": layout.speeds(),
        "genes": atlas.spec.model().gene_names(),
        "starts": atlas.spec.starts().get(),
        "verdicts": verdicts,
        "features": FEATURE_NAMES,
        "side": atlas.spec.image().resolution(),
        "robot": robot(atlas),
        "map": column(places.iter().map(number)),
        "judged": column(entries().flat_map(|entry| entry.verdicts.iter().map(|verdict| [verdict.number()]))),
        "measured": column(entries().flat_map(|entry| entry.features.map(|feature| (feature as f32).to_le_bytes()))),
        "seeds": column(entries().map(|entry| entry.seed.to_le_bytes())),
    })
}

/// The option of `murmuration simulate` that names the robots; empty for the default robots of that command.
fn robot(atlas: &Atlas) -> &'static str {
    let is_default = atlas.spec.model().preset().is_some() && *atlas.spec.world() == World::default();
    if is_default { "" } else { " --spec spec.toml" }
}
