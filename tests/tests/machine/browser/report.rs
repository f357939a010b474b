//! The report as a file, without a coordinator.

use crate::browser::{axe::check_barriers, driver::Driver, scene::Scene};
use serde_json::json;

/// The first card: how it is, whether its button offers to pause, and the step.
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

pub async fn a_pointer_on_the_map_tells_what_is_there() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.report(&driver).await;
    scene.cluster.stop().await;
    window
        .until("document.querySelectorAll('.pin').length === 4")
        .await;
    // The medoids' points are where their leaders end, and no pin lies over them.
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
    // What is not of that cluster is faded.
    let faded = "document.querySelectorAll('.pin.faded').length";
    assert_eq!(window.value(faded).await, json!(3));
    // Each card shows on a small map where its cluster lies.
    let blank = "[...document.querySelectorAll('canvas.where')].filter((small) => \
                 !new Uint32Array(small.getContext('2d').getImageData(0, 0, small.width, small.height).data.buffer).some(Boolean)).length";
    assert_eq!(window.value(blank).await, json!(0));
    let pins = "[...document.querySelectorAll('.pin')].map(({ style }) => style.left + style.top).join()";
    let before = window.value(pins).await;
    window.click("[data-zoom='in']").await;
    window.until(&format!("{pins} !== {before}")).await;
    window.click("[data-zoom='whole']").await;
    window.until(&format!("{pins} === {before}")).await;
    window.close().await;
}
