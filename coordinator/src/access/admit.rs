//! What every request meets first: whether its connection may ask as often, and whether it may ask for that.

use super::{Access, COOKIE, Refusal, Sessions, Shown, machine::Certificate, needs};
use crate::{connections::Visit, web};
use axum::{
    extract::{MatchedPath, Request, State},
    http::{
        HeaderMap,
        header::{AUTHORIZATION, COOKIE as COOKIES},
    },
    middleware::Next,
    response::Response,
};
use murmuration_link::TokenDigest;
use std::{sync::Arc, time::SystemTime};
use tonic::{Status, transport::server::TlsConnectInfo};

/// One of a coordinator's ways in.
#[derive(Debug)]
pub(crate) struct Door {
    /// Whom it lets in.
    pub(crate) access: Access,
    /// The browsers that have logged in.
    pub(crate) sessions: Sessions,
    /// Whether what passes is encrypted.
    pub(crate) is_encrypted: bool,
}

/// Turns away what may not come in, in the words of who asked: a status, a page, or a line of text.
pub(crate) async fn admit(State(door): State<Arc<Door>>, request: Request, next: Next) -> Response {
    let method = needs::of_method(request.uri().path());
    let allowed = pace(&request).and_then(|()| {
        let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
        let need = method.unwrap_or_else(|| needs::of_page(request.method(), route));
        let shown = door.shown(&request, method.is_none());
        door.access.admits(need, &shown)
    });
    if let Err(refusal) = &allowed {
        tracing::debug!(path = request.uri().path(), %refusal, "turned away");
    }
    match allowed {
        Ok(()) => next.run(request).await,
        Err(refusal) if method.is_some() => Status::from(refusal).into_http(),
        Err(refusal) => web::turn_away(&refusal, request.uri(), request.headers()),
    }
}

fn pace(request: &Request) -> Result<(), Refusal> {
    match request.extensions().get::<Visit>() {
        Some(visit) if !visit.may_ask() => Err(Refusal::Rate),
        _ => Ok(()),
    }
}

impl Door {
    /// What a request shows. A cookie counts for pages alone: a browser sends it whoever asks.
    fn shown(&self, request: &Request, is_page: bool) -> Shown {
        let headers = request.headers();
        let token = bearer(headers).map(TokenDigest::of);
        let session = is_page.then(|| self.logged_in(headers)).flatten();
        let connection = request.extensions().get::<TlsConnectInfo<Visit>>();
        let chain = connection.and_then(TlsConnectInfo::peer_certs);
        Shown {
            token: token.or(session),
            certificate: chain.and_then(|chain| chain.first().map(Certificate::read)),
        }
    }

    /// The token that this browser has logged in with.
    pub(crate) fn logged_in(&self, headers: &HeaderMap) -> Option<TokenDigest> {
        let cookies = headers
            .get_all(COOKIES)
            .iter()
            .filter_map(|line| line.to_str().ok());
        let mut cookies = cookies.flat_map(|line| line.split(';'));
        let session = cookies.find_map(|cookie| cookie.trim().strip_prefix(COOKIE)?.strip_prefix('='))?;
        self.sessions.token(session, SystemTime::now())
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
            Refusal::Role { .. } | Refusal::WrongCertificate(_) => Self::permission_denied(said),
            Refusal::Rate => Self::resource_exhausted(said),
        }
    }
}
