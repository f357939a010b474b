//! What every request meets first: whether its connection may ask as often, whether it may come from a page, and whether
//! it may ask for that.

use super::{
    Access, PresentedCredentials, Refusal, Session, Sessions,
    machine::Certificate,
    needs::{self, Requirement},
    origin::{self, Asked, Hosts},
};
use crate::{
    connections::Visit,
    limits::{MAX_HEADER_BYTES, MAX_HEADERS},
};
use axum::{
    body::{Body, BodyDataStream},
    extract::{MatchedPath, Request, State},
    http::{
        HeaderMap, HeaderValue, Uri,
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

/// One of a coordinator's ways in.
#[derive(Debug)]
pub struct Door {
    /// Whom it lets in.
    pub access: Access,
    /// The browsers that have logged in.
    pub sessions: Sessions,
    /// Under which names it answers.
    pub hosts: Hosts,
    /// Whether what passes is encrypted.
    pub is_encrypted: bool,
    /// How it looks to a person that a request is refused.
    pub show_refusal: ShowRefusal,
}

/// A refusal, shown to whoever asked for a path with these headers.
pub type ShowRefusal = fn(Refusal, &Uri, &HeaderMap) -> Response;

/// Turns away what may not come in, in the words of who asked: a status, a page, or a line of text.
pub async fn admit(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let asked = Asked::of(&request);
    let speaks_grpc = asked != Asked::Page && origin::is_grpc(request.headers());
    // A cookie counts for pages alone: a browser sends it whoever asks.
    let session = match (asked, bearer(request.headers())) {
        (Asked::Page, None) => door.sessions.of(request.headers(), SystemTime::now()),
        _ => None,
    };
    match door.allows(asked, session.as_ref(), &request) {
        Ok(()) => while_it_lasts(session, next.run(request).await),
        Err(refusal) => {
            tracing::debug!(path = request.uri().path(), %refusal, "turned away");
            match speaks_grpc {
                true => Status::from(refusal).into_http(),
                false => (door.show_refusal)(refusal, request.uri(), request.headers()),
            }
        }
    }
}

impl Asked {
    fn of(request: &Request) -> Self {
        let is_somewhere = request.extensions().get::<MatchedPath>().is_some();
        if needs::of_method(request.uri().path()).is_some() {
            Self::Method
        } else if !is_somewhere && origin::is_grpc(request.headers()) {
            Self::NoService
        } else {
            Self::Page
        }
    }
}

impl Door {
    fn allows(&self, asked: Asked, session: Option<&Session>, request: &Request) -> Result<(), Refusal> {
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
        let shown = PresentedCredentials {
            token: bearer(request.headers())
                .map(TokenDigest::of)
                .or(session.map(|session| session.token)),
            certificate: chain.and_then(|chain| chain.first().map(Certificate::read)),
        };
        self.access.admits(need(request), &shown)
    }

    /// The token that this browser has logged in with.
    pub fn logged_in(&self, headers: &HeaderMap) -> Option<TokenDigest> {
        let session = self.sessions.of(headers, SystemTime::now());
        session.map(|session| session.token)
    }
}

/// What a request must show.
fn need(request: &Request) -> Requirement {
    needs::of_method(request.uri().path()).unwrap_or_else(|| {
        let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
        needs::of_page(request.method(), route)
    })
}

/// Whether anybody may have what is asked for, token or not.
pub fn is_for_anybody(request: &Request) -> bool {
    need(request) == Requirement::Nothing
}

/// Whether its headers are within the limits, which are the same whichever HTTP it came by.
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

/// What a page goes on to be sent ends with the session that it was let in by.
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

/// A body that breaks off at its end or when something else has ended.
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
