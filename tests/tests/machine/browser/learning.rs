//! Tests that fine-tuning on labels changes the map while a page is open.

use crate::browser::{
    driver::Driver,
    scene::{Scene, answer, name, saved},
};
use murmuration_tests::small_latent_spec;

const FEEDBACK: &str = "[feedback]\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";

pub async fn what_was_said_is_learned_and_the_map_changes() {
    let driver = Driver::start();
    let mut scene = Scene::of(&small_latent_spec(FEEDBACK)).await;
    let before = scene.cluster.status("latest").await.checkpoint;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "milling").await;
    name(&window, "wall").await;
    for turn in 0..10 {
        answer(&window, ["1", "2"][turn % 2]).await;
    }
    saved(&window).await;
    window
        .until(
            "document.readyState === 'complete' && document.querySelector('.learn button').checkVisibility()",
        )
        .await;
    window.click(".learn button").await;
    // The dialog explains learning. Before the first round, the dialog cannot report how long a round took.
    window.until("document.querySelector('dialog.ask').open").await;
    let asked = window.text("#asked").await;
    assert!(asked.contains("from seconds to some minutes"), "{asked}");
    window.click("dialog.ask [value=yes]").await;
    // The campaign evaluates one more generation of 20, in the behaviour space of the fine-tuned embedder.
    window
        .until("location.pathname === '/campaigns/small-1' && document.querySelector('.progress')?.textContent.includes('120 of 120')")
        .await;
    window
        .until("document.querySelector('.stands').textContent === 'completed'")
        .await;
    window.driver.goto(scene.url("/map")).await.unwrap();
    window
        .until("document.getElementById('legend')?.textContent.includes('unnamed · 108')")
        .await;
    assert_ne!(scene.cluster.status("latest").await.checkpoint, before);
    window.picture("map-learned").await;
    // After a round, the page reports the round's duration before the next round begins.
    window.driver.refresh().await.unwrap();
    let message = window.value("document.querySelector('.learn').dataset.ask").await;
    let message = message.as_str().unwrap();
    assert!(
        message.contains("As long as the last round:") && message.contains("of training"),
        "{message}"
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn where_there_is_nothing_to_learn_from_the_page_says_so() {
    let driver = Driver::start();
    let scene = Scene::of(&small_latent_spec(FEEDBACK)).await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window
        .until(
            "document.readyState === 'complete' && document.querySelector('.learn button').checkVisibility()",
        )
        .await;
    window.click(".learn button").await;
    // The dialog explains learning.
    window.until("document.querySelector('dialog.ask').open").await;
    window.click("dialog.ask [value=yes]").await;
    window
        .until("document.querySelector('.lead').textContent.includes('at least 2 classes')")
        .await;
    window.close().await;
    scene.cluster.stop().await;
}
