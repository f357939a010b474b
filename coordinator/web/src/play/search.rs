//! "Search from here": a campaign with the robots that are played with, whose first generation begins with their controller.

use super::{
    super::{Web, actions::page_of, new::request_of, page_error::PageError},
    address::Parameters,
    compare::check_cost,
    strictly,
};
use axum::{
    Form,
    extract::{Query, State},
    response::Redirect,
};
use murmuration_model::NewCampaign;
use murmuration_proto::{CampaignSpec, Invalid};

/// Starts the campaign of an address of the page, and leads to it. The form says which page it is of, so that a second click
/// starts nothing; what is no form is refused.
pub(in super::super) async fn search(
    State(web): State<Web>,
    Query(parameters): Query<Parameters>,
    Form(form): Form<Parameters>,
) -> Result<Redirect, PageError> {
    if parameters.is_empty() {
        return Err(Invalid::new("address", "nothing", "that of a swarm on the page Play").into());
    }
    let play = strictly(&parameters)?;
    check_cost(&play.world)?;
    let spec = CampaignSpec::begun_with(&play.controller, &play.world, play.seed)?;
    let token = form.iter().find(|(name, _)| name == "request");
    let request = token.map(|(_, token)| request_of(token, &spec)).transpose()?;
    let new = NewCampaign {
        request,
        ..spec.into()
    };
    let created = web.campaigns.create(new).await?;
    Ok(page_of(created.record.id.as_str()))
}
