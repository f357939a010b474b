//! Labelling many behaviours at once: with a lasso on the map, on the contact sheet, and by naming medoids.

use crate::browser::{
    driver::{Driver, Window},
    scene::{Scene, saved},
};
use murmuration_proto::{CampaignSpec, v1};
use murmuration_tests::small_spec;

/// Across the canvas, where the points lie; what the script makes of the columns that it is sent.
const ACROSS: &str = "(async () => { \
    const { x, spans } = await (await fetch('/campaigns/small-1/points/axes')).json(); \
    const bytes = Uint8Array.from(atob(x), (c) => c.charCodeAt(0)); \
    const { clientWidth, clientHeight } = document.getElementById('over'); \
    const room = 2 * Math.min(34, clientWidth / 14); \
    const unit = Math.min((clientWidth - room) / spans[0], (clientHeight - room) / spans[1]); \
    return [clientWidth, clientHeight, Array.from(new Uint16Array(bytes.buffer), \
        (x) => clientWidth / 2 + (x / 65535 - 0.5) * spans[0] * unit)]; })()";

/// Draws around ten points of the map, or a few more where there is no room between two; how many.
async fn lasso_ten(window: &Window) -> usize {
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
    // Within the round corners.
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
    window.press("n").await;
    window.press("edge").await;
    window.press("\u{e007}").await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), count);
    assert!(standing.values().all(|class| class == "edge"));
    window
        .until(&format!(
            "document.getElementById('legend').textContent.includes('edge · {count}')"
        ))
        .await;
    // One key undoes all of it.
    window.press("u").await;
    saved(&window).await;
    window
        .until("!document.getElementById('legend').textContent.includes('edge')")
        .await;
    assert_eq!(scene.labels.standing().await.len(), 0);
    assert_eq!(scene.labels.entries().await, 2 * count);
    // t-SNE comes when it is ready.
    window
        .until("!document.querySelector('#projection [value=neighbours]').disabled")
        .await;
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
    // One key undoes all of it.
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
    // Far more than is waited for.
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
    // Nothing changes while a person works on the page.
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
    let window = scene.visit(&driver, "/taxonomy", "Ana").await;
    window
        .until("document.querySelectorAll('.medoid').length === 4")
        .await;
    window.click(".medoid:first-of-type input").await;
    window.press("milling").await;
    window.press("\u{e007}").await;
    saved(&window).await;
    let index = window
        .value("Number(document.querySelector('.medoid').dataset.index)")
        .await;
    assert_eq!(scene.labels.standing().await[&index.as_u64().unwrap()], "milling");
    window.driver.refresh().await.unwrap();
    window
        .until("document.querySelector('.medoid input').value === 'milling'")
        .await;
    window.close().await;

    let url = scene.url("/report");
    let report = reqwest::get(url).await.unwrap();
    assert_eq!(
        report.headers()["content-disposition"],
        "attachment; filename=\"small-1.html\""
    );
    let report = report.text().await.unwrap();
    for said in ["into 4 clusters", ">milling</span>", "milling · 1"] {
        assert!(report.contains(said), "{said}");
    }
    scene.cluster.stop().await;
}
