//! Logging in and out: a person enters a token once, and the browser keeps a session cookie that no script can read.

use super::{
    asked::{Form, Query},
    layout::layout,
    page_error::{self, PageError, status_of},
    visitor::Visitor,
};
use axum::{
    Extension,
    http::{
        HeaderMap, Method, StatusCode, Uri,
        header::{CACHE_CONTROL, SET_COOKIE},
    },
    response::{IntoResponse, Redirect, Response},
};
use maud::{DOCTYPE, Markup, html};
use murmuration_access::{Endpoint, Refusal, RequestHead};
use murmuration_engine::blocking::blocking;
use murmuration_link::TokenDigest;
use serde::{Deserialize, Serialize};
use std::{sync::Arc, time::SystemTime};

/// The log-in form as a person filled it in.
#[derive(Deserialize)]
pub(super) struct Given {
    token: String,
    #[serde(default)]
    to: Destination,
}

/// The query of a link that logs in.
#[derive(Deserialize)]
pub(super) struct Opening {
    #[serde(default)]
    code: String,
    #[serde(default)]
    to: Destination,
}

/// The page to show after the log-in.
#[derive(Deserialize, Serialize)]
pub(super) struct Going {
    #[serde(default)]
    to: Destination,
}

/// The path and the query of a page of this coordinator.
#[derive(Debug, Clone, PartialEq, Eq, Deserialize, Serialize)]
#[serde(from = "String")]
struct Destination(String);

impl Default for Destination {
    fn default() -> Self {
        Self("/".to_owned())
    }
}

impl From<String> for Destination {
    /// Takes the path and query of a page of this host. Any other address becomes the front page.
    fn from(address: String) -> Self {
        let (path, query) = address.split_once('?').unwrap_or((&address, ""));
        let plain = |c: char| c.is_ascii_alphanumeric() || "/-_.".contains(c);
        let asked = |c: char| plain(c) || "=&%+*~".contains(c);
        match path.starts_with('/')
            && !path.starts_with("//")
            && path.chars().all(plain)
            && query.chars().all(asked)
        {
            true => Self(address),
            false => Self::default(),
        }
    }
}

/// The page that shows who is logged in, or the log-in form.
pub(super) async fn page(
    Extension(endpoint): Extension<Arc<Endpoint>>,
    Query(Going { to }): Query<Going>,
    headers: HeaderMap,
) -> impl IntoResponse {
    let token = endpoint.logged_in(&headers);
    let whose = token.and_then(|token| endpoint.access.whose(token));
    let content = match whose {
        Some((name, role)) => html! {
            h1 { "Logged in" }
            p.lead { "You are logged in as " strong { (name.to_string()) } " with the role " strong { (role) } "." }
            form method="post" action="/logout" { button { "Log out" } }
            p { a href="/" { "All campaigns" } }
        },
        None if endpoint.access.tokens.is_none() => html! {
            h1 { "No log-in needed" }
            p.lead { "This coordinator requires no token." }
            p { a href="/" { "All campaigns" } }
        },
        None => form(&to, ""),
    };
    (
        [(CACHE_CONTROL, "no-store")],
        layout("Log in", &Visitor::ANYBODY, content),
    )
}

/// Opens a session for a token that the coordinator knows.
pub(super) async fn log_in(
    Extension(endpoint): Extension<Arc<Endpoint>>,
    headers: HeaderMap,
    Form(given): Form<Given>,
) -> Response {
    let token = TokenDigest::of(given.token.trim());
    if endpoint.access.whose(token).is_none() {
        let page = layout(
            "Log in",
            &Visitor::ANYBODY,
            form(&given.to, "The coordinator does not know this token."),
        );
        return (StatusCode::UNAUTHORIZED, page).into_response();
    }
    let to = Redirect::to(&given.to.0).into_response();
    with_session(endpoint, headers, token, to).await
}

/// Opens a session for the code of a link that the owner's command printed.
///
/// The answer is a page that leads to the pages: a browser that follows a link of another site, such as a notebook's, sends the new
/// cookie only with requests that begin on a page of this coordinator.
pub(super) async fn open(
    method: Method,
    Extension(endpoint): Extension<Arc<Endpoint>>,
    Query(Opening { code, to }): Query<Opening>,
    headers: HeaderMap,
) -> Response {
    if endpoint.access.tokens.is_none() {
        return Redirect::to(&to.0).into_response();
    }
    if method == Method::HEAD {
        // Programs that preview links must not use them up.
        return StatusCode::OK.into_response();
    }
    match endpoint.codes.redeem(&code, SystemTime::now()) {
        Some(owner) => with_session(endpoint, headers, owner, onward(&to)).await,
        // A browser that loads the page again is logged in already.
        None if endpoint.logged_in(&headers).is_some() => onward(&to),
        None => {
            let content = html! {
                h1 { "This link does not work" }
                p.lead { "A link works once, for 15 minutes after it was printed, and until the coordinator restarts. " code { "murmuration link" }
                    " prints a new link; type it in the folder where the coordinator was started." }
                p { a href="/login" { "Log in with a token" } }
            };
            let page = layout("Log in", &Visitor::ANYBODY, content);
            (StatusCode::UNAUTHORIZED, [(CACHE_CONTROL, "no-store")], page).into_response()
        }
    }
}

/// A page that leads to another one.
fn onward(to: &Destination) -> Response {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                // Relative to this page, since a proxy's path is added to links alone.
                meta http-equiv="refresh" content={ "0;url=." (to.0) };
                title { "Murmuration" }
            }
            body { p { a href=(to.0) { "Go on" } } }
        }
    };
    ([(CACHE_CONTROL, "no-store")], page).into_response()
}

/// Opens a session for the bearer of a token. The answer also has the session's cookie.
async fn with_session(
    endpoint: Arc<Endpoint>,
    headers: HeaderMap,
    token: TokenDigest,
    answer: Response,
) -> Response {
    let (sessions, is_encrypted) = (endpoint.sessions.clone(), endpoint.is_encrypted);
    let opened = blocking(move || {
        let jar = sessions.log_in(&headers, token, is_encrypted, sessions.now());
        Ok::<_, PageError>(hidden((jar?, answer).into_response()))
    });
    match opened.await {
        Ok(Ok(answer)) => answer,
        Ok(Err(error)) => error.into_response(),
        Err(broken) => PageError::from(broken).into_response(),
    }
}

/// Ends the session, and makes the browser delete the session's cookie and the pages in its cache.
pub(super) async fn log_out(Extension(endpoint): Extension<Arc<Endpoint>>, headers: HeaderMap) -> Response {
    let sessions = endpoint.sessions.clone();
    let forgotten = sessions.forget(&headers);
    let ended = blocking(move || sessions.log_out(&headers)).await;
    let answer = match ended {
        Ok(Ok(())) => (forgotten, Redirect::to("/")).into_response(),
        // After an error, the browser keeps its cookie, so that it can send the request again.
        Ok(Err(error)) => PageError::from(error).into_response(),
        Err(broken) => PageError::from(broken).into_response(),
    };
    hidden(([("clear-site-data", "\"cache\"")], answer).into_response())
}

/// Marks the cookies of a response as sensitive, so that no log shows them.
fn hidden(mut answer: Response) -> Response {
    let headers = answer.headers_mut().iter_mut();
    headers
        .filter(|(name, _)| *name == SET_COOKIE)
        .for_each(|(_, cookie)| cookie.set_sensitive(true));
    answer
}

fn form(to: &Destination, error: &str) -> Markup {
    html! {
        h1 { "Log in" }
        p.lead { "Enter the token that the operator of this coordinator gave you. Is the coordinator yours? Then "
            code { "murmuration link" } ", typed in the folder where you started it, prints a link that logs you in." }
        form.who method="post" action="/login" {
            input type="hidden" name="to" value=(to.0);
            label { "Token "
                input name="token" type="password" required autofocus autocomplete="current-password";
            }
            button { "Log in" }
        }
        @if !error.is_empty() { p role="alert" { (error) } }
    }
}

/// The response to a refused request: an error page or the log-in page for people, and a line of text for scripts.
pub(super) fn show_refusal(refusal: Refusal, request: &RequestHead) -> Response {
    match (page_error::wants_page(&request.headers), status_of(&refusal)) {
        (true, StatusCode::UNAUTHORIZED) => {
            let to = page_of(&request.method, &request.uri);
            match serde_urlencoded::to_string(Going { to }) {
                Ok(query) => Redirect::to(&format!("/login?{query}")).into_response(),
                Err(_) => Redirect::to("/login").into_response(),
            }
        }
        _ => PageError::Refused(refusal).told(&request.headers),
    }
}

/// The page that follows the log-in: the requested page or, if a button sent the request, the page of its campaign.
fn page_of(method: &Method, uri: &Uri) -> Destination {
    if method.is_safe() {
        let address = uri.path_and_query();
        return address.map_or_else(Destination::default, |address| address.to_string().into());
    }
    let of_campaign = uri.path().strip_prefix("/campaigns/");
    let campaign = of_campaign.and_then(|rest| rest.split('/').next());
    campaign.map_or_else(Destination::default, |id| format!("/campaigns/{id}").into())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_in_leads_to_the_page_that_was_wanted() {
        for (method, uri, page) in [
            (Method::GET, "/campaigns/a-1/map?x=1", "/campaigns/a-1/map?x=1"),
            (Method::POST, "/campaigns/a-1/pause", "/campaigns/a-1"),
            (Method::POST, "/campaigns//evil.example", "/campaigns/"),
            (Method::POST, "/new", "/"),
            (Method::POST, "/logout", "/"),
        ] {
            let led = page_of(&method, &uri.parse().unwrap());
            assert_eq!(led.0, page, "{method} {uri}");
        }
    }

    #[test]
    fn a_log_in_leads_to_pages_of_ours_alone() {
        let leads = |path: &str| Destination::from(path.to_owned()).0;
        for path in [
            "/",
            "/campaigns/two-sensor-1/label",
            "/?state=running&name=a+b",
            "/campaigns/two-sensor-1/map?class=%F0%9F%90%9D&to=//elsewhere",
        ] {
            assert_eq!(leads(path), path);
        }
        for path in [
            "",
            "//evil.example",
            "https://evil.example",
            "/\\evil.example",
            "/a?b\nc",
            "//evil.example?a",
            "campaigns",
        ] {
            assert_eq!(leads(path), "/", "{path}");
        }
    }
}
