//! What pages are made of besides markup: style sheets and scripts, part of the binary.

use super::page_error::PageError;
use axum::{
    extract::Path,
    http::header::{CACHE_CONTROL, CONTENT_TYPE},
    response::IntoResponse,
};

const CSS: &str = "text/css";
const SCRIPT: &str = "text/javascript";

/// Name, kind and content of each.
const ASSETS: [(&str, &str, &str); 21] = [
    ("icon.svg", "image/svg+xml", include_str!("assets/icon.svg")),
    ("style.css", CSS, include_str!("assets/style.css")),
    ("teach.css", CSS, include_str!("assets/teach.css")),
    ("noscript.css", CSS, include_str!("assets/noscript.css")),
    ("live.js", SCRIPT, include_str!("assets/live.js")),
    // What reports draw with too, as a module.
    (
        "drawing.js",
        SCRIPT,
        concat!(
            include_str!("../../report/src/picture/drawing.js"),
            "export { Run, column, dotOf, drawSwarm, equalScale, fit, stamp };\n"
        ),
    ),
    (
        "words.js",
        SCRIPT,
        concat!(
            include_str!("../../report/src/picture/words.js"),
            "export { counted };\n"
        ),
    ),
    ("annotator.js", SCRIPT, include_str!("assets/annotator.js")),
    ("coordinator.js", SCRIPT, include_str!("assets/coordinator.js")),
    ("events.js", SCRIPT, include_str!("assets/events.js")),
    ("keys.js", SCRIPT, include_str!("assets/keys.js")),
    ("label.js", SCRIPT, include_str!("assets/label.js")),
    ("lasso.js", SCRIPT, include_str!("assets/lasso.js")),
    ("map.js", SCRIPT, include_str!("assets/map.js")),
    ("outbox.js", SCRIPT, include_str!("assets/outbox.js")),
    ("palette.js", SCRIPT, include_str!("assets/palette.js")),
    ("player.js", SCRIPT, include_str!("assets/player.js")),
    ("plot.js", SCRIPT, include_str!("assets/plot.js")),
    ("queue.js", SCRIPT, include_str!("assets/queue.js")),
    ("sheet.js", SCRIPT, include_str!("assets/sheet.js")),
    ("taxonomy.js", SCRIPT, include_str!("assets/taxonomy.js")),
];

/// One of them.
pub(super) async fn asset(Path(name): Path<String>) -> Result<impl IntoResponse, PageError> {
    let found = ASSETS.iter().find(|(known, _, _)| *known == name);
    let (_, kind, content) = found.ok_or(PageError::NoPage)?;
    Ok(([(CONTENT_TYPE, *kind), (CACHE_CONTROL, "no-cache")], *content))
}
