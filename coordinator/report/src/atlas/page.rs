//! The page: the picture to zoom into. It holds everything but the pictures of swarms.

use super::{Atlas, Layout, colour, layout::Place};
use crate::picture::columns::column;
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, PreEscaped, html};
use murmuration_model::colours;
use murmuration_proto::{FEATURE_NAMES, Verdict, World, counted, grouped};
use serde_json::json;

const STYLE: &str = include_str!("atlas.css");
const SCRIPT: &str = include_str!("atlas.js");

/// The page loads nothing but pictures beside it.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data: 'self' file:; \
                      base-uri 'none'; form-action 'none'";

/// Bit of a number of the map that says that a mirror image is there.
const MIRRORED: u32 = 1 << 31;
/// What the map has where nothing was evaluated.
const NOTHING: u32 = MIRRORED - 1;

/// The whole document.
pub(super) fn render(atlas: &Atlas, layout: &Layout, places: &[Option<Place>], map: &[u8]) -> String {
    let map = format!("data:image/png;base64,{}", STANDARD.encode(map));
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta http-equiv="Content-Security-Policy" content=(POLICY);
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="generator" content="Murmuration";
                title { "Atlas of the robot " (atlas.spec.model()) }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    canvas #map tabindex="0" aria-label="Map of all controllers: a pixel each, coloured by class" {}
                    img #source src=(map) alt="" hidden;
                    aside {
                        h1 { "Every controller of the robot " (atlas.spec.model()) }
                        p {
                            (grouped((layout.side() * layout.side()) as u64)) " controllers, a pixel each. "
                            (grouped(atlas.entries.len() as u64)) " of them were simulated from "
                            (counted(atlas.spec.starts().get() as u64, "start")) " each; the others are their mirror images."
                        }
                        p {
                            @let genes = atlas.spec.model().gene_names();
                            @if let [right, up, right_within, up_within] = &genes[..] {
                                "The tiles go by the speeds while nothing is seen: " (right) " from left to right, " (up)
                                " from bottom to top. Within a tile the pixels go by the speeds while something is seen: "
                                (right_within) " from left to right, " (up_within) " from bottom to top."
                            }
                        }
                        p { "Scroll to zoom, drag to move, click for a controller. Close up, the pictures of the swarms appear." }
                        ul #classes {}
                        section #chosen aria-live="polite" { p { "Point at a controller." } }
                    }
                }
                script type="application/json" #data { (PreEscaped(data(atlas, layout, places))) }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    page.into_string()
}

/// What the script draws from.
fn data(atlas: &Atlas, layout: &Layout, places: &[Option<Place>]) -> String {
    let entries = || atlas.entries.iter();
    let number = |place: &Option<Place>| {
        let number = place.map_or(NOTHING, |place| {
            place.entry | if place.mirrored { MIRRORED } else { 0 }
        });
        number.to_le_bytes()
    };
    let verdicts: Vec<_> = Verdict::all()
        .map(|verdict| json!({ "name": verdict.name(), "class": verdict.class().name(), "colour": colours::hex(colour(verdict.class())) }))
        .collect();
    let data = json!({
        "values": layout.values(),
        "speeds": layout.speeds(),
        "genes": atlas.spec.model().gene_names(),
        "starts": atlas.spec.starts().get(),
        "verdicts": verdicts,
        "features": FEATURE_NAMES,
        "side": atlas.spec.image().resolution(),
        "robot": robot(atlas),
        "map": column(places.iter().map(number)),
        "said": column(entries().flat_map(|entry| entry.verdicts.iter().map(|verdict| [verdict.number()]))),
        "measured": column(entries().flat_map(|entry| entry.features.map(|feature| (feature as f32).to_le_bytes()))),
        "seeds": column(entries().map(|entry| entry.seed.to_le_bytes())),
    });
    // Nothing in it may end the element that holds it.
    data.to_string().replace('<', "\\u003c")
}

/// The option that names the robots to `murmuration simulate`, if they are not those that it has by default.
fn robot(atlas: &Atlas) -> &'static str {
    let is_default = atlas.spec.model().preset().is_some() && *atlas.spec.world() == World::default();
    if is_default { "" } else { " --spec spec.toml" }
}
