//! The table of routes: the requirement and the cost class of every page and gRPC method.
//!
//! [`GuardedRouter`](crate::GuardedRouter) fills the table as routes are registered. A method or page that is not in the table is
//! for operators alone.

use super::{CostClass, MachineKind, seats::Principal};
use axum::{
    extract::{MatchedPath, Request},
    http::Method,
};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Permissions of a token or certificate. Each role includes the roles before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Read campaigns, archives, labels and reports
    Viewer,
    /// Also label behaviours and change classes
    Annotator,
    /// Also submit, pause, cancel, extend and refine campaigns, and publish checkpoints
    Operator,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Viewer => "viewer",
            Self::Annotator => "annotator",
            Self::Operator => "operator",
        })
    }
}

/// Credentials that a request must show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requirement {
    Nothing,
    /// A token with this role.
    Person(Role),
    /// The certificate of a machine of this kind, or an operator's token where machines have no certificates.
    Machine(MachineKind),
    /// The certificate of a machine of this kind, or a token with this role.
    MachineOr(MachineKind, Role),
    /// A machine's certificate, or a token with this role.
    AnyMachineOr(Role),
}

impl Requirement {
    /// A viewer's token, or a token with a higher role.
    pub const VIEWER: Self = Self::Person(Role::Viewer);
    /// An annotator's or operator's token.
    pub const ANNOTATOR: Self = Self::Person(Role::Annotator);
    pub const OPERATOR: Self = Self::Person(Role::Operator);

    /// The class of a request by `principal` to a route with this requirement and the cost class `class`. Requests without
    /// credentials to an open route get a class of their own, so that they take no seats from other requests.
    pub(crate) fn class_for(self, principal: Principal, class: CostClass) -> CostClass {
        match (self, principal, class) {
            (_, _, CostClass::Free) => class,
            (Self::Nothing, Principal::Address(_) | Principal::Unknown, _) => CostClass::Stranger,
            // The work of machines must not wait for people who read slowly.
            (_, Principal::Machine(_), CostClass::Reading) => CostClass::Streaming,
            _ => class,
        }
    }
}

/// The methods of a gRPC service, by name, each with its requirement and cost.
pub type MethodRequirements = &'static [(&'static str, Requirement, CostClass)];

/// The requirement and the cost class of every page and gRPC method that is served.
#[derive(Debug, Clone, Default)]
pub struct Requirements {
    pages: Vec<(Method, &'static str, (Requirement, CostClass))>,
    services: Vec<(&'static str, MethodRequirements)>,
}

impl Requirements {
    /// Every page and HTTP endpoint for programs: the HTTP method, the route (`/campaigns/{id}`), the requirement.
    pub fn pages(&self) -> impl Iterator<Item = (&Method, &'static str, Requirement)> {
        self.pages
            .iter()
            .map(|(method, route, (requirement, _))| (method, *route, *requirement))
    }

    /// Every gRPC method, as `/SERVICE/METHOD`, and its requirement.
    pub fn methods(&self) -> impl Iterator<Item = (String, Requirement)> {
        self.services.iter().flat_map(|(service, methods)| {
            methods
                .iter()
                .map(move |(method, requirement, _)| (format!("/{service}/{method}"), *requirement))
        })
    }

    pub(crate) fn add_page(&mut self, method: Method, route: &'static str, rule: (Requirement, CostClass)) {
        self.pages.push((method, route, rule));
    }

    pub(crate) fn add_service(&mut self, name: &'static str, methods: MethodRequirements) {
        self.services.push((name, methods));
    }

    pub(crate) fn append(&mut self, mut other: Self) {
        self.pages.append(&mut other.pages);
        self.services.append(&mut other.services);
    }

    /// The requirement and the cost class of a request, once it has been routed.
    pub(crate) fn of(&self, request: &Request) -> (Requirement, CostClass) {
        self.of_method(request.uri().path()).unwrap_or_else(|| {
            let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
            self.of_page(request.method(), route)
        })
    }

    /// The requirement and the cost class of the gRPC method of this path (`/SERVICE/METHOD`); `None` if the service is not
    /// served.
    pub(crate) fn of_method(&self, path: &str) -> Option<(Requirement, CostClass)> {
        let (service, method) = path.strip_prefix('/')?.split_once('/')?;
        let (_, methods) = self.services.iter().find(|(known, _)| *known == service)?;
        let known = methods.iter().find(|(known, ..)| *known == method);
        Some(known.map_or(UNKNOWN, |(_, requirement, class)| (*requirement, *class)))
    }

    /// The requirement and the cost class of a page, by its route. An address without a page requires a viewer's token.
    fn of_page(&self, method: &Method, route: Option<&str>) -> (Requirement, CostClass) {
        let Some(route) = route else {
            return (Requirement::VIEWER, CostClass::Light);
        };
        // A route that answers GET also answers HEAD.
        let method = if *method == Method::HEAD {
            &Method::GET
        } else {
            method
        };
        let mut pages = self.pages.iter();
        let known = pages.find(|(registered, path, _)| registered == method && *path == route);
        known.map_or(UNKNOWN, |(_, _, rule)| *rule)
    }
}

/// The rule for a route that the table does not have.
const UNKNOWN: (Requirement, CostClass) = (Requirement::OPERATOR, CostClass::Light);

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_link::TokenDigest;

    #[test]
    fn what_the_table_does_not_know_is_for_operators() {
        let mut table = Requirements::default();
        table.add_page(
            Method::GET,
            "/events",
            (Requirement::VIEWER, CostClass::Streaming),
        );
        table.add_page(
            Method::POST,
            "/login",
            (Requirement::Nothing, CostClass::Decision),
        );
        table.add_service(
            "swarm.v1.Swarm",
            &[("Look", Requirement::VIEWER, CostClass::Reading)],
        );

        assert_eq!(
            table.of_method("/swarm.v1.Swarm/Look"),
            Some((Requirement::VIEWER, CostClass::Reading))
        );
        assert_eq!(table.of_method("/swarm.v1.Swarm/Explode"), Some(UNKNOWN));
        assert_eq!(table.of_method("/campaigns/small-1"), None);
        let events = (Requirement::VIEWER, CostClass::Streaming);
        for (method, route, expected) in [
            (Method::GET, "/events", events),
            (Method::HEAD, "/events", events),
            (Method::POST, "/events", UNKNOWN),
            (Method::DELETE, "/events", UNKNOWN),
            (
                Method::POST,
                "/login",
                (Requirement::Nothing, CostClass::Decision),
            ),
            (Method::GET, "/login", UNKNOWN),
            (Method::GET, "/secret", UNKNOWN),
        ] {
            assert_eq!(table.of_page(&method, Some(route)), expected, "{method} {route}");
        }
        let nowhere = (Requirement::VIEWER, CostClass::Light);
        assert_eq!(table.of_page(&Method::GET, None), nowhere);
    }

    #[test]
    fn strangers_take_no_seats_of_those_who_show_something() {
        let stranger = Principal::at([192, 0, 2, 1].into());
        let known = Principal::Token(TokenDigest::of("known"));
        let (nothing, light) = (Requirement::Nothing, CostClass::Light);
        assert_eq!(nothing.class_for(stranger, light), CostClass::Stranger);
        assert_eq!(
            nothing.class_for(stranger, CostClass::Streaming),
            CostClass::Stranger
        );
        assert_eq!(nothing.class_for(stranger, CostClass::Free), CostClass::Free);
        assert_eq!(nothing.class_for(known, light), light);
        // Where everybody is admitted, no request is a stranger's.
        assert_eq!(Requirement::VIEWER.class_for(stranger, light), light);
    }
}
