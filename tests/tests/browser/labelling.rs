//! One behaviour at a time, with the keyboard.

use crate::{
    driver::Driver,
    scene::{Labels, Scene, answer, asked, introduce, name, saved},
};
use murmuration_tests::Murmuration;
use std::collections::BTreeSet;

#[tokio::test(flavor = "multi_thread")]
async fn thirty_are_labelled_two_taken_back_and_a_refresh_loses_nothing() {
    let Some(driver) = Driver::start() else { return };
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    let mut seen = vec![name(&window, "milling").await, name(&window, "wall").await];
    window
        .until("document.querySelectorAll('.class').length === 2")
        .await;
    for turn in 0..13 {
        seen.push(answer(&window, ["1", "2", "?", "s"][turn % 4]).await);
    }
    // Some of these may not be acknowledged yet.
    window.driver.refresh().await.unwrap();
    for _ in 0..15 {
        seen.push(answer(&window, "1").await);
    }
    saved(&window).await;
    assert_eq!(
        seen.iter().collect::<BTreeSet<_>>().len(),
        30,
        "asked twice: {seen:?}"
    );
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), 30);
    assert!(seen.iter().all(|index| standing.contains_key(index)));
    assert_eq!(standing[&seen[1]], "wall");

    // Taken back, they are asked about again, the last one first.
    for &index in seen[28..].iter().rev() {
        window.press("u").await;
        window
            .until(&format!(
                "document.getElementById('which').textContent === 'Individual {index}'"
            ))
            .await;
    }
    saved(&window).await;
    assert_eq!(scene.labels.standing().await.len(), 28);
    assert_eq!(scene.labels.entries().await, 32);
    assert!(window.text("#count").await.starts_with("28 of 100"));
    window.close().await;
    scene.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn two_who_label_at_once_are_never_asked_the_same() {
    let Some(driver) = Driver::start() else { return };
    let mut scene = Scene::set().await;
    let ana = scene.visit(&driver, "/label", "Ana").await;
    let ben = scene.visit(&driver, "/label", "Ben").await;
    name(&ana, "milling").await;
    ben.until("document.querySelectorAll('.class').length === 1")
        .await;
    let label = async |window| {
        let mut seen = Vec::new();
        for _ in 0..20 {
            seen.push(answer(window, "1").await);
        }
        saved(window).await;
        seen
    };
    let (first, second) = tokio::join!(label(&ana), label(&ben));
    let both: BTreeSet<_> = first.iter().chain(&second).collect();
    assert_eq!(both.len(), 40, "{first:?} and {second:?}");
    assert_eq!(scene.labels.standing().await.len(), 41);
    ana.close().await;
    ben.close().await;
    scene.cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_killed_coordinator_loses_no_answer() {
    let Some(driver) = Driver::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let serve = |listen: &str| murmuration.serve(listen, &["--workers", "1"]);
    let (coordinator, url) = serve("127.0.0.1:0");
    let window = driver.open(&format!("{url}/campaigns/small-1/label")).await;
    introduce(&window, "Ana").await;
    let mut seen = vec![name(&window, "milling").await];
    for _ in 0..4 {
        seen.push(answer(&window, "1").await);
    }
    saved(&window).await;
    coordinator.kill();
    // The next questions are there already.
    for _ in 0..2 {
        seen.push(answer(&window, "1").await);
    }
    window
        .until("document.getElementById('status').textContent.includes('2 answers kept here')")
        .await;
    // It must be found where it was.
    let (coordinator, again) = serve(url.trim_start_matches("http://"));
    assert_eq!(again, url);
    saved(&window).await;
    seen.push(answer(&window, "1").await);
    saved(&window).await;
    let standing = Labels::at(&url).await.standing().await;
    assert_eq!(
        standing.into_keys().collect::<BTreeSet<_>>(),
        seen.into_iter().collect()
    );
    asked(&window).await;
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}
