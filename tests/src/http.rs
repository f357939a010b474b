//! Requests pages and metrics of a coordinator over HTTP.

use crate::block_on;

/// Sets the cryptography of all HTTP clients in this process. Clients of other libraries need this setting too.
pub fn choose_cryptography() {
    // An error means that the cryptography is already set.
    let _ = rustls::crypto::ring::default_provider().install_default();
}

/// A builder for an HTTP client.
pub fn client() -> reqwest::ClientBuilder {
    choose_cryptography();
    reqwest::Client::builder()
}

/// Sends a GET request.
///
/// # Errors
/// The errors of [`reqwest::RequestBuilder::send`].
pub async fn get(url: impl reqwest::IntoUrl) -> reqwest::Result<reqwest::Response> {
    client().build()?.get(url).send().await
}

/// The text of a page. Panics unless the page exists.
#[must_use]
#[track_caller]
pub fn page(url: &str) -> String {
    block_on(async {
        let answer = get(url).await.and_then(reqwest::Response::error_for_status);
        answer
            .unwrap_or_else(|error| panic!("{url}: {error}"))
            .text()
            .await
            .unwrap()
    })
}
