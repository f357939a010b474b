//! The errors of a page, and the page that shows them.

use super::{layout::layout, visitor::Visitor};
use axum::{
    Json,
    http::{HeaderMap, StatusCode},
    response::{IntoResponse, Response},
};
use maud::html;
use murmuration_access::{NoSeat, Refusal, limits::MAX_POST, preferred};
use murmuration_engine::{blocking::Broken, campaign::CampaignError};
use murmuration_model::CampaignId;
use murmuration_report::picture::PictureError;
use murmuration_store::StoreError;
use murmuration_swarm::{Invalid, grouped};
use serde_json::json;
use tonic::{Code, Status};

/// Why a page cannot be shown.
#[derive(Debug, thiserror::Error)]
pub(super) enum PageError {
    #[error("there is no such page")]
    NoPage,
    #[error("{0}")]
    Refused(Refusal),
    #[error(
        "this took longer than {} seconds and was given up, because the workers or the coordinator are busy: try again \
         later, or use a command, which waits until the report is complete: `murmuration report` for a campaign's report, \
         `murmuration lab study report` for a study's",
        murmuration_access::limits::PAGE_LIMIT.as_secs()
    )]
    Late,
    #[error("{}", .0.message())]
    Service(#[from] Status),
    #[error(transparent)]
    Input(#[from] Invalid),
    /// The form has a wrong content type, or is too long.
    #[error("{}", unread(*.0))]
    Unread(StatusCode),
    #[error(transparent)]
    Campaign(#[from] CampaignError),
    #[error(transparent)]
    Picture(#[from] PictureError),
}

fn unread(status: StatusCode) -> String {
    match status {
        StatusCode::PAYLOAD_TOO_LARGE => {
            let most = grouped(MAX_POST as u64);
            format!("the form of this request is too long: the limit is {most} bytes, encoded")
        }
        _ => "the form of this request cannot be read: send it from the page that it belongs to".to_owned(),
    }
}

/// Media types of errors. Scripts and programs that accept any content get a line of text.
const TEXT: &str = "text/plain";
const PAGE: &str = "text/html";
const OBJECT: &str = "application/json";

/// Whether the client asks for HTML rather than for text.
pub(super) fn wants_page(headers: &HeaderMap) -> bool {
    preferred(headers, &[TEXT, PAGE]) == PAGE
}

impl PageError {
    /// The error as the response to a request with these headers: a page, or a line of text.
    pub(super) fn told(self, headers: &HeaderMap) -> Response {
        match wants_page(headers) {
            true => self.into_response(),
            false => (self.status(), self.to_string()).into_response(),
        }
    }

    /// The error as a whole page.
    fn page(&self) -> Response {
        let title = self.title();
        let is_missing = self.status() == StatusCode::NOT_FOUND;
        let page = layout(
            title,
            &Visitor::ANYBODY,
            html! {
                h1 { (title) }
                p.lead { (self.to_string()) }
                @if is_missing { p { "The address may be mistyped, or the page's contents were deleted." } }
                ul.ways {
                    @if let Some(nearest) = self.nearest() { li { a href={ "/campaigns/" (nearest) } { "Campaign " (nearest) } } }
                    li { a href="/" { "All campaigns" } }
                    @if is_missing {
                        li { a href="/new" { "Start a new campaign" } }
                        li { a href="/play" { "Play with a swarm" } }
                    }
                }
                @if let Self::Refused(Refusal::Role { .. }) = self { p { a href="/login" { "Log in with another token" } } }
            },
        );
        (self.status(), page).into_response()
    }

    /// The campaign that a person probably meant by an unknown id in the address.
    const fn nearest(&self) -> Option<&CampaignId> {
        match self {
            Self::Campaign(CampaignError::Store(StoreError::NoCampaign(unknown))) => unknown.nearest.as_ref(),
            _ => None,
        }
    }

    const fn title(&self) -> &'static str {
        match self {
            Self::NoPage => "Page not found",
            Self::Late | Self::Refused(Refusal::NoSeat(_)) => "The coordinator is busy",
            Self::Refused(_) => "Request refused",
            Self::Service(_) | Self::Input(_) | Self::Unread(_) | Self::Campaign(_) | Self::Picture(_) => {
                "Request failed"
            }
        }
    }

    fn status(&self) -> StatusCode {
        match self {
            Self::NoPage => StatusCode::NOT_FOUND,
            Self::Refused(refusal) => status_of(refusal),
            Self::Late => StatusCode::GATEWAY_TIMEOUT,
            Self::Service(status) => status_of_code(status.code()),
            Self::Input(_) | Self::Campaign(CampaignError::NotNoted(_)) => StatusCode::BAD_REQUEST,
            Self::Unread(status) => *status,
            Self::Campaign(CampaignError::Store(
                StoreError::NoCampaign(_) | StoreError::NoIndividual { .. },
            )) => StatusCode::NOT_FOUND,
            Self::Campaign(
                CampaignError::NotAllowed(_)
                | CampaignError::NotDeleted(_)
                | CampaignError::NotExtended { .. }
                | CampaignError::AfterFeedback(_)
                | CampaignError::OfStudy { .. }
                | CampaignError::NoEmbedding { .. }
                | CampaignError::NoEmbedder(_)
                | CampaignError::TooFewClasses { .. },
            ) => StatusCode::CONFLICT,
            Self::Campaign(error) if error.may_pass() => StatusCode::INSUFFICIENT_STORAGE,
            Self::Campaign(_) | Self::Picture(_) => StatusCode::INTERNAL_SERVER_ERROR,
        }
    }
}

pub(super) const fn status_of(refusal: &Refusal) -> StatusCode {
    match refusal {
        Refusal::NoToken | Refusal::UnknownToken | Refusal::NoCertificate => StatusCode::UNAUTHORIZED,
        Refusal::Role { .. } | Refusal::WrongCertificate(_) | Refusal::Host | Refusal::Origin => {
            StatusCode::FORBIDDEN
        }
        Refusal::Rate | Refusal::NoSeat(NoSeat::Busy(_)) => StatusCode::TOO_MANY_REQUESTS,
        Refusal::NoSeat(NoSeat::Closing) => StatusCode::SERVICE_UNAVAILABLE,
        Refusal::Headers => StatusCode::REQUEST_HEADER_FIELDS_TOO_LARGE,
        Refusal::Slow => StatusCode::REQUEST_TIMEOUT,
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
        let mut response = self.page();
        if response.status() == StatusCode::NOT_FOUND {
            response.extensions_mut().insert(NotFound(self.to_string()));
        }
        response
    }
}

/// The text about a missing page, for clients that show no pages.
#[derive(Debug, Clone)]
struct NotFound(String);

/// Renders the error about a missing page for the client: as a page for browsers, as JSON or a line of text for programs.
pub(super) fn negotiated(response: Response, headers: &HeaderMap) -> Response {
    let Some(NotFound(text)) = response.extensions().get().cloned() else {
        return response;
    };
    match preferred(headers, &[TEXT, PAGE, OBJECT]) {
        PAGE => response,
        OBJECT => (StatusCode::NOT_FOUND, Json(json!({ "error": text }))).into_response(),
        _ => (StatusCode::NOT_FOUND, text + "\n").into_response(),
    }
}

/// The error status of a service, for a script.
#[derive(Debug)]
pub(super) struct Refused(Status);

impl<E: Into<Status>> From<E> for Refused {
    fn from(error: E) -> Self {
        Self(error.into())
    }
}

impl IntoResponse for Refused {
    fn into_response(self) -> Response {
        let status = status_of_code(self.0.code());
        (status, self.0.message().to_owned()).into_response()
    }
}

/// The HTTP status for the code of a service.
const fn status_of_code(code: Code) -> StatusCode {
    match code {
        Code::InvalidArgument | Code::OutOfRange => StatusCode::BAD_REQUEST,
        Code::NotFound => StatusCode::NOT_FOUND,
        Code::AlreadyExists | Code::FailedPrecondition | Code::Aborted => StatusCode::CONFLICT,
        Code::ResourceExhausted | Code::Unavailable | Code::DeadlineExceeded => {
            StatusCode::SERVICE_UNAVAILABLE
        }
        _ => StatusCode::INTERNAL_SERVER_ERROR,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_error_about_a_long_form_names_the_limit() {
        let told = PageError::Unread(StatusCode::PAYLOAD_TOO_LARGE).to_string();
        assert!(told.ends_with("the limit is 2,097,152 bytes, encoded"), "{told}");
        let told = PageError::Unread(StatusCode::UNSUPPORTED_MEDIA_TYPE).to_string();
        assert!(told.contains("cannot be read"), "{told}");
    }
}
