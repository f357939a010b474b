//! The style sheets and scripts of the pages, which are part of the binary.

use super::page_error::PageError;
use axum::{
    extract::Path,
    http::header::{CACHE_CONTROL, CONTENT_TYPE},
    response::IntoResponse,
};
use murmuration_report::scripts::MODULES;

const CSS: &str = "text/css";
const SCRIPT: &str = "text/javascript";

/// The file name, type and content of each asset, except the scripts that the pages share with reports.
const ASSETS: [(&str, &str, &str); 60] = [
    ("icon.svg", "image/svg+xml", include_str!("assets/icon.svg")),
    ("style.css", CSS, include_str!("assets/style.css")),
    ("teach.css", CSS, include_str!("assets/teach.css")),
    ("noscript.css", CSS, include_str!("assets/noscript.css")),
    ("atlas.css", CSS, include_str!("assets/atlas.css")),
    ("card.css", CSS, murmuration_report::card::STYLE),
    ("pins.css", CSS, murmuration_report::scripts::PINS_STYLE),
    ("tables.css", CSS, murmuration_study::TABLES_STYLE),
    ("study.css", CSS, include_str!("assets/study.css")),
    ("live.js", SCRIPT, include_str!("assets/live.js")),
    ("annotator.js", SCRIPT, include_str!("assets/annotator.js")),
    ("answers.js", SCRIPT, include_str!("assets/answers.js")),
    ("atlas.js", SCRIPT, include_str!("assets/atlas.js")),
    ("endless.js", SCRIPT, include_str!("assets/endless.js")),
    ("around.js", SCRIPT, include_str!("assets/around.js")),
    ("ask.js", SCRIPT, include_str!("assets/ask.js")),
    ("base.js", SCRIPT, include_str!("assets/base.js")),
    ("campaigns.js", SCRIPT, include_str!("assets/campaigns.js")),
    ("chart.js", SCRIPT, include_str!("assets/chart.js")),
    ("classes.js", SCRIPT, include_str!("assets/classes.js")),
    ("colours.js", SCRIPT, include_str!("assets/colours.js")),
    ("compare.js", SCRIPT, include_str!("assets/compare.js")),
    ("coordinator.js", SCRIPT, include_str!("assets/coordinator.js")),
    ("curves.js", SCRIPT, include_str!("assets/curves.js")),
    ("events.js", SCRIPT, include_str!("assets/events.js")),
    ("filter.js", SCRIPT, include_str!("assets/filter.js")),
    ("gallery.js", SCRIPT, include_str!("assets/gallery.js")),
    ("glpoints.js", SCRIPT, include_str!("assets/glpoints.js")),
    ("keys.js", SCRIPT, include_str!("assets/keys.js")),
    ("label.js", SCRIPT, include_str!("assets/label.js")),
    ("lasso.js", SCRIPT, include_str!("assets/lasso.js")),
    ("map.js", SCRIPT, include_str!("assets/map.js")),
    ("marks.js", SCRIPT, include_str!("assets/marks.js")),
    ("menu.js", SCRIPT, include_str!("assets/menu.js")),
    ("menus.js", SCRIPT, include_str!("assets/menus.js")),
    ("moving.js", SCRIPT, include_str!("assets/moving.js")),
    ("new.js", SCRIPT, include_str!("assets/new.js")),
    ("outbox.js", SCRIPT, include_str!("assets/outbox.js")),
    ("overwrite.js", SCRIPT, include_str!("assets/overwrite.js")),
    ("palette.js", SCRIPT, include_str!("assets/palette.js")),
    ("paths.js", SCRIPT, include_str!("assets/paths.js")),
    ("pieces.js", SCRIPT, include_str!("assets/pieces.js")),
    ("play.css", CSS, include_str!("assets/play.css")),
    ("play.js", SCRIPT, include_str!("assets/play.js")),
    ("player.js", SCRIPT, include_str!("assets/player.js")),
    ("points.js", SCRIPT, include_str!("assets/points.js")),
    ("progress.js", SCRIPT, include_str!("assets/progress.js")),
    ("queue.js", SCRIPT, include_str!("assets/queue.js")),
    ("rejudge.js", SCRIPT, include_str!("assets/rejudge.js")),
    ("roboteditor.css", CSS, include_str!("assets/roboteditor.css")),
    ("roboteditor.js", SCRIPT, include_str!("assets/roboteditor.js")),
    ("robotdrawing.js", SCRIPT, include_str!("assets/robotdrawing.js")),
    ("robottoml.js", SCRIPT, include_str!("assets/robottoml.js")),
    ("sheet.js", SCRIPT, include_str!("assets/sheet.js")),
    ("sidebyside.js", SCRIPT, include_str!("assets/sidebyside.js")),
    ("sketch.js", SCRIPT, include_str!("assets/sketch.js")),
    ("study.js", SCRIPT, include_str!("assets/study.js")),
    ("taxonomy.js", SCRIPT, include_str!("assets/taxonomy.js")),
    ("timeline.js", SCRIPT, include_str!("assets/timeline.js")),
    ("views.js", SCRIPT, include_str!("assets/views.js")),
];

pub(super) async fn asset(Path(name): Path<String>) -> Result<impl IntoResponse, PageError> {
    let shared = MODULES.map(|(name, content)| (name, SCRIPT, content));
    let found = ASSETS
        .into_iter()
        .chain(shared)
        .find(|(known, _, _)| *known == name);
    let (_, kind, content) = found.ok_or(PageError::NoPage)?;
    Ok(([(CONTENT_TYPE, kind), (CACHE_CONTROL, "no-cache")], content))
}
