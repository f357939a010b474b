//! "Search from here": a campaign with the robots that are played with, whose first generation begins with their controller.

use super::{
    super::{Web, actions::page_of, page_error::PageError},
    address::Parameters,
    compare::check_cost,
    strictly,
};
use axum::{
    extract::{Query, State},
    response::Redirect,
};
use murmuration_model::Weight;
use murmuration_proto::CampaignSpec;

/// Starts the campaign of an address of the page, and leads to it.
pub(in super::super) async fn search(
    State(web): State<Web>,
    Query(parameters): Query<Parameters>,
) -> Result<Redirect, PageError> {
    let play = strictly(&parameters)?;
    check_cost(&play.world)?;
    let spec = CampaignSpec::begun_with(&play.controller, &play.world, play.seed)?;
    let created = web.campaigns.create(spec, Weight::default()).await?;
    Ok(page_of(created.record.id.as_str()))
}
