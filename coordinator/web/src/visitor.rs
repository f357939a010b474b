//! The person who looks at a page, if they have logged in.

use axum::{extract::FromRequestParts, http::request::Parts};
use maud::{Markup, html};
use murmuration_access::Endpoint;
use std::{convert::Infallible, sync::Arc};

/// The person who looks at a page.
#[derive(Debug)]
pub(super) struct Visitor {
    /// The holder of the token that they logged in with.
    name: Option<String>,
}

impl Visitor {
    /// A visitor without a session.
    pub(super) const ANYBODY: Self = Self { name: None };

    /// Their name and the log-out button; nothing without a session.
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
