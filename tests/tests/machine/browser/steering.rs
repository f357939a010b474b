//! Tests the page Progress: watching and ending a campaign.

use crate::browser::{
    driver::Driver,
    looks::{SIZES, check},
    scene::Scene,
};
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{small_latent_spec, small_spec};
use serde_json::json;

pub async fn novelty_is_drawn_as_it_grows_and_cancelling_asks_first() {
    let driver = Driver::start();
    // With so many generations, the campaign is still running at the end of the test.
    let text = small_spec("")
        .to_toml()
        .replace("generations = 5", "generations = 100000");
    let mut scene = Scene::begun(&CampaignSpec::from_toml(&text).unwrap()).await;
    let window = driver.open(&scene.url("")).await;
    window
        .until("document.querySelectorAll('#novelty polyline').length === 2")
        .await;
    let last = "Number(/generation ([0-9,]+):/.exec(document.querySelector('#novelty p').textContent)[1].replace(',', ''))";
    let before = window.value(last).await.as_u64().unwrap();
    window.until(&format!("{last} > {before}")).await;
    // Keys select a generation. A screen reader reads the selected generation's values, but not values that arrive by themselves.
    assert_eq!(window.text("#novelty [role=status]").await, "");
    window.focus("#novelty svg").await;
    window.press("\u{e012}").await;
    window.press("\u{e012}").await;
    window
        .until("document.querySelectorAll('#novelty circle').length === 2")
        .await;
    let told = window.text("#novelty p").await;
    assert!(told.contains("best ") && told.contains("mean "), "{told}");
    let spoken = window
        .value("document.querySelector('#novelty [role=status]').textContent")
        .await;
    assert!(spoken.as_str().unwrap().contains("best "), "{spoken}");

    // The page lists the machines, and plays individuals that the search found.
    let machines = window.text(".machines").await;
    assert!(
        machines.contains("worker") && machines.contains("At once"),
        "{machines}"
    );
    window
        .until("document.querySelectorAll('#shown .player .reason').length === 6 && [...document.querySelectorAll('#shown .player .reason')].every((words) => words.textContent.startsWith('individual '))")
        .await;
    window.click("#rest").await;
    window
        .until("document.getElementById('rest').ariaPressed === 'true'")
        .await;
    for (width, height) in SIZES {
        window.resize(width, height, width < 500).await;
        window.picture(&format!("searching-{width}")).await;
        check(&window, "progress").await;
    }
    window.resize(1280, 900, false).await;

    // The page updates four times a second, and its buttons still work.
    window.click("#cancel").await;
    window.until("document.querySelector('dialog.ask').open").await;
    window.click("dialog.ask [value='']").await;
    window.until("!document.querySelector('dialog.ask')").await;
    let running = scene.cluster.status("latest").await;
    assert_eq!(running.state(), v1::CampaignState::Running);
    window.click("#cancel").await;
    window.click("dialog.ask [value=yes]").await;
    window.until("!document.getElementById('cancel')").await;
    let cancelled = scene.cluster.status("latest").await;
    assert_eq!(cancelled.state(), v1::CampaignState::Cancelled);
    // The search has ended, so there are no individuals to show.
    window.until("document.getElementById('shown').hidden").await;
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn the_training_and_its_rounds_are_drawn_after_a_reload() {
    let driver = Driver::start();
    let taught = "[feedback]\nrounds = 1\ngenerations = 2\nlabels = 40\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";
    let scene = Scene::of(&small_latent_spec(taught)).await;
    let window = driver.open(&scene.url("")).await;
    for _ in 0..2 {
        window
            .until("document.querySelectorAll('#accuracy .event').length === 1 && document.querySelectorAll('#loss .event').length === 1")
            .await;
        let event = window.text("#loss .event title").await;
        assert_eq!(event, "round 1 begins");
        let told = window.text("#accuracy p").await;
        assert!(told.contains("of round 1: accuracy"), "{told}");
        // When a person selects an epoch in one curve, both curves show the values of this epoch.
        window.focus("#loss svg").await;
        window.press("\u{e012}").await;
        window.press("\u{e012}").await;
        for curve in ["accuracy", "loss"] {
            window
                .until(&format!(
                    "document.querySelectorAll('#{curve} circle').length === 1"
                ))
                .await;
        }
        let told = window.text("#loss p").await;
        assert!(told.contains("mean loss ") && !told.contains('–'), "{told}");
        let spoken = window
            .value("document.querySelector('#loss [role=status]').textContent")
            .await;
        let spoken = spoken.as_str().unwrap();
        assert!(
            spoken.contains("mean loss ") && spoken.contains("accuracy "),
            "{spoken}"
        );
        let marks =
            "[...document.querySelectorAll('#novelty .event title')].map((title) => title.textContent)";
        let marks = window.value(marks).await;
        assert_eq!(
            marks,
            json!(["first checkpoint", "new checkpoint, after round 1"])
        );
        // The table contains the round with its taxonomy; the row before the round has no taxonomy.
        let rows = window
            .value("[...document.querySelectorAll('.history tbody tr')].map((row) => row.textContent)")
            .await;
        let rows: Vec<&str> = rows
            .as_array()
            .unwrap()
            .iter()
            .map(|row| row.as_str().unwrap())
            .collect();
        assert_eq!(rows.len(), 2, "{rows:?}");
        assert!(
            rows[0].contains("pictures without labels") && rows[0].ends_with("none"),
            "{rows:?}"
        );
        assert!(
            rows[1].contains("the classes of ") && rows[1].contains(" %") && rows[1].ends_with("version 1"),
            "{rows:?}"
        );
        window.driver.refresh().await.unwrap();
    }
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window
                .until("document.querySelectorAll('#loss .event').length === 1")
                .await;
            window.picture(&format!("trained-{width}-{scheme}")).await;
            check(&window, "progress").await;
        }
    }
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_button_never_becomes_another_and_what_was_agreed_to_is_done() {
    let driver = Driver::start();
    // With so many generations, the campaign is still running at the end of the test.
    let text = small_spec("")
        .to_toml()
        .replace("generations = 5", "generations = 100000");
    let mut scene = Scene::begun(&CampaignSpec::from_toml(&text).unwrap()).await;
    let window = driver.open(&scene.url("")).await;
    window.until("document.getElementById('pause')").await;
    // Another window pauses the campaign while a person presses this window's button.
    let elsewhere = "window.pressed = document.getElementById('pause'); fetch('/campaigns/small-1/pause', { method: 'POST' })";
    window.driver.execute(elsewhere, vec![]).await.unwrap();
    window.until("document.getElementById('resume')").await;
    let left = "[window.pressed.id, window.pressed.isConnected, window.pressed.form.getAttribute('action').split('/').at(-1)]";
    assert_eq!(
        window.value(left).await,
        serde_json::json!(["pause", false, "pause"])
    );

    // If the button's form is gone, the page reports that the action is no longer possible.
    window.click("#cancel").await;
    let gone = "document.querySelector('.actions').replaceChildren()";
    window.driver.execute(gone, vec![]).await.unwrap();
    window.click("dialog.ask [value=yes]").await;
    window
        .until("document.getElementById('told').textContent.includes('no longer possible')")
        .await;
    window.click("dialog.ask button").await;
    let paused = scene.cluster.status("latest").await;
    assert_eq!(paused.state(), v1::CampaignState::Paused);

    // If a new form has replaced the button's form, the page sends the new form.
    window.driver.refresh().await.unwrap();
    window.click("#cancel").await;
    let renewed =
        "const actions = document.querySelector('.actions'); actions.innerHTML = String(actions.innerHTML)";
    window.driver.execute(renewed, vec![]).await.unwrap();
    window.click("dialog.ask [value=yes]").await;
    window.until("!document.getElementById('cancel')").await;
    let cancelled = scene.cluster.status("latest").await;
    assert_eq!(cancelled.state(), v1::CampaignState::Cancelled);
    window.close().await;
    scene.cluster.stop().await;
}
