//! Why a page cannot be shown, as a page.

use super::{pages::layout, visitor::Visitor};
use crate::{campaign::CampaignError, picture::PictureError, store::StoreError};
use axum::{
    http::StatusCode,
    response::{IntoResponse, Response},
};
use maud::html;
use murmuration_proto::Invalid;

/// What is wrong with a request, or went wrong with it.
#[derive(Debug, thiserror::Error)]
pub(super) enum Wrong {
    /// The request names another host.
    #[error("this page is only served under the coordinator's own address")]
    Host,
    /// The request comes from another site's page.
    #[error("only pages of this coordinator may ask for that")]
    Origin,
    /// There is no page of that address.
    #[error("there is no such page")]
    NoPage,
    /// Whoever asks may not have it.
    #[error("{1}")]
    Refused(StatusCode, String),
    /// Too many want the same.
    #[error("{0}")]
    Busy(String),
    /// A value that is not allowed.
    #[error("{0}")]
    Input(#[from] Invalid),
    /// The campaign does not do that.
    #[error("{0}")]
    Campaign(#[from] CampaignError),
    /// A picture cannot be made.
    #[error("{0}")]
    Picture(#[from] PictureError),
}

impl Wrong {
    fn status(&self) -> StatusCode {
        match self {
            Self::Host | Self::Origin => StatusCode::FORBIDDEN,
            Self::NoPage => StatusCode::NOT_FOUND,
            Self::Refused(status, _) => *status,
            Self::Busy(_) => StatusCode::SERVICE_UNAVAILABLE,
            Self::Input(_) => StatusCode::BAD_REQUEST,
            Self::Campaign(CampaignError::Store(
                StoreError::NoCampaign(_) | StoreError::NoIndividual { .. },
            )) => StatusCode::NOT_FOUND,
            Self::Campaign(
                CampaignError::NotAllowed(_)
                | CampaignError::NoEmbedding { .. }
                | CampaignError::NoEmbedder(_)
                | CampaignError::TooFewClasses { .. },
            ) => StatusCode::CONFLICT,
            Self::Campaign(error) if error.may_pass() => StatusCode::INSUFFICIENT_STORAGE,
            Self::Campaign(_) | Self::Picture(_) => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

impl From<StoreError> for Wrong {
    fn from(error: StoreError) -> Self {
        Self::Campaign(error.into())
    }
}

impl IntoResponse for Wrong {
    fn into_response(self) -> Response {
        let page = layout(
            "Not that way",
            &Visitor::ANYBODY,
            html! {
                h1 { "Not that way" }
                p.lead { (self.to_string()) }
                p { a href="/" { "All campaigns" } }
                @if let Self::Refused(..) = self { p { a href="/login" { "Log in with another token" } } }
            },
        );
        (self.status(), page).into_response()
    }
}
