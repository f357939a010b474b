//! The parameters of a request: the query of its address, and its form.
//!
//! [`Query`] and [`Form`] work like axum's extractors of these names, but their errors appear on our error page and name the
//! field.

use super::page_error::PageError;
use axum::{
    body::Body,
    extract::{
        self, FromRequest, FromRequestParts, RawForm, Request,
        rejection::{FormRejection, QueryRejection},
    },
    http::request::Parts,
    response::IntoResponse as _,
};
use murmuration_swarm::{Invalid, counted, text};
use serde::de::DeserializeOwned;

/// Maximum number of fields of a form: a field takes far more memory than its bytes.
const MOST_FIELDS: usize = 1000;

/// The query of a request's address.
#[derive(Debug)]
pub(super) struct Query<T>(pub(super) T);

/// The form of a request: the body of a POST, or the query of a GET's address.
#[derive(Debug)]
pub(super) struct Form<T>(pub(super) T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequestParts<S> for Query<T> {
    type Rejection = PageError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, PageError> {
        let query = extract::Query::from_request_parts(parts, state).await;
        let refused = |rejection: QueryRejection| {
            let query = parts.uri.query().unwrap_or_default();
            refused(&rejection.body_text(), query.as_bytes()).into()
        };
        query.map(|extract::Query(query)| Self(query)).map_err(refused)
    }
}

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for Form<T> {
    type Rejection = PageError;

    async fn from_request(request: Request, state: &S) -> Result<Self, PageError> {
        let (parts, body) = request.into_parts();
        let again = |body: Body| Request::from_parts(parts.clone(), body);
        let RawForm(form) = RawForm::from_request(again(body), state)
            .await
            .map_err(|rejection| PageError::Unread(rejection.into_response().status()))?;
        let fields = 1 + form.iter().filter(|&&byte| byte == b'&').count();
        if fields > MOST_FIELDS {
            let value = counted(fields as u64, "field");
            return Err(Invalid::new("the form", value, format!("at most {MOST_FIELDS} fields")).into());
        }
        let read = extract::Form::from_request(again(Body::from(form.clone())), state).await;
        read.map(|axum::Form(read)| Self(read))
            .map_err(|rejection| match rejection {
                FormRejection::FailedToDeserializeForm(_) | FormRejection::FailedToDeserializeFormBody(_) => {
                    refused(&rejection.body_text(), &form).into()
                }
                other => PageError::Unread(other.status()),
            })
    }
}

/// Finds the field that axum refused, and the field's value in the query or form. `message` is axum's error message: "Failed to
/// ...: FIELD: reason", or a reason with the field in backticks.
fn refused(message: &str, pairs: &[u8]) -> Invalid {
    let pairs: Vec<(String, String)> = serde_urlencoded::from_bytes(pairs).unwrap_or_default();
    let find = |field: &str| pairs.iter().find(|(name, _)| name == field);
    let part = |separator| message.split(separator).nth(1).unwrap_or_default();
    if let Some((field, value)) = find(part(": ")) {
        // The text of our own errors says what is allowed; the texts of the library are not for people.
        let allowed = message.split_once(": must be ").map(|(_, allowed)| allowed);
        return Invalid::new(
            field,
            text::quoted(value),
            allowed.unwrap_or("a value that this page takes"),
        );
    }
    match (part("`"), find(part("`"))) {
        (_, Some((field, value))) => Invalid::new(field, text::quoted(value), "given once"),
        ("", None) => Invalid::missing("request", "names and values"),
        (field, None) => Invalid::missing(field, "given"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::{StatusCode, header::CONTENT_TYPE};
    use serde::Deserialize;

    #[derive(Debug, Deserialize)]
    struct Wanted {
        page: usize,
    }

    #[tokio::test]
    async fn the_field_of_a_query_or_form_is_named() {
        for (asked, expected) in [
            ("page=-1", "page = \"-1\": must be a value that this page takes"),
            (
                "a=%1b&page=%1b%5bm",
                "page = \"\\u{1b}[m\": must be a value that this page takes",
            ),
            ("page=1&page=2", "page = \"1\": must be given once"),
            ("", "page is missing: must be given"),
        ] {
            let request = Request::get(format!("/?{asked}")).body(Body::empty()).unwrap();
            let query = Query::<Wanted>::from_request(request, &()).await;
            assert_eq!(query.unwrap_err().to_string(), expected);
            let request = Request::post("/").header(CONTENT_TYPE, "application/x-www-form-urlencoded");
            let request = request.body(Body::from(asked)).unwrap();
            let form = Form::<Wanted>::from_request(request, &()).await;
            assert_eq!(form.unwrap_err().to_string(), expected);
        }
        let request = Request::get("/?page=7").body(Body::empty()).unwrap();
        let Query(wanted) = Query::<Wanted>::from_request(request, &()).await.unwrap();
        assert_eq!(wanted.page, 7);
        let request = Request::post("/").body(Body::from("page=7")).unwrap();
        let refused = Form::<Wanted>::from_request(request, &()).await.unwrap_err();
        assert_eq!(
            refused.into_response().status(),
            StatusCode::UNSUPPORTED_MEDIA_TYPE
        );
    }
}
