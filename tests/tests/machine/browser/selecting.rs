//! Tests labelling many behaviours at once: with a lasso on the map, on the contact sheet, and by naming medoids.

use crate::browser::{
    driver::{Driver, Window},
    scene::{Scene, introduce_here, saved},
};
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::small_spec;

/// Script: horizontal positions of the points on the canvas, computed from the columns that the page fetches.
const ACROSS: &str = "(async () => { \
    const { x, spans } = await (await fetch('points/axes')).json(); \
    const bytes = Uint8Array.from(atob(x), (c) => c.charCodeAt(0)); \
    const { clientWidth, clientHeight } = document.getElementById('over'); \
    const room = 2 * Math.min(34, clientWidth / 14); \
    const unit = Math.min((clientWidth - room) / spans[0], (clientHeight - room) / spans[1]); \
    return [clientWidth, clientHeight, Array.from(new Uint16Array(bytes.buffer), \
        (x) => clientWidth / 2 + (x / 65535 - 0.5) * spans[0] * unit)]; })()";

/// Draws a lasso around ten points of the map, or around a few more if points are too close together. Returns the number of
/// selected points.
pub async fn lasso_ten(window: &Window) -> usize {
    let shown = window.value(ACROSS).await;
    let (width, height) = (shown[0].as_f64().unwrap(), shown[1].as_f64().unwrap());
    let mut across: Vec<f64> = shown[2]
        .as_array()
        .unwrap()
        .iter()
        .map(|x| x.as_f64().unwrap())
        .collect();
    across.sort_by(f64::total_cmp);
    let (count, edge) = (10..across.len())
        .map(|count| (count, across[count - 1].midpoint(across[count])))
        .find(|(count, _)| across[*count] - across[count - 1] > 3.0)
        .expect("some points are apart");
    assert!(edge < width - 2.0);
    // The lasso stays inside the round corners of the map.
    let line = [
        (8.0, 8.0),
        (edge, 8.0),
        (edge, height - 8.0),
        (8.0, height - 8.0),
        (8.0, 10.0),
    ];
    window.draw("#over", &line).await;
    count
}

pub async fn ten_are_lassoed_on_the_map_and_named() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window.until("document.querySelector('.legend li')").await;
    window.driver.execute("scrollTo(0, 0)", vec![]).await.unwrap();
    let count = lasso_ten(&window).await;
    window
        .until(&format!(
            "document.getElementById('selected').textContent.startsWith('{count} selected')"
        ))
        .await;
    // All selected individuals are shown before they are named.
    let pictured = window
        .value("document.querySelectorAll('#gallery img').length")
        .await;
    assert_eq!(pictured.as_u64(), Some(count as u64));
    name_selected(&window, "edge").await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), count);
    assert!(standing.values().all(|class| class == "edge"));
    window
        .until(&format!(
            "document.getElementById('legend').textContent.includes('edge · {count}')"
        ))
        .await;
    // One key undoes all answers.
    window.press("u").await;
    saved(&window).await;
    window
        .until("!document.getElementById('legend').textContent.includes('edge')")
        .await;
    assert_eq!(scene.labels.standing().await.len(), 0);
    assert_eq!(scene.labels.entries().await, 2 * count);
    // The t-SNE projection becomes available later.
    window
        .until("!document.querySelector('#projection [value=neighbours]').disabled")
        .await;
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_campaign_begins_from_a_point_of_the_map() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window.until("document.querySelector('.legend li')").await;
    window.click("#examples summary").await;
    let disabled = "document.querySelectorAll('#examples button:disabled').length";
    assert_eq!(window.value(disabled).await, serde_json::json!(3));
    window.focus("#over").await;
    window.press("\u{e014}\u{e007}").await;
    window
        .until("!document.querySelector('#examples button:disabled') && document.getElementById('chosen').textContent.startsWith('Individual ')")
        .await;
    let chosen = window.text("#chosen").await;
    let index = chosen.split([' ', ',']).nth(1).unwrap();
    window.picture("map-point").await;
    window.click("#examples button[value=unlike]").await;
    window
        .until(&format!(
            "location.pathname.startsWith('/campaigns/unlike-') && location.pathname.endsWith('-{index}-2')"
        ))
        .await;
    window.close().await;
    scene.cluster.stop().await;
}

/// Names the class of all selected individuals.
pub async fn name_selected(window: &Window, class: &str) {
    window.press("n").await;
    window.press(class).await;
    window.press("\u{e007}").await;
}

/// Draws a lasso around the visible part of the map; returns the number of selected individuals.
pub async fn lasso_all(window: &Window) -> usize {
    let size = "[document.getElementById('over').clientWidth, document.getElementById('over').clientHeight]";
    let size = window.value(size).await;
    let (width, height) = (size[0].as_f64().unwrap(), size[1].as_f64().unwrap());
    let line = [
        (3.0, 8.0),
        (3.0, height - 3.0),
        (width - 3.0, height - 3.0),
        (width - 3.0, 3.0),
        (3.0, 3.0),
    ];
    window.draw("#over", &line).await;
    window
        .until("/^[0-9,]+ selected/.test(document.getElementById('selected').textContent)")
        .await;
    let message = window.text("#selected").await;
    let count = message.split(' ').next().unwrap().replace(',', "");
    count.parse().unwrap()
}

pub async fn the_map_zooms_hides_and_asks_before_it_replaces() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    // Without answers, the colours show clusters.
    window
        .until("document.getElementById('colouring').value === 'cluster' && document.querySelector('#legend button')")
        .await;
    // The keyboard cursor starts in the middle of the map.
    window.focus("#over").await;
    window.press("\u{e014}").await;
    window.until("!document.getElementById('tip').hidden").await;
    let all = "(async () => (await (await fetch('/campaigns/small-1/points')).json()).count)()";
    let all = window.value(all).await.as_u64().unwrap() as usize;

    // After zooming in, the lasso selects only the visible part.
    for _ in 0..4 {
        window.click("[data-zoom=in]").await;
    }
    let part = lasso_all(&window).await;
    assert!(0 < part && part < all, "{part} of {all}");
    window.press("\u{e00c}").await;
    window.click("[data-zoom=whole]").await;
    assert_eq!(lasso_all(&window).await, all);
    window.press("\u{e00c}").await;

    let few = lasso_ten(&window).await;
    name_selected(&window, "edge").await;
    saved(&window).await;
    // With answers, the colours show classes.
    window
        .until("document.getElementById('colouring').value === 'class'")
        .await;
    lasso_all(&window).await;
    name_selected(&window, "rest").await;
    window.until("document.getElementById('overwrite').open").await;
    let asked = window.text("#overwrite p").await;
    assert!(
        asked.starts_with(&format!("{few} of the {all} selected")),
        "{asked}"
    );
    window.click("#overwrite [value=rest]").await;
    // The dialog closes before the answer is sent.
    window
        .until("document.getElementById('legend').textContent.includes('rest · ')")
        .await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    let of = |class: &str| standing.values().filter(|message| *message == class).count();
    assert_eq!((of("edge"), of("rest")), (few, all - few));

    // Hidden individuals are not selected.
    window
        .until("document.getElementById('legend').textContent.includes('rest · ')")
        .await;
    let hide = "[...document.querySelectorAll('#legend button')].find((of) => of.textContent.startsWith('edge')).click()";
    window.driver.execute(hide, vec![]).await.unwrap();
    window
        .until(&format!(
            "document.getElementById('shown').textContent.startsWith('{} of ')",
            all - few
        ))
        .await;
    assert_eq!(lasso_all(&window).await, all - few);
    window.click("#show-all").await;
    window
        .until(&format!(
            "document.getElementById('shown').textContent === 'All {all} individuals are shown.'"
        ))
        .await;
    window.close().await;
    scene.cluster.stop().await;
}

/// Toggles a class by its entry in the legend.
async fn hide(window: &Window, class: &str) {
    let hide = format!(
        "[...document.querySelectorAll('#legend button')].find((of) => of.textContent.startsWith({class:?})).click()"
    );
    window.driver.execute(hide, vec![]).await.unwrap();
}

pub async fn what_is_hidden_stays_so_when_another_class_goes() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    window.until("document.querySelector('#legend button')").await;
    let few = lasso_ten(&window).await;
    name_selected(&window, "first").await;
    saved(&window).await;
    let all = lasso_all(&window).await;
    name_selected(&window, "second").await;
    window.until("document.getElementById('overwrite').open").await;
    window.click("#overwrite [value=rest]").await;
    saved(&window).await;
    window
        .until("document.getElementById('legend').textContent.includes('second · ')")
        .await;
    hide(&window, "second").await;

    // A picture of the selection keeps the focus when the page renders the pictures again.
    assert_eq!(lasso_all(&window).await, few);
    window.focus("#gallery .card:nth-child(3)").await;
    let told_again = "document.getElementById('from').dispatchEvent(new Event('change'))";
    window.driver.execute(told_again, vec![]).await.unwrap();
    let focused = "document.activeElement === document.querySelector('#gallery .card:nth-child(3)')";
    assert_eq!(window.value(focused).await.as_bool(), Some(true));

    // The class "first" has no individuals any more, and another class takes its place among the classes.
    name_selected(&window, "third").await;
    window.until("document.getElementById('overwrite').open").await;
    window.click("#overwrite [value=all]").await;
    saved(&window).await;
    window
        .until(&format!(
            "document.getElementById('legend').textContent.includes('third · {few}')"
        ))
        .await;
    assert_eq!(lasso_all(&window).await, few, "{few} of {all} are not hidden");
    let hidden =
        "[...document.querySelectorAll('#legend [aria-pressed=false]')].map((of) => of.dataset.value).join()";
    assert_eq!(window.value(hidden).await.as_str(), Some("second"));
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_cluster_is_named_but_for_those_that_differ() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    window
        .until("document.querySelectorAll('.card').length > 3")
        .await;
    let shown = window
        .value("document.querySelectorAll('.card').length")
        .await
        .as_u64()
        .unwrap();
    window.click(".card:nth-child(2)").await;
    window
        .until("document.querySelectorAll('.card[aria-pressed=true]').length === 1")
        .await;
    window.press("n").await;
    window.press("same").await;
    window.press("\u{e007}").await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await.len() as u64, shown - 1);
    // One key undoes all answers.
    window.press("u").await;
    window
        .until(
            "document.getElementById('status').textContent === 'All saved.' && \
                document.querySelectorAll('.card').length > 3",
        )
        .await;
    assert_eq!(scene.labels.standing().await.len(), 0);
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn clusters_are_looked_at_while_the_archive_grows() {
    let driver = Driver::start();
    // With so many generations, the campaign is still running at the end of the test.
    let text = small_spec("")
        .to_toml()
        .replace("generations = 5", "generations = 100000");
    let mut scene = Scene::begun(&CampaignSpec::from_toml(&text).unwrap()).await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    window
        .until("document.querySelectorAll('.card').length > 3")
        .await;
    let first = window.text("#so-far").await;
    window.picture("sheet-running").await;
    // The page does not change while a person works on it.
    window.click(".card:nth-child(2)").await;
    let marked = window
        .value("document.querySelector('.card:nth-child(2)').dataset.index")
        .await;
    window.until("!document.getElementById('fresh').hidden").await;
    let still = window
        .value("document.querySelector('.card[aria-pressed=true]').dataset.index")
        .await;
    assert_eq!(still, marked);
    let alike = window
        .value("document.querySelectorAll('.card[aria-pressed=false]').length")
        .await;
    window.press("n").await;
    window.press("same").await;
    window.press("\u{e007}").await;
    saved(&window).await;
    assert_eq!(Some(scene.labels.standing().await.len() as u64), alike.as_u64());
    window
        .until(&format!(
            "!document.getElementById('so-far').textContent.includes({first:?})"
        ))
        .await;
    let running = scene.cluster.status("latest").await;
    assert_eq!(running.state(), v1::CampaignState::Running, "it ended too early");
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn medoids_are_named_and_the_report_is_taken_away() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = driver.open(&scene.url("/taxonomy")).await;
    window
        .until("document.querySelectorAll('.medoid').length === 4")
        .await;
    // The page does not ask for the name of a visitor who only reads.
    window
        .until("document.querySelector('.medoid .naming input').checkVisibility() && !document.querySelector('dialog[open]')")
        .await;
    window.click(".medoid .naming input").await;
    window.press("milling").await;
    window.press("\u{e007}").await;
    introduce_here(&window, "Ana").await;
    saved(&window).await;
    let index = window
        .value("Number(document.querySelector('.medoid').dataset.index)")
        .await;
    assert_eq!(scene.labels.standing().await[&index.as_u64().unwrap()], "milling");
    window.driver.refresh().await.unwrap();
    window
        .until("document.querySelector('.medoid .naming input').value === 'milling' && document.querySelector('a[href$=\"/contact-sheet.svg\"]')")
        .await;
    window.close().await;

    let url = scene.url("/report");
    let report = murmuration_tests::http::get(url).await.unwrap();
    assert_eq!(
        report.headers()["content-disposition"],
        "attachment; filename=\"small-1.html\""
    );
    let report = report.text().await.unwrap();
    for expected in [
        "into 4 clusters",
        ">milling</span>",
        "milling · 1",
        "download=\"contact-sheet.svg\"",
    ] {
        assert!(report.contains(expected), "{expected}");
    }
    let sheet = murmuration_tests::http::get(scene.url("/contact-sheet.svg"))
        .await
        .unwrap();
    assert_eq!(sheet.headers()["content-type"], "image/svg+xml");
    let sheet = sheet.text().await.unwrap();
    assert_eq!(sheet.matches("viewBox").count(), 5);
    assert!(sheet.contains("milling"), "{sheet}");
    scene.cluster.stop().await;
}
