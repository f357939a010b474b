//! Tests the map: filters that the page remembers, going back to earlier views, and paths over the pictures of behaviours.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
    scene::{Scene, saved},
    selecting::{lasso_all, name_selected},
};

/// Chooses an entry of a menu of the map.
async fn pick(window: &Window, menu: &str, value: &str) {
    let pick = format!(
        "const menu = document.getElementById({menu:?}); menu.value = {value:?}; menu.dispatchEvent(new Event('change'))"
    );
    window.driver.execute(pick, vec![]).await.unwrap();
}

/// Waits until the map reports this number of shown individuals.
async fn shows(window: &Window, count: usize) {
    window
        .until(&format!(
            "document.getElementById('shown').textContent === '{count} of 100 individuals are shown.'"
        ))
        .await;
}

pub async fn what_the_map_shows_is_remembered_until_all_is_shown() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let ring = (0..12).chain([95]).map(|index| (index, "ring".to_owned()));
    scene.labels.say("Ben", ring.clone()).await;
    scene.labels.say("Cem", [(50, "ring".to_owned())]).await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window
        .until("document.querySelector('#of-class [value=\"=ring\"]') && document.querySelector('#legend button')")
        .await;
    // The map filters by class while the colours show clusters, and combines this filter with an annotator.
    pick(&window, "colouring", "cluster").await;
    pick(&window, "of-class", "=ring").await;
    shows(&window, 14).await;
    pick(&window, "answered-by", "Ben").await;
    shows(&window, 13).await;
    // The last of these individuals is of generation 4.
    pick(&window, "to", "3").await;
    shows(&window, 12).await;
    window.driver.refresh().await.unwrap();
    shows(&window, 12).await;
    let menus = "['colouring', 'of-class', 'answered-by', 'to'].map((id) => document.getElementById(id).value).join()";
    assert_eq!(window.value(menus).await.as_str(), Some("cluster,=ring,Ben,3"));
    window.picture("map-filtered").await;
    pick(&window, "of-class", "=").await;
    shows(&window, 0).await;
    window.click("#show-all").await;
    let all = "document.getElementById('shown').textContent === 'All 100 individuals are shown.'";
    window.until(all).await;
    window.driver.refresh().await.unwrap();
    window.until(all).await;
    assert_eq!(window.value(menus).await.as_str(), Some("cluster,,,"));
    pick(&window, "of-class", "=").await;
    shows(&window, 86).await;
    // A filter for a class that no longer exists hides nothing.
    pick(&window, "of-class", "=ring").await;
    shows(&window, 14).await;
    scene.labels.undo("Ben").await;
    scene.labels.undo("Cem").await;
    window.until(all).await;
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn the_map_goes_back_shows_paths_and_asks_before_one_answer_is_replaced() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window.until("document.querySelector('#legend button')").await;
    assert_eq!(
        window
            .value("document.getElementById('back').disabled")
            .await
            .as_bool(),
        Some(true)
    );
    // Keys select the individual in the middle of the map; the page draws the individual's paths over its picture.
    window.focus("#over").await;
    window.press("\u{e014}").await;
    window.until(&colours("#tip .paths")).await;
    window.press(" ").await;
    window
        .until("document.getElementById('selected').textContent.startsWith('1 selected')")
        .await;
    window.click("#gallery .card").await;
    window.until(&colours("#gallery .paths")).await;
    window.picture("map-paths").await;

    // Replacing a single answer needs a confirmation.
    let first = "Number(document.querySelector('#gallery .card').dataset.index)";
    let index = window.value(first).await.as_u64().unwrap();
    name_selected(&window, "ring").await;
    saved(&window).await;
    window
        .until("document.getElementById('legend').textContent.includes('ring · 1') && document.getElementById('tip').hidden")
        .await;
    window.focus("#over").await;
    window.press("\u{e014} ").await;
    window
        .until(&format!(
            "document.querySelector('#gallery .card')?.dataset.index === '{index}'"
        ))
        .await;
    name_selected(&window, "clump").await;
    window.until("document.getElementById('overwrite').open").await;
    let asked = window.text("#overwrite p").await;
    assert_eq!(
        asked,
        format!("Individual {index} has the class “ring” already. “clump” would replace it.")
    );
    window.click("#overwrite [value='']").await;
    assert_eq!(scene.labels.standing().await[&index], "ring");
    name_selected(&window, "clump").await;
    window.until("document.getElementById('overwrite').open").await;
    window.click("#overwrite [value=all]").await;
    window
        .until("document.getElementById('legend').textContent.includes('clump · 1')")
        .await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await[&index], "clump");

    // The test zooms in twice, and goes back twice: once by key, once by button.
    let all = lasso_all(&window).await;
    window.click("[data-zoom=in]").await;
    window.click("[data-zoom=in]").await;
    let part = lasso_all(&window).await;
    assert!(part < all, "{part} of {all}");
    window.focus("#over").await;
    window.press("\u{e003}").await;
    window.until("!document.getElementById('back').disabled").await;
    let more = lasso_all(&window).await;
    assert!(part <= more && more <= all, "{part}, {more}, {all}");
    window.click("#back").await;
    window.until("document.getElementById('back').disabled").await;
    assert_eq!(lasso_all(&window).await, all);
    window.close().await;
    scene.cluster.stop().await;
}

/// Whether a canvas contains colours.
fn colours(canvas: &str) -> String {
    format!(
        "(() => {{ const canvas = document.querySelector({canvas:?}); \
            const {{ data }} = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height); \
            return data.some((_, i) => i % 4 === 0 && data[i + 3] > 60 && \
                Math.max(data[i], data[i + 1], data[i + 2]) - Math.min(data[i], data[i + 1], data[i + 2]) > 60); }})()"
    )
}

pub async fn what_was_looked_at_shows_its_paths() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let ring = (0..12).map(|index| (index, "ring".to_owned()));
    scene.labels.say("Ben", ring).await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    window
        .until("document.querySelectorAll('.card').length > 3")
        .await;
    window.focus(".card:nth-child(2)").await;
    window.until(&colours(".card:nth-child(2) .paths")).await;
    window.press(" ").await;
    window
        .until("document.querySelector('.card:nth-child(2)').ariaPressed === 'true'")
        .await;
    window.focus(".card:nth-child(3)").await;
    window.until(&colours(".card:nth-child(3) .paths")).await;
    look(&window, "sheet-paths").await;
    window.driver.goto(scene.url("/answers")).await.unwrap();
    window
        .until("document.querySelectorAll('.answer').length === 12")
        .await;
    window.click(".answer:nth-child(2)").await;
    window.until(&colours(".answer:nth-child(2) .paths")).await;
    look(&window, "answers-paths").await;
    window.close().await;
    scene.cluster.stop().await;
}

/// Checks the page on a wide and a narrow screen, with light and dark colours.
async fn look(window: &Window, name: &str) {
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("{name}-{width}-{scheme}")).await;
            check(window, name).await;
        }
    }
    window.resize(1280, 900, false).await;
}
