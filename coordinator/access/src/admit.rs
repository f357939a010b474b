//! The checks that every request passes first: the rate of its connection, the size of its headers, the page that it comes
//! from, and the credentials that its route requires.

use super::{
    Access, OneTimeCodes, PresentedCredentials, PublicUrl, Refusal, Role, Sessions,
    machine::{self, ByCertificate, Certificate},
    origin::{self, Asked, Hosts},
    requirement::{Requirement, Requirements},
    response_body::Bodies,
    seats::{Client, CostClass, NoSeat, Principal, Seats},
    sessions::Session,
};
use crate::{
    connections::ConnectionHandle,
    limits::{MAX_HEADER_BYTES, MAX_HEADERS, SEAT_LIMIT, STRANGER_LIMIT},
    messages::MessageRoom,
    request_body::in_time,
};
use axum::{
    body::{Body, BodyDataStream},
    extract::{MatchedPath, Request, State},
    http::{
        HeaderMap, HeaderValue, Method, Uri,
        header::{AUTHORIZATION, CONTENT_TYPE, HOST},
    },
    middleware::Next,
    response::Response,
};
use murmuration_link::TokenDigest;
use murmuration_store::blocking::holding;
use std::{
    pin::Pin,
    sync::Arc,
    task::{Context, Poll},
    time::Duration,
};
use tokio_stream::Stream;
use tonic::{Status, transport::server::TlsConnectInfo};

/// Bytes that each header counts in addition to its name and value, as in HTTP/2.
const HEADER_OVERHEAD: usize = 32;

/// A listener of a coordinator, and its access rules.
#[derive(Debug)]
pub struct Endpoint {
    /// Credentials that are accepted.
    pub access: Access,
    /// The browsers that have logged in.
    pub sessions: Sessions,
    /// The codes with which the owner's browsers log in.
    pub codes: OneTimeCodes,
    /// The host names that the endpoint answers to.
    pub hosts: Hosts,
    /// Whether the endpoint's connections are encrypted.
    pub is_encrypted: bool,
    /// Where a proxy serves the endpoint's pages, if one does.
    pub public: Option<PublicUrl>,
    pub show_refusal: ShowRefusal,
}

/// The sender of a request that may pass.
#[derive(Debug, Clone, Copy)]
struct Admitted {
    principal: Principal,
    /// The role of the holder of the request's token; `None` without a known token.
    role: Option<Role>,
}

/// Renders a refusal of this request for the client that sent it.
pub(crate) type ShowRefusal = fn(Refusal, &RequestHead) -> Response;

/// The head of a request, from which a refusal is rendered after the handler has taken the request.
#[derive(Debug, Clone)]
pub struct RequestHead {
    pub method: Method,
    pub uri: Uri,
    pub headers: HeaderMap,
}

/// An endpoint, and the requirements of the routes behind it.
#[derive(Debug, Clone)]
pub(super) struct Gate {
    pub(super) endpoint: Arc<Endpoint>,
    pub(super) requirements: Arc<Requirements>,
    pub(super) seats: Seats,
    pub(super) bodies: Bodies,
    pub(super) messages: MessageRoom,
}

/// Refuses requests that may not pass, in the form that the client reads: a gRPC status, a page, or a line of text.
///
/// Handlers behind this check find the [`Endpoint`] in the extensions of the request. Layers in front of this check find the
/// [`Requirement`] in the extensions of the response.
pub(super) async fn admit(State(gate): State<Gate>, mut request: Request, next: Next) -> Response {
    let (requirement, class) = gate.requirements.of(&request);
    request.extensions_mut().insert(gate.endpoint.clone());
    let mut response = gate.answer(requirement, class, request, next).await;
    response.extensions_mut().insert(requirement);
    response
}

impl Gate {
    async fn answer(
        &self,
        requirement: Requirement,
        class: CostClass,
        mut request: Request,
        next: Next,
    ) -> Response {
        let Self {
            endpoint,
            requirements,
            ..
        } = self;
        let asked = Asked::of(&request, requirements);
        let speaks_grpc = asked != Asked::Page && origin::is_grpc(request.headers());
        // Only pages accept a cookie: a browser attaches it even to requests that another site's page makes.
        let session = match (asked, bearer(request.headers())) {
            (Asked::Page, None) => endpoint.sessions.of(request.headers(), endpoint.sessions.now()),
            _ => None,
        };
        let head = RequestHead::of(&request);
        let answered = match endpoint.allows(asked, requirement, session.as_ref(), &request) {
            Ok(Admitted { principal, role }) => {
                if let Some(machine) = ByCertificate::of(request.extensions())
                    && role != Some(Role::Operator)
                {
                    request.extensions_mut().insert(machine);
                }
                request.extensions_mut().insert(Client(principal));
                let class = requirement.class_for(principal, class);
                let is_known = requirement != Requirement::Nothing
                    || matches!(principal, Principal::Token(_) | Principal::Machine(_));
                let handle = request.extensions().get::<ConnectionHandle>();
                if let Some(handle) = handle.filter(|_| is_known) {
                    handle.authenticated();
                }
                let request = match speaks_grpc {
                    true => request.map(|body| self.messages.limited(body, requirement, principal)),
                    false => request,
                };
                let waits = speaks_grpc && class != CostClass::Stranger;
                let patience = (!waits).then_some(SEAT_LIMIT);
                let admitted = Admitted { principal, role };
                self.seated(class, admitted, patience, request, next).await
            }
            Err(refusal) => Err(refusal),
        };
        match answered {
            Ok(response) => while_it_lasts(session, response),
            Err(refusal) => {
                tracing::debug!(path = head.uri.path(), %refusal, "request refused");
                match speaks_grpc {
                    true => Status::from(refusal).into_http(),
                    false => (endpoint.show_refusal)(refusal, &head),
                }
            }
        }
    }

    /// The response of the handler, once there is a seat for the request.
    async fn seated(
        &self,
        class: CostClass,
        Admitted { principal, role }: Admitted,
        patience: Option<Duration>,
        request: Request,
        next: Next,
    ) -> Result<Response, Refusal> {
        let handle = request.extensions().get::<ConnectionHandle>().cloned();
        let Some(seat) = self.seats.take(class, principal, patience).await? else {
            return Ok(next.run(request).await);
        };
        let seat = Arc::new(seat);
        let request = match class {
            // The request of a stream has no time limit, because a stream can be silent for as long as nothing happens.
            CostClass::Streaming => request,
            _ => request.map(|body| in_time(body, &seat)),
        };
        let closed = async {
            match class.ends_at_shutdown() {
                true => self.seats.closed().await,
                false => std::future::pending().await,
            }
        };
        let late = async {
            match class {
                CostClass::Stranger => tokio::time::sleep(STRANGER_LIMIT).await,
                _ => std::future::pending().await,
            }
        };
        let answered = async {
            match role == Some(Role::Annotator) {
                true => self.seats.label_budget(principal).scope(next.run(request)).await,
                // Operators have no label budget.
                false => next.run(request).await,
            }
        };
        tokio::select! {
            response = holding(seat.clone(), seat.priority(), answered) => Ok(self.bodies.seated(seat, handle, response)),
            () = closed => Err(NoSeat::Closing.into()),
            () = late => Err(Refusal::Slow),
        }
    }
}

impl RequestHead {
    fn of(request: &Request) -> Self {
        Self {
            method: request.method().clone(),
            uri: request.uri().clone(),
            headers: request.headers().clone(),
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

impl Endpoint {
    fn allows(
        &self,
        asked: Asked,
        requirement: Requirement,
        session: Option<&Session>,
        request: &Request,
    ) -> Result<Admitted, Refusal> {
        let handle = request.extensions().get::<ConnectionHandle>();
        if handle.is_some_and(|handle| !handle.may_ask()) {
            return Err(Refusal::Rate);
        }
        if !has_room_for_headers(request) {
            return Err(Refusal::Headers);
        }
        origin::check(
            self.hosts,
            self.is_encrypted,
            self.public.as_ref(),
            asked,
            request,
        )?;
        let connection = request.extensions().get::<TlsConnectInfo<ConnectionHandle>>();
        let chain = connection.and_then(TlsConnectInfo::peer_certs);
        let presented = PresentedCredentials {
            token: bearer(request.headers())
                .map(TokenDigest::of)
                .or(session.map(|session| session.token)),
            certificate: chain.and_then(|chain| chain.first().map(Certificate::read)),
        };
        self.access.admits(requirement, &presented)?;
        let holder = presented.token.and_then(|token| self.access.whose(token));
        Ok(Admitted {
            principal: self.principal(&presented, request),
            role: holder.map(|(_, role)| role),
        })
    }

    /// The principal of a request. Unknown tokens do not count as principals, because anybody can invent tokens. Nor does the
    /// owner's token, which all machines of a cluster may have: its bearers count by their addresses.
    fn principal(&self, presented: &PresentedCredentials, request: &Request) -> Principal {
        let known = presented
            .token
            .filter(|&token| self.access.whose(token).is_some() && self.access.owner != Some(token));
        match (known, machine::origin(request.extensions())) {
            (Some(token), _) => Principal::Token(token),
            (None, Some(origin)) if presented.certificate.is_some() => Principal::Machine(origin.machine),
            (None, Some(origin)) => Principal::at(origin.address),
            (None, None) => Principal::Unknown,
        }
    }

    /// The token of the session of a browser.
    pub fn logged_in(&self, headers: &HeaderMap) -> Option<TokenDigest> {
        let session = self.sessions.of(headers, self.sessions.now());
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

/// A body that ends when it is complete or when the future `end` is ready.
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
        let message = refusal.to_string();
        match refusal {
            Refusal::NoToken | Refusal::UnknownToken => Self::unauthenticated(message),
            // Other tokens do not help, and a process waits for no other access file.
            Refusal::NoCertificate
            | Refusal::Role { .. }
            | Refusal::WrongCertificate(_)
            | Refusal::Host
            | Refusal::Origin => Self::permission_denied(message),
            Refusal::Rate | Refusal::Headers | Refusal::NoSeat(NoSeat::Busy(_)) => {
                Self::resource_exhausted(message)
            }
            Refusal::NoSeat(NoSeat::Closing) => Self::unavailable(message),
            Refusal::Slow => Self::deadline_exceeded(message),
            Refusal::ContentType => Self::invalid_argument(message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::GuardedRouter;
    use axum::{Router, http::StatusCode, response::IntoResponse as _};
    use murmuration_link::Token;
    use murmuration_store::blocking::blocking;
    use std::{future::pending, sync::mpsc};
    use tonic::codegen::Service as _;

    /// `routes` behind an endpoint that everybody may pass, and its seats.
    fn behind_an_endpoint(routes: GuardedRouter) -> (Router, Seats) {
        let folder = tempfile::tempdir().unwrap();
        let own = Token::generate().unwrap();
        let endpoint = Endpoint {
            access: Access::default(),
            codes: OneTimeCodes::new(&own),
            sessions: Sessions::kept(folder.path(), &own, |_| true).unwrap(),
            hosts: Hosts::Any,
            is_encrypted: false,
            public: None,
            show_refusal: |refusal, _| (StatusCode::IM_A_TEAPOT, refusal.to_string()).into_response(),
        };
        let seats = Seats::new(&[]);
        let router = routes.behind(Arc::new(endpoint), seats.clone(), async || StatusCode::NOT_FOUND);
        (router, seats)
    }

    fn request() -> Request {
        Request::get("/")
            .header(HOST, "localhost")
            .body(Body::empty())
            .unwrap()
    }

    fn answered(seats: &Seats, class: CostClass) -> usize {
        seats.counts().find(|(of, _)| *of == class).unwrap().1.answered
    }

    #[tokio::test(start_paused = true)]
    async fn a_stranger_who_takes_too_long_is_refused() {
        let routes = GuardedRouter::default().get("/", Requirement::Nothing, CostClass::Light, async || {
            pending::<()>().await;
        });
        let (mut router, seats) = behind_an_endpoint(routes);
        let refused = router.call(request()).await.unwrap();
        assert_eq!(refused.status(), StatusCode::IM_A_TEAPOT);
        assert_eq!(answered(&seats, CostClass::Stranger), 0);
    }

    #[tokio::test]
    async fn a_request_that_is_gone_keeps_its_seat_until_its_work_has_ended() {
        let (go, gone) = mpsc::channel::<()>();
        let gone = Arc::new(std::sync::Mutex::new(gone));
        let (began, mut begun) = tokio::sync::mpsc::unbounded_channel();
        let routes =
            GuardedRouter::default().get("/", Requirement::VIEWER, CostClass::Light, async move || {
                let done = blocking(move || {
                    began.send(()).unwrap();
                    gone.lock().unwrap().recv()
                });
                let _ = done.await;
            });
        let (mut router, seats) = behind_an_endpoint(routes);
        let asked = tokio::spawn(router.call(request()));
        begun.recv().await.unwrap();
        asked.abort();
        assert!(asked.await.is_err_and(|error| error.is_cancelled()));
        assert_eq!(answered(&seats, CostClass::Light), 1);
        go.send(()).unwrap();
        while answered(&seats, CostClass::Light) > 0 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }
}
