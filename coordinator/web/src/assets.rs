//! Style sheets and scripts, which are part of the binary.

use super::page_error::PageError;
use axum::{
    extract::Path,
    http::header::{CACHE_CONTROL, CONTENT_TYPE},
    response::IntoResponse,
};
use murmuration_report::scripts::MODULES;

const CSS: &str = "text/css";
const SCRIPT: &str = "text/javascript";

/// The file name, type and content of each asset, without the scripts that reports share.
const ASSETS: [(&str, &str, &str); 23] = [
    ("icon.svg", "image/svg+xml", include_str!("assets/icon.svg")),
    ("style.css", CSS, include_str!("assets/style.css")),
    ("teach.css", CSS, include_str!("assets/teach.css")),
    ("noscript.css", CSS, include_str!("assets/noscript.css")),
    ("live.js", SCRIPT, include_str!("assets/live.js")),
    ("annotator.js", SCRIPT, include_str!("assets/annotator.js")),
    ("compare.js", SCRIPT, include_str!("assets/compare.js")),
    ("coordinator.js", SCRIPT, include_str!("assets/coordinator.js")),
    ("events.js", SCRIPT, include_str!("assets/events.js")),
    ("keys.js", SCRIPT, include_str!("assets/keys.js")),
    ("label.js", SCRIPT, include_str!("assets/label.js")),
    ("lasso.js", SCRIPT, include_str!("assets/lasso.js")),
    ("map.js", SCRIPT, include_str!("assets/map.js")),
    ("outbox.js", SCRIPT, include_str!("assets/outbox.js")),
    ("palette.js", SCRIPT, include_str!("assets/palette.js")),
    ("pieces.js", SCRIPT, include_str!("assets/pieces.js")),
    ("play.css", CSS, include_str!("assets/play.css")),
    ("play.js", SCRIPT, include_str!("assets/play.js")),
    ("player.js", SCRIPT, include_str!("assets/player.js")),
    ("points.js", SCRIPT, include_str!("assets/points.js")),
    ("queue.js", SCRIPT, include_str!("assets/queue.js")),
    ("sheet.js", SCRIPT, include_str!("assets/sheet.js")),
    ("taxonomy.js", SCRIPT, include_str!("assets/taxonomy.js")),
];

/// Serves an asset.
pub(super) async fn asset(Path(name): Path<String>) -> Result<impl IntoResponse, PageError> {
    let shared = MODULES.map(|(name, content)| (name, SCRIPT, content));
    let found = ASSETS
        .into_iter()
        .chain(shared)
        .find(|(known, _, _)| *known == name);
    let (_, kind, content) = found.ok_or(PageError::NoPage)?;
    Ok(([(CONTENT_TYPE, kind), (CACHE_CONTROL, "no-cache")], content))
}
