//! Tests the pages of studies, and the atlas of a campaign.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
    scene::{Scene, introduce_here},
};
use murmuration_model::study_records::StudyRecordKind;
use murmuration_store::Store;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, Murmuration};
use std::path::Path;

const STUDY: &str = "name = \"pair\"\nseeds = 2\nmeasures = [\"behaviours\", \"shares\"]\n\
    behaviours.generations = 2\n\
    axes = [{ name = \"filter\", values = [{ name = \"no\" }, { name = \"yes\", campaign.filter = true }] }]\n\
    [campaign]\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\nevaluation.judge = true\n\
    world = { horizon = 200, agents = 6 }\nsearch = { population = 20, generations = 3 }\ntaxonomy.medoids = 4\n";

/// Runs the study `text` on the coordinator of the data directory.
async fn run(data: &Path, text: &str) {
    let file = data.join("pair.toml");
    std::fs::write(&file, text).unwrap();
    let murmuration = Murmuration::over(data);
    let file = file.display().to_string();
    let run = tokio::task::spawn_blocking(move || murmuration.run(&["lab", "study", "run", &file]));
    let run = run.await.unwrap();
    assert_eq!(run.code, Some(0), "{}", run.stderr);
}

/// Number of cells in a state.
async fn cells(window: &Window, state: &str) -> u64 {
    let count = format!("document.querySelectorAll('.cells [data-state={state}]').length");
    window.value(&count).await.as_u64().unwrap()
}

pub async fn a_study_is_watched_while_it_runs_and_its_medoids_are_judged_again() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 2).await;
    let window = driver.open(&format!("{}/studies", cluster.url())).await;
    assert!(window.text("main").await.contains("There are no studies"));
    // The study first runs with one seed, which creates the study's page. The cells of the second seed arrive while the page is
    // open.
    run(folder.path(), &STUDY.replace("seeds = 2", "seeds = 1")).await;
    window.driver.refresh().await.unwrap();
    window.click(".campaigns a").await;
    window
        .until("document.querySelectorAll('.cells tbody tr').length === 2")
        .await;
    assert_eq!(cells(&window, "done").await, 2);
    window
        .until("document.querySelectorAll('#tables table').length === 2")
        .await;

    let page = "document.querySelector('#tables').textContent";
    let spread =
        "[...document.querySelectorAll('#tables td')].some((cell) => cell.textContent.includes('±'))";
    assert_eq!(window.value(spread).await, false);
    run(folder.path(), STUDY).await;
    window
        .until("document.querySelectorAll('.cells [data-state=done]').length === 4")
        .await;
    // The page shows the spread of two replicates without a reload.
    window.until(spread).await;
    let campaign = "document.querySelector('.cells a').getAttribute('href')";
    assert_eq!(window.value(campaign).await, "/campaigns/pair-1");

    // A person gives classes to the medoids that the judge has named.
    window.driver.refresh().await.unwrap();
    window.click("#judging summary").await;
    window
        .until("document.querySelectorAll('.rejudged li').length === 4")
        .await;
    window.click(".rejudged .stage").await;
    // The medoid's player is in view.
    let seen = "(({ top, bottom }) => top >= 0 && bottom <= innerHeight)(document.querySelector('#judging .player').getBoundingClientRect())";
    window.until(seen).await;
    window
        .until("/^step [1-9]/.test(document.querySelector('#judging .step').textContent)")
        .await;
    let chosen = "[data-class=nested_cycle]";
    window.click(&format!(".rejudged {chosen}")).await;
    introduce_here(&window, "Ana").await;
    window
        .until("document.querySelector('.rejudged .by').textContent === 'Ana'")
        .await;
    window
        .until(&format!(
            "document.querySelector('.rejudged {chosen}').getAttribute('aria-pressed') === 'true'"
        ))
        .await;
    window
        .until(&format!(
            "/Judged by: the rule-based judge; 1 of \\d+ medoids by Ana/.test({page})"
        ))
        .await;
    let (store, _) = Store::look(folder.path(), false).unwrap();
    let kept = store.study_content("pair", StudyRecordKind::Classes, "");
    let kept = String::from_utf8(kept.unwrap().unwrap()).unwrap();
    drop(store);
    let row = kept.lines().nth(1).unwrap();
    assert!(row.ends_with(",nested_cycle,Ana"), "{kept}");
    // The tables of the command line contain the person's class too.
    let murmuration = Murmuration::over(folder.path());
    let report = tokio::task::spawn_blocking(move || murmuration.run(&["lab", "study", "report", "pair"]));
    assert_eq!(report.await.unwrap().code, Some(0));
    let report = std::fs::read_to_string(folder.path().join("studies/pair/report.html")).unwrap();
    assert!(report.contains("medoids by Ana."));

    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("study-{width}-{scheme}")).await;
            check(&window, "study").await;
        }
    }
    // The test restores the judge's class.
    window.click(".rejudged [data-class='']").await;
    window
        .until("document.querySelector('.rejudged .by').textContent === 'judge'")
        .await;
    window.click("a.site[href='/studies']").await;
    window
        .until("document.querySelector('.campaigns progress')")
        .await;
    window.picture("studies").await;
    check(&window, "studies").await;
    window.close().await;
    cluster.stop().await;
}

/// When the atlas of a swarm with more robots exists, a slider switches between the atlases. The slider keeps the zoom and the
/// chosen controller.
async fn another_atlas(scene: &mut Scene, window: &Window, spec: &str) {
    assert_eq!(
        window.value("document.querySelectorAll('.others').length").await,
        0
    );
    let more = CampaignSpec::from_toml(&spec.replace("agents = 6", "agents = 12")).unwrap();
    scene.cluster.create(&more).await;
    scene.cluster.finish("latest").await;
    window.driver.refresh().await.unwrap();
    let chosen = "document.querySelectorAll('#chosen tr').length >= 4";
    for (from, to, key) in [(6, 12, "\u{e014}"), (12, 6, "\u{e012}")] {
        window
            .until("document.querySelectorAll('#classes li').length > 1")
            .await;
        window.focus("#map").await;
        if from == 6 {
            window.press("+\u{e007}").await;
            window.until(chosen).await;
        }
        window.focus(".others [name=robots]").await;
        window.press(key).await;
        let there = if to == 12 { "small-2" } else { "small-1" };
        window
            .until(&format!(
                "location.pathname === '/campaigns/{there}/atlas' && Math.abs(new URLSearchParams(location.hash.slice(1)).get('zoom') - 1.5) < 1e-6 \
                 && document.querySelector('.others output').textContent === '{to}' && {chosen}"
            ))
            .await;
    }
    window.driver.goto(scene.url("/atlas")).await.unwrap();
    window
        .until("document.querySelectorAll('#classes li').length > 1")
        .await;
}

pub async fn a_controller_of_an_atlas_is_chosen_and_its_motion_plays() {
    let driver = Driver::start();
    let spec = "name = \"small\"\nmodel = \"single-sensor\"\nmethod = \"exhaustive\"\ncontrollers.step = 0.5\n\
                world = { horizon = 200, agents = 6 }\ntaxonomy.medoids = 4\n";
    let mut scene = Scene::of(&CampaignSpec::from_toml(spec).unwrap()).await;
    let window = driver.open(&scene.url("")).await;
    window.click("nav a[href$='/taxonomy']").await;
    window.click("nav.parts a[href$='/atlas']").await;
    window
        .until("document.querySelectorAll('#classes li').length > 1")
        .await;
    // Resizing the page before a controller is chosen sends no request.
    window.value("dispatchEvent(new Event('resize'))").await;
    // Keys alone choose the controller in the middle of the map, and the controller to its right.
    window.focus("#map").await;
    window.press("\u{e007}").await;
    let playing = "document.querySelector('.player .stage').ariaBusy === 'false' && \
                   /^step [1-9]/.test(document.querySelector('.player .step').textContent)";
    window.until(playing).await;
    let refused = "performance.getEntriesByType('resource').filter(({ name, responseStatus }) => \
                   name.endsWith('/pieces') && responseStatus !== 200).length";
    assert_eq!(window.value(refused).await, 0);
    let genes = "[...document.querySelectorAll('#chosen tr')].slice(0, 4).map((row) => row.lastChild.textContent).join()";
    let middle = window.value(genes).await;
    assert_eq!(middle, "0,0,0,0");
    window.press("\u{e014}").await;
    window.until(&format!("{genes} === '0,0,0.5,0'")).await;
    window.until(playing).await;
    // While the whole map is shown, the page loads only the pictures of chosen controllers.
    let picture = "document.querySelector('#chosen canvas')";
    window.until(&format!("{picture} && !{picture}.hidden")).await;
    let light = format!(
        "new Uint32Array({picture}.getContext('2d').getImageData(0, 0, {picture}.width, {picture}.height).data.buffer) \
         .some((pixel) => (pixel & 0xffffff) !== 0)"
    );
    assert_eq!(window.value(&light).await, true);
    let pictures = "performance.getEntriesByType('resource').filter(({ name }) => /individuals\\/\\d+\\?created=/.test(name)).length";
    let few = window.value(pictures).await.as_u64();
    assert!(few.is_some_and(|few| (1..=2).contains(&few)), "{few:?}");
    // After zooming in, the page loads the pictures of all visible controllers.
    window.press("++").await;
    window.until(&format!("{pictures} > 20")).await;
    window.picture("atlas-close-up").await;
    window.press("--").await;
    // Space pauses the motion, and Escape deselects the controller.
    window.press(" ").await;
    window
        .until("!document.querySelector('.player .toggle').classList.contains('playing')")
        .await;
    window.press("\u{e00c}").await;
    another_atlas(&mut scene, &window, spec).await;
    // The pointer chooses the upper left corner, which has the smallest first speed and the largest second speed.
    let corner = "(() => { const { clientWidth: w, clientHeight: h } = document.getElementById('map'); \
                  const side = Math.min(w, h); return [(w - side) / 2 + side / 50, (h - side) / 2 + side / 50]; })()";
    let corner = window.value(corner).await;
    let [x, y] = [0, 1].map(|axis| corner[axis].as_f64().unwrap());
    window.draw("#map", &[(x, y)]).await;
    window.until(&format!("{genes} === '-1,1,-1,1'")).await;
    window
        .until("document.querySelector('.player .toggle').classList.contains('playing')")
        .await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("atlas-{width}-{scheme}")).await;
            check(&window, "atlas").await;
        }
    }
    window.close().await;
    scene.cluster.stop().await;
}
