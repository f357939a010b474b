//! Pages behind a proxy, which serves them under a path of its own.
//!
//! The pages have links from the root. Requests lose the proxy's path before they reach a page, and links, redirects and cookies get
//! it on their way out.

use axum::{
    Router,
    body::{Body, Bytes},
    extract::Request,
    http::{
        HeaderValue, Uri,
        header::{CONTENT_LENGTH, CONTENT_TYPE, LOCATION, SET_COOKIE},
    },
    response::Response,
};
use murmuration_access::PublicUrl;
use tokio_stream::StreamExt as _;
use tonic::codegen::Service as _;

/// The routes of `pages`, at the root and under the path of `public`.
pub(super) fn under(pages: Router, public: PublicUrl) -> Router {
    let ask = async move |request: Request| {
        let mut pages = pages.clone();
        match pages.call(without_path(request, &public)).await {
            Ok(response) => with_path(response, &public),
            Err(never) => match never {},
        }
    };
    Router::new().fallback(ask)
}

/// The request for a page without the path of the proxy, if it has it.
fn without_path(mut request: Request, public: &PublicUrl) -> Request {
    let uri = request.uri();
    let inner = public.within(uri.path()).map(|path| match uri.query() {
        Some(query) => format!("{path}?{query}"),
        None => path.to_owned(),
    });
    let mut parts = uri.clone().into_parts();
    if let Some(inner) = inner.and_then(|inner| inner.parse().ok()) {
        parts.path_and_query = Some(inner);
        if let Ok(uri) = Uri::from_parts(parts) {
            *request.uri_mut() = uri;
        }
    }
    request
}

/// The response whose links lead through the proxy.
fn with_path(mut response: Response, public: &PublicUrl) -> Response {
    let path = public.path();
    let headers = response.headers_mut();
    let redirected = headers
        .get(LOCATION)
        .and_then(|to| to.to_str().ok())
        .filter(|to| {
            // A page that a script named has the path already.
            to.starts_with('/') && public.within(to).is_none()
        });
    if let Some(to) = redirected.and_then(|to| HeaderValue::from_str(&format!("{path}{to}")).ok()) {
        headers.insert(LOCATION, to);
    }
    let cookies: Vec<HeaderValue> = headers.get_all(SET_COOKIE).iter().cloned().collect();
    headers.remove(SET_COOKIE);
    for cookie in cookies {
        headers.append(SET_COOKIE, of_path(cookie, public));
    }
    let kind = headers
        .get(CONTENT_TYPE)
        .and_then(|kind| kind.to_str().ok())
        .unwrap_or_default();
    if !["text/html", "text/event-stream"]
        .iter()
        .any(|text| kind.starts_with(text))
    {
        return response;
    }
    headers.remove(CONTENT_LENGTH);
    let path = path.to_owned();
    response.map(|body| {
        let parts = body.into_data_stream();
        Body::from_stream(parts.map(move |part| part.map(|part| with_links(&part, &path))))
    })
}

/// A cookie for the pages alone, not for everything else that the proxy serves.
fn of_path(cookie: HeaderValue, public: &PublicUrl) -> HeaderValue {
    let Ok(text) = cookie.to_str() else { return cookie };
    let mut text = text.replace("; Path=/", &format!("; Path={}/", public.path()));
    if public.is_encrypted() && !text.contains("; Secure") {
        text += "; Secure";
    }
    HeaderValue::from_str(&text).unwrap_or(cookie)
}

/// Markup whose links from the root begin with `path`. In text, quotes are escaped, so only attributes match.
fn with_links(part: &Bytes, path: &str) -> Bytes {
    let Ok(text) = str::from_utf8(part) else {
        return part.clone();
    };
    let linked = text.replace("=\"/", &format!("=\"{path}/"));
    linked
        .replacen("<html", &format!("<html data-base=\"{path}\""), 1)
        .into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::{
        http::StatusCode,
        response::{Html, IntoResponse as _, Redirect},
        routing::get,
    };

    async fn asked(path: &str) -> (StatusCode, Response) {
        let page = || async { Html("<html lang=\"en\"><a href=\"/campaigns/x\">=&quot;/x</a></html>") };
        let cookie =
            || async { ([(SET_COOKIE, "a=b; HttpOnly; Path=/")], Redirect::to("/login")).into_response() };
        let pages = Router::new().route("/", get(page)).route("/cookie", get(cookie));
        let public = "https://hub.example/user/ana".parse().unwrap();
        let request = Request::get(path).body(Body::empty()).unwrap();
        let response = under(pages, public).call(request).await.unwrap();
        (response.status(), response)
    }

    #[tokio::test]
    async fn pages_are_at_both_places_and_lead_through_the_proxy() {
        for path in ["/", "/user/ana", "/user/ana/"] {
            let (status, response) = asked(path).await;
            let body = axum::body::to_bytes(response.into_body(), 1 << 20).await.unwrap();
            let expected = "<html data-base=\"/user/ana\" lang=\"en\"><a href=\"/user/ana/campaigns/x\">=&quot;/x</a></html>";
            assert_eq!(
                (status, &body[..]),
                (StatusCode::OK, expected.as_bytes()),
                "{path}"
            );
        }
        assert_eq!(asked("/user/anabel").await.0, StatusCode::NOT_FOUND);
    }

    #[tokio::test]
    async fn redirects_and_cookies_have_the_path() {
        let (_, response) = asked("/user/ana/cookie?x=1").await;
        assert_eq!(response.headers()[LOCATION], "/user/ana/login");
        assert_eq!(
            response.headers()[SET_COOKIE],
            "a=b; HttpOnly; Path=/user/ana/; Secure"
        );
    }
}
