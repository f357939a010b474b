//! Log-in and log-out.

use crate::browser::{
    driver::{Driver, Window},
    looks::check,
    scene::{answer, introduce, name, saved},
};
use murmuration_tests::Murmuration;
use std::fs;

const LABEL: &str = "/campaigns/small-1/label";

/// Waits until the page is that of this address.
async fn arrived(window: &Window, path: &str) {
    window
        .until(&format!(
            "document.readyState === 'complete' && location.pathname === '{path}'"
        ))
        .await;
}

/// Logs in, and is led to the page that was asked for.
async fn log_in(window: &Window, token: &str) {
    arrived(window, "/login").await;
    window.click("input[name=token]").await;
    window.press(token).await;
    window.press("\u{e007}").await;
    arrived(window, LABEL).await;
}

/// Individuals with an answer.
fn labelled(murmuration: &Murmuration) -> Vec<u64> {
    let labels = murmuration.run(&["labels", "latest", "--json"]).lines();
    labels
        .iter()
        .map(|label| label["index"].as_u64().unwrap())
        .collect()
}

pub async fn who_logs_in_labels_and_who_logs_out_is_out() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let made = murmuration.run(&["token", "ana", "--role", "annotator"]);
    let tokens = folder.path().join("tokens.toml");
    fs::write(&tokens, &made.stdout).unwrap();
    let token = made
        .stderr
        .split_whitespace()
        .find(|word| word.starts_with("mur_"));
    let token = token.expect("the token is shown once");
    let tokens = tokens.display().to_string();
    let serve = |listen: &str| murmuration.serve(listen, &["--workers", "1", "--tokens", &tokens]);
    let (coordinator, url) = serve("127.0.0.1:0");

    let page = format!("{url}{LABEL}");
    let window = driver.open(&page).await;
    arrived(&window, "/login").await;
    check(&window, "login").await;
    window.click("input[name=token]").await;
    window.press("mur_of_nobody\u{e007}").await;
    window.until("document.querySelector('[role=alert]')").await;
    check(&window, "login-refused").await;
    log_in(&window, token).await;
    introduce(&window, "Ana").await;
    let mut seen = vec![name(&window, "milling").await];
    window.picture("label-logged-in").await;

    // The session ends while a person answers: the answer is kept, and with its first request the page goes to the
    // log-in by itself.
    coordinator.kill();
    seen.push(answer(&window, "1").await);
    window.driver.delete_all_cookies().await.unwrap();
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    log_in(&window, token).await;
    saved(&window).await;
    seen.sort_unstable();
    assert_eq!(labelled(&murmuration), seen);

    for path in ["/", LABEL, "/campaigns/small-1", "/campaigns/small-1/map"] {
        window.driver.goto(format!("{url}{path}")).await.unwrap();
        assert_eq!(window.text(".account button").await, "Log out", "{path}");
    }
    // So does a page that only looks on.
    window
        .driver
        .goto(format!("{url}/campaigns/small-1"))
        .await
        .unwrap();
    coordinator.kill();
    window.driver.delete_all_cookies().await.unwrap();
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    arrived(&window, "/login").await;
    window.driver.goto(&page).await.unwrap();
    log_in(&window, token).await;

    window.click(".account button").await;
    arrived(&window, "/login").await;
    window.driver.goto(&page).await.unwrap();
    arrived(&window, "/login").await;
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}
