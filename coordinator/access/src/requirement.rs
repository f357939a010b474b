//! What a request must show, and the table of what every page and gRPC method requires.
//!
//! [`GuardedRouter`](crate::GuardedRouter) fills the table as routes are registered. A method or page that the table does
//! not know is for operators alone.

use super::MachineKind;
use axum::{
    extract::{MatchedPath, Request},
    http::Method,
};
use serde::{Deserialize, Serialize};
use std::fmt;

/// What somebody may do. Each role may do what those before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Read campaigns, archives, labels and reports
    Viewer,
    /// Also label behaviours and change classes
    Annotator,
    /// Also submit, pause, cancel and refine campaigns, and publish checkpoints
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

/// What a request must show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requirement {
    Nothing,
    /// The token of somebody with this role.
    Person(Role),
    /// The certificate of such a machine; an operator's token where machines have none.
    Machine(MachineKind),
    /// The certificate of such a machine, or the token of somebody with this role.
    MachineOr(MachineKind, Role),
    /// A machine's certificate, or the token of somebody with this role.
    AnyMachineOr(Role),
}

impl Requirement {
    /// The token of a viewer, or of somebody who may do more.
    pub const VIEWER: Self = Self::Person(Role::Viewer);
    /// The token of an annotator or operator.
    pub const ANNOTATOR: Self = Self::Person(Role::Annotator);
    pub const OPERATOR: Self = Self::Person(Role::Operator);
}

/// The methods of a gRPC service, by name, each with its requirement.
pub type MethodRequirements = &'static [(&'static str, Requirement)];

/// What every page and gRPC method that is served requires.
#[derive(Debug, Clone, Default)]
pub struct Requirements {
    pages: Vec<(Method, &'static str, Requirement)>,
    services: Vec<(&'static str, MethodRequirements)>,
}

impl Requirements {
    /// Every page, and what programs ask for over HTTP: the HTTP method, the route (`/campaigns/{id}`), the requirement.
    pub fn pages(&self) -> impl Iterator<Item = (&Method, &'static str, Requirement)> {
        self.pages
            .iter()
            .map(|(method, route, requirement)| (method, *route, *requirement))
    }

    /// Every gRPC method, as `/SERVICE/METHOD`, and its requirement.
    pub fn methods(&self) -> impl Iterator<Item = (String, Requirement)> {
        self.services.iter().flat_map(|(service, methods)| {
            methods
                .iter()
                .map(move |(method, requirement)| (format!("/{service}/{method}"), *requirement))
        })
    }

    pub(crate) fn add_page(&mut self, method: Method, route: &'static str, requirement: Requirement) {
        self.pages.push((method, route, requirement));
    }

    pub(crate) fn add_service(&mut self, name: &'static str, methods: MethodRequirements) {
        self.services.push((name, methods));
    }

    pub(crate) fn append(&mut self, mut other: Self) {
        self.pages.append(&mut other.pages);
        self.services.append(&mut other.services);
    }

    /// What this request must show, once it has been routed.
    pub(crate) fn of(&self, request: &Request) -> Requirement {
        self.of_method(request.uri().path()).unwrap_or_else(|| {
            let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
            self.of_page(request.method(), route)
        })
    }

    /// The requirement of the gRPC method of this path (`/SERVICE/METHOD`); `None` where the service is not served.
    pub(crate) fn of_method(&self, path: &str) -> Option<Requirement> {
        let (service, method) = path.strip_prefix('/')?.split_once('/')?;
        let (_, methods) = self.services.iter().find(|(known, _)| *known == service)?;
        let known = methods.iter().find(|(known, _)| *known == method);
        Some(known.map_or(Requirement::OPERATOR, |(_, requirement)| *requirement))
    }

    /// The requirement of a page, by its route; without a route, that of an address that leads nowhere.
    fn of_page(&self, method: &Method, route: Option<&str>) -> Requirement {
        let Some(route) = route else {
            return Requirement::VIEWER;
        };
        // Whatever answers GET answers HEAD.
        let method = if *method == Method::HEAD {
            &Method::GET
        } else {
            method
        };
        let known = self
            .pages()
            .find(|(registered, path, _)| *registered == method && *path == route);
        known.map_or(Requirement::OPERATOR, |(_, _, requirement)| requirement)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_table_does_not_know_is_for_operators() {
        let mut table = Requirements::default();
        table.add_page(Method::GET, "/events", Requirement::VIEWER);
        table.add_page(Method::POST, "/login", Requirement::Nothing);
        table.add_service("swarm.v1.Swarm", &[("Look", Requirement::VIEWER)]);

        assert_eq!(table.of_method("/swarm.v1.Swarm/Look"), Some(Requirement::VIEWER));
        assert_eq!(
            table.of_method("/swarm.v1.Swarm/Explode"),
            Some(Requirement::OPERATOR)
        );
        assert_eq!(table.of_method("/campaigns/small-1"), None);
        for (method, route, expected) in [
            (Method::GET, "/events", Requirement::VIEWER),
            (Method::HEAD, "/events", Requirement::VIEWER),
            (Method::POST, "/events", Requirement::OPERATOR),
            (Method::DELETE, "/events", Requirement::OPERATOR),
            (Method::POST, "/login", Requirement::Nothing),
            (Method::GET, "/login", Requirement::OPERATOR),
            (Method::GET, "/secret", Requirement::OPERATOR),
        ] {
            assert_eq!(table.of_page(&method, Some(route)), expected, "{method} {route}");
        }
        assert_eq!(table.of_page(&Method::GET, None), Requirement::VIEWER);
    }
}
