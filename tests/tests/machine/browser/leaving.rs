//! Tests logging in and out, and leaving pages.

use crate::browser::{
    driver::{Driver, Window},
    looks::check,
    scene::{Scene, answer, introduce, name, saved},
};
use murmuration_tests::Murmuration;
use std::fs;

const LABEL: &str = "/campaigns/small-1/label";

/// Waits until the browser shows the page at `path`.
async fn arrived(window: &Window, path: &str) {
    window
        .until(&format!(
            "document.readyState === 'complete' && location.pathname === '{path}'"
        ))
        .await;
}

/// Logs in with `token`, and waits for the page that was requested.
async fn log_in(window: &Window, token: &str) {
    arrived(window, "/login").await;
    window.click("input[name=token]").await;
    window.press(token).await;
    window.press("\u{e007}").await;
    arrived(window, LABEL).await;
}

/// The individuals that have an answer.
fn labelled(murmuration: &Murmuration) -> Vec<u64> {
    let labels = murmuration.run(&["labels", "latest", "--json"]).lines();
    labels
        .iter()
        .map(|label| label["answer"]["index"].as_u64().unwrap())
        .collect()
}

pub async fn who_logs_in_labels_and_who_logs_out_is_out() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let tokens = folder.path().join("tokens.toml");
    let made = [("ana", "annotator"), ("vera", "viewer")]
        .map(|(name, role)| murmuration.run(&["token", name, "--role", role]));
    fs::write(&tokens, made.each_ref().map(|made| made.stdout.as_str()).concat()).unwrap();
    let [token, viewers] = made.each_ref().map(|made| {
        let mut words = made.stderr.split_whitespace();
        words
            .find(|word| word.starts_with("mur_"))
            .expect("the token is shown once")
    });
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

    // The session ends while a person answers. The browser keeps the answer, and the page's first request leads to the log-in.
    coordinator.kill();
    seen.push(answer(&window, "1").await);
    window.driver.delete_all_cookies().await.unwrap();
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    // A log-in without permission to answer does not lose the stored answer.
    log_in(&window, viewers).await;
    window
        .until("document.querySelector('.stale-note').textContent.includes('1 answer is stored in this browser')")
        .await;
    window.click(".account button").await;
    arrived(&window, "/login").await;
    window.driver.goto(&page).await.unwrap();
    log_in(&window, token).await;
    saved(&window).await;
    seen.sort_unstable();
    assert_eq!(labelled(&murmuration), seen);

    for path in ["/", LABEL, "/campaigns/small-1", "/campaigns/small-1/map"] {
        window.driver.goto(format!("{url}{path}")).await.unwrap();
        assert_eq!(window.text(".account button").await, "Log out", "{path}");
    }
    // A page without unsent answers leads to the log-in too.
    window
        .driver
        .goto(format!("{url}/campaigns/small-1"))
        .await
        .unwrap();
    coordinator.kill();
    window.driver.delete_all_cookies().await.unwrap();
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    arrived(&window, "/login").await;
    // The log-in keeps the query of the requested page.
    window.driver.goto(format!("{page}?from=a%26b")).await.unwrap();
    log_in(&window, token).await;
    assert_eq!(window.value("location.search").await, "?from=a%26b");

    window.click(".account button").await;
    arrived(&window, "/login").await;
    window.driver.goto(&page).await.unwrap();
    arrived(&window, "/login").await;
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}

/// Counts the open event streams of pages, including pages that the browser keeps after leaving them.
const COUNT_STREAMS: &str = "{ \
    const count = (by) => localStorage.setItem('streams', Number(localStorage.getItem('streams') ?? 0) + by); \
    globalThis.EventSource = class extends EventSource { \
        constructor(...given) { super(...given); count(1); } \
        close() { super.close(); count(-1); } }; }";

pub async fn a_page_that_was_left_listens_no_more_until_one_goes_back_to_it() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    window.before_pages(COUNT_STREAMS).await;
    let pages = ["/label", "/map", "/sheet", "/answers", "/taxonomy"];
    for page in pages.into_iter().cycle().take(10) {
        window.driver.goto(scene.url(page)).await.unwrap();
        window.until("localStorage.getItem('streams') === '1'").await;
    }
    window.driver.goto(scene.url("/map")).await.unwrap();
    window.driver.goto(scene.url("/classes")).await.unwrap();
    scene.labels.say("Ben", [(7, "milling".to_owned())]).await;
    window.driver.back().await.unwrap();
    arrived(&window, "/campaigns/small-1/map").await;
    window
        .until("document.getElementById('legend').textContent.includes('milling · 1')")
        .await;
    window.until("localStorage.getItem('streams') === '1'").await;
    window.close().await;
    scene.cluster.stop().await;
}
