//! The actions behind the buttons.

use super::{Web, page_error::PageError};
use axum::{
    extract::{Path, State},
    response::Redirect,
};

pub(super) async fn pause(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let paused = web.campaigns.pause(&id).await?;
    Ok(page_of(paused.record.id.as_str()))
}

pub(super) async fn resume(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let resumed = web.campaigns.resume(&id).await?;
    Ok(page_of(resumed.record.id.as_str()))
}

pub(super) async fn cancel(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let cancelled = web.campaigns.cancel(&id).await?;
    Ok(page_of(cancelled.record.id.as_str()))
}

/// Has the campaign learn from its labels, and leads to the map, which shows the progress.
pub(super) async fn refine(State(web): State<Web>, Path(id): Path<String>) -> Result<Redirect, PageError> {
    let refined = web.campaigns.refine(&id).await?;
    Ok(Redirect::to(&format!("/campaigns/{}/map", refined.record.id)))
}

/// The page of a campaign.
pub(super) fn page_of(campaign: &str) -> Redirect {
    Redirect::to(&format!("/campaigns/{campaign}"))
}
