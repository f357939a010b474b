//! The scripts that draw motions and maps, for a report and for a coordinator's pages.
//!
//! Browsers load no modules for a page that is opened as a file, so that a report's page contains the scripts themselves
//! (`INLINE`). A coordinator serves the same scripts as modules ([`MODULES`]).

use maud::{Markup, html};

/// The style of the pins of a map. A page defines `--ink` and `--surface`.
pub const PINS_STYLE: &str = include_str!("pins.css");

/// The zoom buttons of a map; the script `plot.js` handles their clicks.
pub fn zoom_buttons() -> Markup {
    html! {
        button type="button" data-zoom="in" aria-label="Zoom in" { "+" }
        button type="button" data-zoom="out" aria-label="Zoom out" { "−" }
        button type="button" data-zoom="whole" { "Whole map" }
    }
}

/// All scripts in the order of their dependencies, as one text for a `script` element of a page.
pub(crate) const INLINE: &str = concat!(
    include_str!("scripts/words.js"),
    include_str!("scripts/drawing.js"),
    include_str!("scripts/plot.js"),
    include_str!("scripts/pins.js"),
    include_str!("scripts/playback.js"),
);

/// Each script as a module: its file name and its text.
pub const MODULES: [(&str, &str); 6] = [
    (
        "showatlas.js",
        concat!(include_str!("atlas/atlas.js"), "export { showAtlas };\n"),
    ),
    (
        "words.js",
        concat!(
            include_str!("scripts/words.js"),
            "export { counted, grouped, sentence, shown };\n"
        ),
    ),
    (
        "drawing.js",
        concat!(
            include_str!("scripts/drawing.js"),
            "export { Run, column, dotOf, drawArena, drawBodies, drawSwarm, equalScale, fit, stamp };\n"
        ),
    ),
    (
        "plot.js",
        concat!(
            "import { dotOf, equalScale, fit, stamp } from \"./drawing.js\";\n",
            include_str!("scripts/plot.js"),
            "export { PAPER, Plot, steer, zoomButtons };\n"
        ),
    ),
    (
        "pins.js",
        concat!(include_str!("scripts/pins.js"), "export { Pins };\n"),
    ),
    (
        "playback.js",
        concat!(
            "import { drawSwarm } from \"./drawing.js\";\n",
            "import { grouped } from \"./words.js\";\n",
            include_str!("scripts/playback.js"),
            "export { Playback, STEPS_A_SECOND };\n"
        ),
    ),
];
