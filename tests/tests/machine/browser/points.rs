//! Tests how the map draws its points: with a graphics card if the machine has one, otherwise with the script.

use crate::browser::{
    driver::{Driver, Window},
    scene::Scene,
};
use serde_json::json;

/// Hides from the page that Chromium's graphics card is an emulation.
const CARD: &str = "const ask = WebGL2RenderingContext.prototype.getExtension; \
    WebGL2RenderingContext.prototype.getExtension = function (name) { \
        return name === 'WEBGL_debug_renderer_info' ? { UNMASKED_RENDERER_WEBGL: this.VERSION } : ask.call(this, name); \
    };";

/// Script: the number of pixels of the map that points cover, at least in part.
const COVERED: &str = "(() => { \
    document.querySelector('[data-zoom=whole]').click(); \
    return new Promise((resolve) => requestAnimationFrame(() => { \
        const canvas = document.getElementById('points'); \
        const { width, height } = canvas; \
        const pen = new OffscreenCanvas(width, height).getContext('2d'); \
        pen.drawImage(canvas, 0, 0); \
        const pixels = new Uint32Array(pen.getImageData(0, 0, width, height).data.buffer); \
        resolve(pixels.filter((pixel) => pixel !== pixels[0]).length); \
    })); })()";

/// Number of covered pixels of the map. Checks that the map is drawn by the method `drawn`.
async fn covered(window: &Window, drawn: &str) -> f64 {
    window.until("document.querySelector('#legend button')").await;
    let way = window
        .value("document.getElementById('points').dataset.drawn")
        .await;
    assert_eq!(way, json!(drawn));
    window.value(COVERED).await.as_f64().unwrap()
}

pub async fn a_card_draws_the_points_as_the_script_does() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/map", "Ana").await;
    let by_script = covered(&window, "canvas").await;
    window.before_pages(CARD).await;
    window.driver.refresh().await.unwrap();
    let by_card = covered(&window, "webgl").await;
    assert!(by_script > 500.0, "{by_script}");
    assert!(
        (by_card / by_script - 1.0).abs() < 0.2,
        "{by_card} and {by_script}"
    );
    window.picture("map-by-card").await;
    window.close().await;
    scene.cluster.stop().await;
}
