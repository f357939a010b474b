//! Routes that can only be registered with a requirement and a cost class, and only be served behind an endpoint.

use super::{
    CostClass, Endpoint, Requirement, Requirements, Seats,
    admit::{Gate, admit},
    limits::MAX_POST,
    messages::MessageRoom,
    requirement::MethodRequirements,
    response_body::Bodies,
};
use axum::{
    Router,
    extract::{DefaultBodyLimit, Request},
    handler::Handler,
    http::Method,
    middleware::{self, Next},
    response::{IntoResponse, Response},
    routing,
};
use std::{convert::Infallible, sync::Arc};
use tonic::{body::Body, codegen::Service, server::NamedService, service::Routes};

/// Pages and gRPC services, each with its [`Requirement`] and [`CostClass`]. [`GuardedRouter::behind`] is the only way to serve
/// them.
#[derive(Debug, Clone)]
pub struct GuardedRouter<S = ()> {
    router: Router<S>,
    requirements: Requirements,
}

impl<S: Clone + Send + Sync + 'static> Default for GuardedRouter<S> {
    fn default() -> Self {
        Self {
            router: Router::new(),
            requirements: Requirements::default(),
        }
    }
}

impl<S: Clone + Send + Sync + 'static> GuardedRouter<S> {
    /// Registers a handler for GET, and so for HEAD, on a route.
    #[must_use]
    pub fn get<H: Handler<T, S>, T: 'static>(
        mut self,
        route: &'static str,
        requirement: Requirement,
        class: CostClass,
        handler: H,
    ) -> Self {
        self.requirements
            .add_page(Method::GET, route, (requirement, class));
        self.router = self.router.route(route, routing::get(handler));
        self
    }

    /// Registers a handler for POST on a route, with a body of at most [`MAX_POST`] bytes.
    #[must_use]
    pub fn post<H: Handler<T, S>, T: 'static>(
        mut self,
        route: &'static str,
        requirement: Requirement,
        class: CostClass,
        handler: H,
    ) -> Self {
        self.requirements
            .add_page(Method::POST, route, (requirement, class));
        let handler = routing::post(handler).layer(DefaultBodyLimit::max(MAX_POST));
        self.router = self.router.route(route, handler);
        self
    }

    /// Passes every request for the routes registered so far, and its response, through `middleware`.
    #[must_use]
    pub fn wrapped<F, R>(mut self, middleware: F) -> Self
    where
        F: Fn(Request, Next) -> R + Clone + Send + Sync + 'static,
        R: Future<Output = Response> + Send + 'static,
    {
        self.router = self.router.layer(middleware::from_fn(middleware));
        self
    }

    /// Gives the handlers their state.
    #[must_use]
    pub fn with_state(self, state: S) -> GuardedRouter {
        GuardedRouter {
            router: self.router.with_state(state),
            requirements: self.requirements,
        }
    }
}

impl GuardedRouter {
    /// Registers a gRPC service. A method that `methods` does not name is for operators alone.
    #[must_use]
    pub fn service<G>(mut self, service: G, methods: MethodRequirements) -> Self
    where
        G: Service<axum::http::Request<Body>, Error = Infallible>
            + NamedService
            + Clone
            + Send
            + Sync
            + 'static,
        G::Response: IntoResponse,
        G::Future: Send + 'static,
    {
        self.requirements.add_service(G::NAME, methods);
        self.router = Routes::from(self.router).add_service(service).into_axum_router();
        self
    }

    /// Adds the routes of another router.
    #[must_use]
    pub fn merge(mut self, other: Self) -> Self {
        self.requirements.append(other.requirements);
        self.router = self.router.merge(other.router);
        self
    }

    /// Requirements of all registered routes.
    #[must_use]
    pub const fn requirements(&self) -> &Requirements {
        &self.requirements
    }

    /// Puts all routes behind an endpoint. `admit` gets a request before anything else reads it. `admit` passes the request on
    /// only if there is a seat for it, and it shows the credentials that its route requires. `nowhere` answers requests for an
    /// address without a route.
    pub fn behind<H: Handler<T, ()>, T: 'static>(
        self,
        endpoint: Arc<Endpoint>,
        seats: Seats,
        nowhere: H,
    ) -> Router {
        let gate = Gate {
            endpoint,
            requirements: Arc::new(self.requirements),
            messages: MessageRoom::default(),
            bodies: Bodies::of(&seats),
            seats,
        };
        self.router
            .fallback(nowhere)
            .layer(middleware::from_fn_with_state(gate, admit))
    }
}
