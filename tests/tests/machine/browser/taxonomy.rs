//! Tests the page Taxonomy: merging and separating behaviours, simulating them from further starts, and comparing taxonomies
//! before and after learning.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
    scene::{Scene, saved},
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::small_latent_spec;
use serde_json::json;

const FEEDBACK: &str = "[feedback]\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";

/// A campaign with so many clusters that some clusters are adjacent.
fn spec() -> CampaignSpec {
    let text = small_latent_spec(FEEDBACK).to_toml();
    let text = text.replace("medoids = 4", "medoids = 20");
    let text = text.replace("\"coverage\"", "\"medoids\"");
    CampaignSpec::from_toml(&text.replace("population = 20", "population = 100")).unwrap()
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

pub async fn behaviours_are_merged_tried_learned_from_and_compared() {
    let driver = Driver::start();
    let mut scene = Scene::of(&spec()).await;
    let window = scene.visit(&driver, "/taxonomy", "Ana").await;
    window
        .until("document.querySelectorAll('.medoid').length === 20")
        .await;
    // The judge's verdict is on each card, in grey with a question mark, and becomes a name with a click. What is random or of a kind
    // that is shown already is folded.
    window
        .until("[...document.querySelectorAll('.medoid .unsure')].filter((name) => /\\?$/.test(name.textContent)).length === 20")
        .await;
    window
        .until("/^\\d+ more: /.test(document.querySelector('.others-shown summary').textContent) && document.querySelector('.findings')")
        .await;
    look(&window, "taxonomy-first").await;
    let word = window
        .value("document.querySelector('.medoid .naming').dataset.suggested")
        .await;
    window.click(".medoid .naming button").await;
    saved(&window).await;
    let first = window
        .value("Number(document.querySelector('.medoid').dataset.index)")
        .await;
    let first = first.as_u64().unwrap();
    let as_label = |word: &str| word.replace(' ', "_");
    assert_eq!(
        as_label(&scene.labels.standing().await[&first]),
        as_label(word.as_str().unwrap())
    );

    // Two adjacent clusters become one behaviour with one name, until a person undoes the merge.
    let pairs = window.value("document.querySelectorAll('.merge').length").await;
    assert!(pairs.as_u64().unwrap() > 0, "no clusters touch");
    look(&window, "taxonomy-alike").await;
    let labels = scene.labels.standing().await.len();
    let named = "const field = document.querySelector('.merge input'); field.value = ''; field.focus()";
    window.driver.execute(named, vec![]).await.unwrap();
    window.press("ring\u{e007}").await;
    window
        .until("document.querySelector('.merged h2').textContent === 'ring'")
        .await;
    assert_eq!(
        window
            .value("document.querySelectorAll('.merged .medoid').length")
            .await,
        2
    );
    let names = scene.labels.standing().await;
    assert_eq!(names.values().filter(|name| *name == "ring").count(), 2);
    look(&window, "taxonomy-merged").await;
    window.click("[data-do=undo]").await;
    window
        .until("!document.querySelector('.merged') && document.querySelector('.merge')")
        .await;
    window
        .until("document.getElementById('status').textContent === 'Your last answer is undone.'")
        .await;
    assert_eq!(scene.labels.standing().await.len(), labels);

    // A dialog shows twenty further starts.
    window.click(".medoid .more summary").await;
    look(&window, "taxonomy-card").await;
    window.click(".further").await;
    window
        .until(
            "/\\d+ of 20 starts/.test(document.querySelector('dialog[open] .verdicts').textContent) \
             && document.querySelectorAll('dialog[open] .starts img').length === 20",
        )
        .await;
    window
        .until("[...document.querySelectorAll('.starts img')].every((image) => image.complete && image.naturalWidth)")
        .await;
    look(&window, "taxonomy-starts").await;
    window.press("\u{e00c}").await;
    window
        .until("!document.querySelector('dialog[open]') && document.activeElement.matches('.further')")
        .await;

    // The page shows twelve further behaviours, which it did not show before.
    window.click("#more a.button").await;
    window
        .until("document.querySelectorAll('#more .medoid').length === 12 && location.search === '?more=12'")
        .await;
    let shown = "new Set([...document.querySelectorAll('.medoid')].map(({ dataset }) => dataset.index)).size \
                 === document.querySelectorAll('.medoid').length";
    assert_eq!(window.value(shown).await, json!(true));
    look(&window, "taxonomy-more").await;

    // Five clusters get names, the campaign learns, and the page shows what became of these clusters.
    window.click(".others-shown summary").await;
    for place in 1..=5 {
        let card = format!(".others-shown .medoids > li:nth-child({place}) .naming input");
        let empty = format!("document.querySelector({card:?}).value = ''");
        window.driver.execute(empty, vec![]).await.unwrap();
        window.click(&card).await;
        window.press(&format!("kind {place}\u{e007}")).await;
        saved(&window).await;
    }
    window.driver.goto(scene.url("/map")).await.unwrap();
    window.click(".learn button").await;
    window.click("dialog.ask [value=yes]").await;
    window
        .until("document.getElementById('legend')?.textContent.includes('unnamed · 594')")
        .await;
    window.driver.goto(scene.url("/taxonomy")).await.unwrap();
    window
        .until("document.querySelector('.versions [aria-current]').textContent.startsWith('Version 2')")
        .await;
    window
        .until("document.querySelector('.uncarried') || document.body.textContent.includes('Carried over from behaviour')")
        .await;
    look(&window, "taxonomy-learned").await;
    window.click("a[href$='/taxonomy/changes']").await;
    window
        .until("document.querySelectorAll('.version-map circle').length === 40")
        .await;
    look(&window, "taxonomy-changes").await;
    window.close().await;
    scene.cluster.stop().await;
}
