//! Deleting a campaign: what would go is said first.

use super::{Web, layout::layout, page_error::PageError, visitor::Visitor};
use axum::{
    extract::{Path, State},
    response::Redirect,
};
use maud::{Markup, html};
use murmuration_model::{CampaignRecord, CampaignState};

/// The page that asks.
pub(super) async fn page(
    State(web): State<Web>,
    Path(id): Path<String>,
    visitor: Visitor,
) -> Result<Markup, PageError> {
    let record = web.campaigns.status(&id).await?.record;
    let deletion = web.campaigns.deletion(&record.id).await?;
    let id = record.id.as_str();
    Ok(layout(
        "Delete a campaign",
        &visitor,
        html! {
            h1 { "Delete " (id) "?" }
            @if record.state == CampaignState::Running {
                p.lead { "This campaign is running. Cancel it first." }
            } @else if let Some(study) = &record.study {
                p.lead { "This campaign belongs to the study " (study.as_str()) ". To delete it anyway, run:" }
                pre { code { "murmuration delete " (id) " --study " (study.as_str()) " --yes" } }
            } @else {
                p.lead {
                    "This deletes " (deletion.in_words()) ". It cannot be undone. Checkpoints stay. To keep a copy, export the campaign first."
                }
                form method="post" action={ "/campaigns/" (id) "/delete" } { button.danger #delete { "Delete the campaign" } }
            }
            p { a href={ "/campaigns/" (id) } { "Back to the campaign" } " · " a href="/" { "All campaigns" } }
        },
    ))
}

/// Deletes it.
pub(super) async fn delete(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    web.campaigns.delete(id.parse()?, None).await?;
    Ok(Redirect::to("/"))
}

/// The button on a campaign's page, if the campaign may be deleted. It leads to the page that asks: to count what would go takes
/// too long for a page that is sent again and again.
pub(super) fn button(record: &CampaignRecord) -> Markup {
    html! {
        @if record.state != CampaignState::Running && record.study.is_none() {
            form method="get" action={ "/campaigns/" (record.id) "/delete" } { button.danger #delete { "Delete" } }
        }
    }
}
