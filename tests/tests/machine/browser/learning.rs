//! Fine-tuning on labels changes the map while a page is open.

use crate::browser::{
    comparisons::asked_after,
    driver::Driver,
    looks::check,
    scene::{Scene, answer, name, saved},
};
use murmuration_proto::v1;
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
    // It says first what that does.
    window.until("document.querySelector('dialog.ask').open").await;
    window.click("dialog.ask [value=yes]").await;
    // One generation of 20 more, placed by what was learned.
    window
        .until("document.getElementById('legend')?.textContent.includes('unnamed · 108')")
        .await;
    window
        .until("document.getElementById('doing').textContent === ''")
        .await;
    assert_ne!(scene.cluster.status("latest").await.checkpoint, before);
    window.picture("map-learned").await;
    // Now it is known how long a round takes, and it is said before the next.
    window.driver.refresh().await.unwrap();
    let said = window.value("document.querySelector('.learn').dataset.ask").await;
    let said = said.as_str().unwrap();
    assert!(
        said.contains("By the last round, that takes") && said.contains("of training"),
        "{said}"
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn who_only_compares_teaches_too() {
    let driver = Driver::start();
    let mut scene = Scene::of(&small_latent_spec(FEEDBACK)).await;
    let window = scene.visit(&driver, "/comparisons", "Ana").await;
    for place in 0..8 {
        asked_after(&window, place).await;
        window.press(["\u{e012}", "\u{e014}"][place % 2]).await;
    }
    asked_after(&window, 8).await;
    window.click(".learn button").await;
    window.until("document.querySelector('dialog.ask').open").await;
    let said = window.text("#asked").await;
    assert!(said.contains("from seconds to some minutes"), "{said}");
    check(&window, "comparisons-learn").await;
    window.click("dialog.ask [value=yes]").await;
    window
        .until("document.readyState === 'complete' && location.pathname.endsWith('/map')")
        .await;
    let learned = scene.cluster.finish("latest").await;
    assert_eq!(learned.state(), v1::CampaignState::Completed, "{}", learned.error);
    let request = v1::GetDigestRequest {
        campaign: "latest".to_owned(),
    };
    let digest = scene.cluster.client.get_digest(request).await.unwrap();
    let rounds: Vec<_> = digest
        .into_inner()
        .rounds
        .iter()
        .map(|round| (round.labels, round.comparisons))
        .collect();
    assert_eq!(rounds, [(0, 8)]);
    let report = reqwest::get(scene.url("/report")).await.unwrap();
    let report = report.text().await.unwrap();
    for said in [
        "This campaign learned from 8 comparisons which behaviours are alike.",
        "it was fine-tuned on comparisons in 1 round",
    ] {
        assert!(report.contains(said), "{said}");
    }
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
    // It says first what that does.
    window.until("document.querySelector('dialog.ask').open").await;
    window.click("dialog.ask [value=yes]").await;
    window
        .until("document.querySelector('.lead').textContent.includes('at least 2 classes')")
        .await;
    window.close().await;
    scene.cluster.stop().await;
}
