//! The checks that every request passes first: the rate of its connection, the size of its headers, the page that it comes
//! from, and the credentials that its route requires.

use super::{
    Access, PresentedCredentials, Refusal, Sessions,
    machine::Certificate,
    origin::{self, Asked, Hosts},
    requirement::{Requirement, Requirements},
    sessions::Session,
};
use crate::{
    connections::Visit,
    limits::{MAX_HEADER_BYTES, MAX_HEADERS},
};
use axum::{
    body::{Body, BodyDataStream},
    extract::{MatchedPath, Request, State},
    http::{
        HeaderMap, HeaderValue,
        header::{AUTHORIZATION, CONTENT_TYPE, HOST},
    },
    middleware::Next,
    response::Response,
};
use murmuration_link::TokenDigest;
use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::SystemTime,
};
use tokio_stream::Stream;
use tonic::{Status, transport::server::TlsConnectInfo};

/// Bytes that a header counts for besides its name and value, as HTTP/2 has it.
const HEADER_OVERHEAD: usize = 32;

/// A listener of a coordinator, and who may pass it.
#[derive(Debug)]
pub struct Door {
    /// Who may pass.
    pub access: Access,
    /// The browsers that have logged in.
    pub sessions: Sessions,
    /// The host names that it answers to.
    pub hosts: Hosts,
    /// Whether its connections are encrypted.
    pub is_encrypted: bool,
    pub show_refusal: ShowRefusal,
}

/// Renders a refusal of this request for the client that sent it.
pub(crate) type ShowRefusal = fn(Refusal, &Request) -> Response;

/// A door, and what the routes behind it require.
#[derive(Debug, Clone)]
pub(super) struct Gate {
    pub(super) door: Arc<Door>,
    pub(super) requirements: Arc<Requirements>,
}

/// Refuses what may not come in, in the form that the client reads: a gRPC status, a page, or a line of text.
///
/// Handlers behind it find the [`Door`] among the extensions of the request; layers in front of it find the
/// [`Requirement`] among those of the response.
pub(super) async fn admit(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let requirement = gate.requirements.of(&request);
    request.extensions_mut().insert(gate.door.clone());
    let mut response = gate.answer(requirement, request, next).await;
    response.extensions_mut().insert(requirement);
    response
}

impl Gate {
    async fn answer(&self, requirement: Requirement, request: Request, next: Next) -> Response {
        let Self { door, requirements } = self;
        let asked = Asked::of(&request, requirements);
        let speaks_grpc = asked != Asked::Page && origin::is_grpc(request.headers());
        // Only pages accept a cookie: a browser sends it with a request of any site.
        let session = match (asked, bearer(request.headers())) {
            (Asked::Page, None) => door.sessions.of(request.headers(), SystemTime::now()),
            _ => None,
        };
        match door.allows(asked, requirement, session.as_ref(), &request) {
            Ok(()) => while_it_lasts(session, next.run(request).await),
            Err(refusal) => {
                tracing::debug!(path = request.uri().path(), %refusal, "request refused");
                match speaks_grpc {
                    true => Status::from(refusal).into_http(),
                    false => (door.show_refusal)(refusal, &request),
                }
            }
        }
    }
}

impl Asked {
    fn of(request: &Request, requirements: &Requirements) -> Self {
        let is_somewhere = request.extensions().get::<MatchedPath>().is_some();
        if requirements.of_method(request.uri().path()).is_some() {
            Self::Method
        } else if !is_somewhere && origin::is_grpc(request.headers()) {
            Self::NoService
        } else {
            Self::Page
        }
    }
}

impl Door {
    fn allows(
        &self,
        asked: Asked,
        requirement: Requirement,
        session: Option<&Session>,
        request: &Request,
    ) -> Result<(), Refusal> {
        let visit = request.extensions().get::<Visit>();
        if visit.is_some_and(|visit| !visit.may_ask()) {
            return Err(Refusal::Rate);
        }
        if !has_room_for_headers(request) {
            return Err(Refusal::Headers);
        }
        origin::check(self.hosts, self.is_encrypted, asked, request)?;
        let connection = request.extensions().get::<TlsConnectInfo<Visit>>();
        let chain = connection.and_then(TlsConnectInfo::peer_certs);
        let presented = PresentedCredentials {
            token: bearer(request.headers())
                .map(TokenDigest::of)
                .or(session.map(|session| session.token)),
            certificate: chain.and_then(|chain| chain.first().map(Certificate::read)),
        };
        self.access.admits(requirement, &presented)
    }

    /// The token of the session of a browser.
    pub fn logged_in(&self, headers: &HeaderMap) -> Option<TokenDigest> {
        let session = self.sessions.of(headers, SystemTime::now());
        session.map(|session| session.token)
    }
}

/// Whether the headers of a request are within the limits, which are the same for every version of HTTP.
fn has_room_for_headers(request: &Request) -> bool {
    let (uri, headers) = (request.uri(), request.headers());
    // HTTP/2 has the host in the address.
    let host = uri.authority().filter(|_| !headers.contains_key(HOST));
    let host = host.map(|host| (&HOST, host.as_str().len()));
    let all = headers
        .iter()
        .map(|(name, value)| (name, value.len()))
        .chain(host);
    let sizes = all.map(|(name, length)| name.as_str().len() + length + HEADER_OVERHEAD);
    let (count, bytes) = sizes.fold((0, 0), |(count, bytes), size| (count + 1, bytes + size));
    let path = uri.path_and_query().map_or(0, |path| path.as_str().len());
    count <= MAX_HEADERS && bytes + path <= MAX_HEADER_BYTES as usize
}

/// Ends an event stream when the session of its request ends.
fn while_it_lasts(session: Option<Session>, response: Response) -> Response {
    let kind = response.headers().get(CONTENT_TYPE).map(HeaderValue::as_bytes);
    match session {
        Some(session) if kind.is_some_and(|kind| kind.starts_with(b"text/event-stream")) => {
            response.map(|body| {
                Body::from_stream(Until {
                    end: Box::pin(session.ended()),
                    body: body.into_data_stream(),
                })
            })
        }
        _ => response,
    }
}

/// A body that ends when it is complete or when a future has.
struct Until<F> {
    end: Pin<Box<F>>,
    body: BodyDataStream,
}

impl<F: Future<Output = ()>> Stream for Until<F> {
    type Item = <BodyDataStream as Stream>::Item;

    fn poll_next(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Option<Self::Item>> {
        match self.end.as_mut().poll(context) {
            Poll::Ready(()) => Poll::Ready(None),
            Poll::Pending => Pin::new(&mut self.body).poll_next(context),
        }
    }
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let (scheme, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then(|| token.trim())
}

impl From<Refusal> for Status {
    fn from(refusal: Refusal) -> Self {
        let said = refusal.to_string();
        match refusal {
            Refusal::NoToken | Refusal::UnknownToken | Refusal::NoCertificate => Self::unauthenticated(said),
            Refusal::Role { .. } | Refusal::WrongCertificate(_) | Refusal::Host | Refusal::Origin => {
                Self::permission_denied(said)
            }
            Refusal::Rate | Refusal::Headers => Self::resource_exhausted(said),
            Refusal::ContentType => Self::invalid_argument(said),
        }
    }
}
