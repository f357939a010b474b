//! Pages and metrics, as a program asks for them.

use crate::block_on;

/// Chooses the cryptography of all clients of HTTP in this process; those of other libraries need it too.
pub fn choose_cryptography() {
    // An error says that another call was first.
    let _ = rustls::crypto::ring::default_provider().install_default();
}

/// A client of HTTP, to be built.
pub fn client() -> reqwest::ClientBuilder {
    choose_cryptography();
    reqwest::Client::builder()
}

/// The answer to a request.
///
/// # Errors
/// As [`reqwest::RequestBuilder::send`].
pub async fn get(url: impl reqwest::IntoUrl) -> reqwest::Result<reqwest::Response> {
    client().build()?.get(url).send().await
}

/// What a page says; it must be there.
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
