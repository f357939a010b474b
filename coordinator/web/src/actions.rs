//! The actions behind the buttons.

use super::{Web, examples::EXAMPLES, page_error::PageError};
use axum::{
    Form,
    extract::{Path, State},
    response::Redirect,
};
use murmuration_model::Weight;
use murmuration_proto::{CampaignSpec, Invalid, SpecFileError};
use serde::Deserialize;

/// The form that starts an example.
#[derive(Debug, Deserialize)]
pub(super) struct Start {
    example: String,
}

pub(super) async fn start(
    State(web): State<Web>,
    Form(Start { example }): Form<Start>,
) -> Result<Redirect, PageError> {
    let found = EXAMPLES.iter().find(|(name, _, _)| *name == example);
    let (_, _, text) = found.ok_or_else(|| {
        let names = EXAMPLES.map(|(name, _, _)| name).join(", ");
        Invalid::new("example", format!("{example:?}"), format!("one of {names}"))
    })?;
    let spec = CampaignSpec::from_toml(text).map_err(|error| match error {
        SpecFileError::Value(invalid) => invalid,
        SpecFileError::Syntax(error) => Invalid::new("example", example, error.to_string()),
    })?;
    let created = web.campaigns.create(spec, Weight::default()).await?;
    Ok(page_of(created.record.id.as_str()))
}

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
