//! Pages and metrics, as a program asks for them.

use crate::block_on;

/// What a page says; it must be there.
#[must_use]
#[track_caller]
pub fn page(url: &str) -> String {
    block_on(async {
        let answer = reqwest::get(url)
            .await
            .and_then(reqwest::Response::error_for_status);
        answer
            .unwrap_or_else(|error| panic!("{url}: {error}"))
            .text()
            .await
            .unwrap()
    })
}
