//! Why a page cannot be shown, as a page.

use super::{layout::layout, refused, visitor::Visitor};
use axum::{
    http::{HeaderMap, StatusCode, header::ACCEPT},
    response::{IntoResponse, Response},
};
use maud::html;
use murmuration_access::Refusal;
use murmuration_engine::{blocking::Broken, campaign::CampaignError};
use murmuration_proto::Invalid;
use murmuration_report::picture::PictureError;
use murmuration_store::StoreError;
use tonic::Status;

/// What is wrong with a request, or went wrong with it.
#[derive(Debug, thiserror::Error)]
pub(super) enum PageError {
    /// There is no page of that address.
    #[error("there is no such page")]
    NoPage,
    /// Whoever asks may not have it.
    #[error("{0}")]
    Refused(Refusal),
    /// Too many want the same.
    #[error("{0}")]
    Busy(String),
    /// It would take too long.
    #[error(
        "this took longer than {} seconds and was given up, since workers or the coordinator have much to do: try again \
         later; the command `murmuration report` waits for as long as a report takes",
        murmuration_access::limits::PAGE_LIMIT.as_secs()
    )]
    Late,
    /// A service refused it.
    #[error("{}", .0.message())]
    Service(#[from] Status),
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

/// Whether somebody would read a page: scripts and programs ask for anything.
pub(super) fn wants_page(headers: &HeaderMap) -> bool {
    let accepts = headers.get(ACCEPT).and_then(|accepts| accepts.to_str().ok());
    accepts.is_some_and(|kinds| kinds.contains("text/html"))
}

impl PageError {
    /// The answer to a request with these headers: a page, or a line of text.
    pub(super) fn told(self, headers: &HeaderMap) -> Response {
        match wants_page(headers) {
            true => self.into_response(),
            false => (self.status(), self.to_string()).into_response(),
        }
    }

    fn status(&self) -> StatusCode {
        match self {
            Self::NoPage => StatusCode::NOT_FOUND,
            Self::Refused(refusal) => status_of(refusal),
            Self::Busy(_) => StatusCode::SERVICE_UNAVAILABLE,
            Self::Late => StatusCode::GATEWAY_TIMEOUT,
            Self::Service(status) => refused::status_of(status.code()),
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

/// The status of an answer to who may not come in.
pub(super) const fn status_of(refusal: &Refusal) -> StatusCode {
    match refusal {
        Refusal::NoToken | Refusal::UnknownToken | Refusal::NoCertificate => StatusCode::UNAUTHORIZED,
        Refusal::Role { .. } | Refusal::WrongCertificate(_) | Refusal::Host | Refusal::Origin => {
            StatusCode::FORBIDDEN
        }
        Refusal::Rate => StatusCode::TOO_MANY_REQUESTS,
        Refusal::Headers => StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
        Refusal::ContentType => StatusCode::UNSUPPORTED_MEDIA_TYPE,
    }
}

impl From<Broken> for PageError {
    fn from(broken: Broken) -> Self {
        CampaignError::from(broken).into()
    }
}

impl From<StoreError> for PageError {
    fn from(error: StoreError) -> Self {
        Self::Campaign(error.into())
    }
}

impl IntoResponse for PageError {
    fn into_response(self) -> Response {
        let page = layout(
            "Not that way",
            &Visitor::ANYBODY,
            html! {
                h1 { "Not that way" }
                p.lead { (self.to_string()) }
                p { a href="/" { "All campaigns" } }
                @if let Self::Refused(Refusal::Role { .. }) = self { p { a href="/login" { "Log in with another token" } } }
            },
        );
        (self.status(), page).into_response()
    }
}
