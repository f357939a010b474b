//! Tests the report as a file, without a coordinator.

use crate::browser::{
    axe::check_barriers,
    driver::{Driver, Window},
    scene::Scene,
};
use serde_json::json;

/// Scripts that read the mode of the first card, the label of its button, and its step.
const MODE: &str = "document.querySelector('.card').dataset.mode";
const BUTTON: &str = "document.querySelector('.card .toggle').ariaLabel";
const STEP: &str = "Number(document.querySelector('.card .scrub').value)";

pub async fn a_card_plays_pauses_and_rests_by_keyboard_in_a_file() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.report(&driver).await;
    scene.cluster.stop().await;
    window
        .until("document.documentElement.classList.contains('scripts')")
        .await;
    assert_eq!(window.value(MODE).await, json!("still"));
    assert_eq!(window.text(".card .step").await, "200 steps");

    window.focus(".card").await;
    window.until(&format!("{MODE} === 'preview' && {STEP} > 5")).await;
    window.press(" ").await;
    window.until(&format!("{MODE} === 'paused'")).await;
    assert_eq!(window.value(BUTTON).await, json!("Play behaviour 1"));
    let step = window.value(STEP).await;
    assert_eq!(window.text(".card .step").await, format!("{step} / 200"));
    window.press(" ").await;
    window
        .until(&format!("{MODE} === 'playing' && {STEP} !== {step}"))
        .await;
    assert_eq!(window.value(BUTTON).await, json!("Pause behaviour 1"));
    window.focus(".card .scrub").await;
    window.press("\u{e011}").await;
    window
        .until(&format!("{MODE} === 'paused' && {STEP} === 0"))
        .await;
    window.focus(".card").await;
    window.press("\u{e00c}").await;
    window.until(&format!("{MODE} === 'still'")).await;

    let playing =
        "[...document.querySelectorAll('.card')].filter((card) => card.dataset.mode === 'playing').length";
    window.click("#play-all").await;
    window.until(&format!("{playing} === 4 && {STEP} > 5")).await;
    for (width, height, dark) in [(1280, 900, false), (1280, 900, true), (390, 844, true)] {
        window.resize(width, height, dark).await;
        let space = "document.getElementById('space')";
        window
            .until(&format!("{space}.width === {space}.clientWidth"))
            .await;
        let scheme = if dark { "dark" } else { "light" };
        window.picture(&format!("report-{width}-{scheme}")).await;
        let over = "document.documentElement.scrollWidth - document.documentElement.clientWidth";
        assert_eq!(
            window.value(over).await,
            json!(0),
            "the report is wider than {width}"
        );
    }
    window.click("#play-all").await;
    window.until(&format!("{playing} === 0")).await;
    assert_eq!(window.value(MODE).await, json!("still"));
    for (width, height, dark) in [(1280, 900, false), (1280, 900, true), (390, 844, true)] {
        window.resize(width, height, dark).await;
        check_barriers(&window, &format!("the report at {width}")).await;
    }
    window.close().await;
}

/// A script that returns whether a canvas contains the picture of a swarm.
fn drawn(canvas: &str) -> String {
    format!(
        "(() => {{ const canvas = document.querySelector('{canvas}'); const {{ width, height }} = canvas; \
         const pixels = new Uint32Array(canvas.getContext('2d').getImageData(0, 0, width, height).data.buffer); \
         return width === window.murmuration.pictures.side && pixels.some((pixel) => (pixel & 0xffffff) !== 0); }})()"
    )
}

/// Script: the commands that replay behaviour 1 and the opened individual, without the names of files.
const COMMANDS: &str = "['behaviour-1', 'chosen'].map((id) => \
    [...document.getElementById(id).querySelectorAll('.copyable .line')].map((line) => line.textContent) \
    .find((line) => line.startsWith('murmuration simulate')).split(' --gif ')[0])";

/// Tests the keys of the map: zoom, and moving from point to point.
async fn keys_of_the_map(window: &Window) {
    let pins = "[...document.querySelectorAll('.pin')].map(({ style }) => style.left + style.top).join()";
    let before = window.value(pins).await;
    window.focus("#space").await;
    window.press("+").await;
    window.until(&format!("{pins} !== {before}")).await;
    window.press("\u{e011}").await;
    window.until(&format!("{pins} === {before}")).await;
    window.press("\u{e014}").await;
    window.until("!document.getElementById('tip').hidden").await;
    let first = window.text("#tip .lines div").await;
    window.press("\u{e014}").await;
    window
        .until(&format!(
            "document.querySelector('#tip .lines div').textContent !== {first:?}"
        ))
        .await;
    window.press("\u{e007}").await;
    window.until("document.activeElement.id === 'chosen-title'").await;
    check_barriers(window, "the report with an individual opened").await;
    window.press("\u{e00c}").await;
    window
        .until("document.getElementById('chosen').hidden && document.activeElement.id === 'space'")
        .await;
}

pub async fn plots_tell_their_values_at_a_pointer_and_by_keys() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.report(&driver).await;
    scene.cluster.stop().await;
    let told = "#novelty .told";
    window.focus("#novelty .plot").await;
    window.press("\u{e011}").await;
    let first = window.text(told).await;
    assert!(
        first.starts_with("Generation 0: best ") && first.contains(" · mean "),
        "{first}"
    );
    let data = "JSON.parse(document.querySelector('#novelty .plot').dataset.plot)";
    let best = window.value(&format!("{data}.lines[0].values[0]")).await;
    let message = first
        .split(' ')
        .nth(3)
        .and_then(|message| message.parse::<f64>().ok());
    let off = message
        .zip(best.as_f64())
        .map(|(message, best)| (message - best).abs() / best);
    assert!(off.is_some_and(|off| off < 1e-3), "{first} for {best}");
    window.press("\u{e014}").await;
    window
        .until(&format!(
            "document.querySelector('{told}').textContent.startsWith('Generation 1: ')"
        ))
        .await;
    // The last generation is at the right edge, with a dot on its line.
    let last = window.value(&format!("{data}.x.at(-1)")).await;
    let width = window
        .value("document.querySelector('#novelty .plot .wide').clientWidth")
        .await;
    let right = width.as_f64().unwrap() - 5.0;
    window
        .draw("#novelty .plot .wide", &[(right - 40.0, 60.0), (right, 60.0)])
        .await;
    window
        .until(&format!(
            "document.querySelector('{told}').textContent.startsWith('Generation {last}: ') \
             && document.querySelector('#novelty .wide .mark .dot-1').checkVisibility()"
        ))
        .await;
    window.close().await;
}

pub async fn a_pointer_on_the_map_tells_what_is_there() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.report(&driver).await;
    scene.cluster.stop().await;
    window
        .until("document.querySelectorAll('.pin').length === 4")
        .await;
    // The medoids' points are at the ends of their leader lines, and no pin covers them.
    let place = "(() => { const { archive, equalScale } = window.murmuration; \
                 const space = document.getElementById('space'); \
                 const { clientWidth, clientHeight } = space; \
                 const scale = equalScale(archive.spans, clientWidth, clientHeight, Math.min(34, clientWidth / 14)); \
                 const i = archive.medoids[0]; \
                 return [scale.across(archive.x[i]), scale.down(archive.y[i]), archive.index[i]]; })()";
    let found = window.value(place).await;
    let (x, y) = (found[0].as_f64().unwrap(), found[1].as_f64().unwrap());
    window.draw("#space", &[(x - 30.0, y - 30.0), (x, y)]).await;
    window.until("!document.getElementById('tip').hidden").await;
    let told = window.text("#tip").await;
    let expected = format!("Individual {} · behaviour 1", found[2]);
    assert!(told.starts_with(&expected), "{told} is not of {expected}");
    window.until(&drawn("#tip canvas")).await;
    // The map fades the pins of other clusters.
    let faded = "document.querySelectorAll('.pin.faded').length";
    assert_eq!(window.value(faded).await, json!(3));
    window.draw("#space", &[(x, y)]).await;
    window.until("!document.getElementById('chosen').hidden").await;
    window.until(&drawn("#chosen canvas")).await;
    let commands = window.value(COMMANDS).await;
    assert_eq!(
        commands[0], commands[1],
        "the first medoid is replayed as on its card"
    );
    window.picture("report-opened").await;
    window.press("\u{e00c}").await;
    window.until("document.getElementById('chosen').hidden").await;
    // A small map on each card shows the place of its cluster.
    let blank = "[...document.querySelectorAll('canvas.where')].filter((small) => \
                 !new Uint32Array(small.getContext('2d').getImageData(0, 0, small.width, small.height).data.buffer).some(Boolean)).length";
    assert_eq!(window.value(blank).await, json!(0));
    let pins = "[...document.querySelectorAll('.pin')].map(({ style }) => style.left + style.top).join()";
    let before = window.value(pins).await;
    window.click("[data-zoom='in']").await;
    window.until(&format!("{pins} !== {before}")).await;
    window.click("[data-zoom='whole']").await;
    window.until(&format!("{pins} === {before}")).await;
    keys_of_the_map(&window).await;
    window.close().await;
}
