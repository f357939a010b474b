//! Which keys belong to the page while a control has the focus.

use crate::browser::{
    driver::Driver,
    scene::{Scene, answer, asked, name, saved},
};
use serde_json::json;

pub async fn answers_are_given_from_any_menu_and_box_and_these_keep_their_own_keys() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "milling").await;
    name(&window, "wall").await;
    window.click("summary").await;
    let mut seen = Vec::new();
    for control in [
        ".speed",
        "#strategy",
        "#goal",
        "#agreement",
        ".scrub",
        ".toggle",
        "summary",
    ] {
        window.focus(control).await;
        for key in ["2", "s", "0", "1"] {
            seen.push(answer(&window, key).await);
        }
        let focused = format!("document.activeElement === document.querySelector('{control}')");
        assert_eq!(
            window.value(&focused).await,
            json!(true),
            "{control} lost the focus"
        );
    }
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), 2 + seen.len());
    assert_eq!(
        (standing[&seen[0]].as_str(), standing[&seen[3]].as_str()),
        ("wall", "milling")
    );
    let chosen = "[document.querySelector('.speed').value, document.querySelector('#goal').value]";
    assert_eq!(window.value(chosen).await, json!(["4", "200"]));

    // What a control does with a key of its own it does once, and the page nothing.
    window.focus("#agreement").await;
    window.press(" ").await;
    window.until("document.querySelector('#agreement').checked").await;
    window.press(" ").await;
    window
        .until("!document.querySelector('#agreement').checked")
        .await;
    window.focus(".speed").await;
    window.press("\u{e015}").await;
    window
        .until("document.querySelector('.speed').value === '8'")
        .await;
    asked(&window).await;
    let plays = "document.querySelector('.toggle').classList.contains('playing')";
    window.until(plays).await;
    window.focus(".toggle").await;
    window.press(" ").await;
    window.until(&format!("!{plays}")).await;

    // A pointer leaves no focus behind. Nobody else has answered, so that there is nothing to agree on.
    window.click("#agreement").await;
    window
        .until("document.getElementById('which').textContent === 'No questions left'")
        .await;
    window.press(" ").await;
    window.until(plays).await;
    assert_eq!(
        window.value("document.querySelector('#agreement').checked").await,
        json!(true)
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_class_keeps_its_key_when_another_goes() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.say("Ben", [(3, "ring".to_owned())]).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "wall").await;
    let keys = "[...document.querySelectorAll('.class')].map((one) => one.textContent).join(' ')";
    window.until(&format!("{keys} === '1ring1 2wall1'")).await;
    // Of no answer any more, the first class is gone.
    scene.labels.undo("Ben").await;
    window.until(&format!("{keys} === '2wall1'")).await;
    let wall = answer(&window, "2").await;
    name(&window, "dispersal").await;
    window.until(&format!("{keys} === '2wall2 1dispersal1'")).await;
    let dispersal = answer(&window, "1").await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(
        (standing[&wall].as_str(), standing[&dispersal].as_str()),
        ("wall", "dispersal")
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn an_arrow_on_the_sheet_moves_the_motion_or_goes_to_another_cluster_never_both() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    window
        .until("document.querySelectorAll('.card').length > 3")
        .await;
    window.focus(".card").await;
    window.until("!document.querySelector('.scrub').disabled").await;
    window.press("\u{e014}").await;
    window
        .until("document.querySelector('#cluster').value === '1'")
        .await;
    window.focus(".scrub").await;
    let before = window
        .value("Number(document.querySelector('.scrub').value)")
        .await;
    window.press("\u{e014}\u{e014}").await;
    window
        .until(&format!(
            "Number(document.querySelector('.scrub').value) !== {before}"
        ))
        .await;
    assert_eq!(
        window.value("document.querySelector('#cluster').value").await,
        json!("1")
    );
    window.close().await;
    scene.cluster.stop().await;
}
