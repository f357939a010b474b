//! Extractor for requests of pages of a campaign, and the redirect to its first page.

use super::{Web, page_error::PageError, visitor::Visitor};
use axum::{
    extract::{FromRequestParts, RawPathParams},
    http::request::Parts,
    response::Redirect,
};
use murmuration_model::CampaignRecord;
use tonic::Status;

/// A request for a page of the campaign whose id is in the address.
pub(super) struct OfCampaign {
    pub(super) web: Web,
    pub(super) record: CampaignRecord,
    pub(super) visitor: Visitor,
}

impl FromRequestParts<Web> for OfCampaign {
    type Rejection = PageError;

    async fn from_request_parts(parts: &mut Parts, web: &Web) -> Result<Self, PageError> {
        let parameters = RawPathParams::from_request_parts(parts, web).await;
        let parameters = parameters.map_err(|error| Status::invalid_argument(error.to_string()))?;
        let id = parameters.iter().find(|(name, _)| *name == "id");
        let (_, id) = id.ok_or(PageError::NoPage)?;
        let Ok(visitor) = Visitor::from_request_parts(parts, web).await;
        Ok(Self {
            web: web.clone(),
            record: web.campaigns.status(id).await?.record,
            visitor,
        })
    }
}

pub(super) fn page_of(campaign: &str) -> Redirect {
    Redirect::to(&format!("/campaigns/{campaign}"))
}
