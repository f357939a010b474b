//! The visitor of a page, logged in or not.

use axum::{extract::FromRequestParts, http::request::Parts};
use maud::{Markup, html};
use murmuration_access::Endpoint;
use std::{convert::Infallible, sync::Arc};

/// The visitor of a page.
#[derive(Debug)]
pub(super) struct Visitor {
    /// The name of the token with which the visitor logged in.
    name: Option<String>,
}

impl Visitor {
    /// A visitor without a session.
    pub(super) const ANYBODY: Self = Self { name: None };

    /// The visitor's name and the log-out button; empty without a session.
    pub(super) fn account(&self) -> Markup {
        html! {
            @if let Some(name) = &self.name {
                form.account method="post" action="/logout" {
                    span { (name) }
                    button.plain { "Log out" }
                }
            }
        }
    }
}

impl<S: Sync> FromRequestParts<S> for Visitor {
    type Rejection = Infallible;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, Infallible> {
        let endpoint = parts.extensions.get::<Arc<Endpoint>>();
        let whose = endpoint.and_then(|endpoint| endpoint.access.whose(endpoint.logged_in(&parts.headers)?));
        Ok(Self {
            name: whose.map(|(name, _)| name.to_string()),
        })
    }
}
