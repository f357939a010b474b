//! Tests the report on paper.

use crate::browser::{driver::Driver, scene::Scene};
use serde_json::{Value, json};

/// Script: the positions of the pins as fractions of the map, and how far the map is distorted from the shape in which it was
/// drawn.
const PINS: &str = "(() => { \
    const space = document.getElementById('space'); \
    const map = space.getBoundingClientRect(); \
    const stretched = (map.width / map.height) / (space.width / space.height) - 1; \
    const pins = [...document.querySelectorAll('.pin')].map((pin) => { \
        const box = pin.getBoundingClientRect(); \
        return [((box.left + box.right) / 2 - map.left) / map.width, ((box.top + box.bottom) / 2 - map.top) / map.height]; \
    }); \
    return { stretched, pins: pins.flat(), width: map.width }; })()";

fn pins(places: &Value) -> Vec<f64> {
    let places = places["pins"].as_array().unwrap().iter();
    places.map(|place| place.as_f64().unwrap()).collect()
}

pub async fn pins_stay_with_their_medoids_when_the_report_is_laid_out_for_paper() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.report(&driver).await;
    window
        .until("document.querySelectorAll('.pin').length === 4")
        .await;
    window.print(true).await;
    // A browser lays the page out for printing, and then narrows it to the width of a sheet, without an event for scripts.
    let drawn = "(() => { const space = document.getElementById('space'); \
                 return space.width === Math.round(space.clientWidth * devicePixelRatio); })()";
    window.until(drawn).await;
    let before = window.value(PINS).await;
    let narrow = "document.querySelector('main').style.width = '640px'";
    window.driver.execute(narrow, vec![]).await.unwrap();
    window
        .until("document.getElementById('space').clientWidth < 640")
        .await;
    let after = window.value(PINS).await;
    assert_eq!(pins(&before).len(), 8);
    for (before, after) in pins(&before).into_iter().zip(pins(&after)) {
        assert!((before - after).abs() < 0.003, "{before} became {after}");
    }
    let stretched = after["stretched"].as_f64().unwrap();
    assert!(stretched.abs() < 0.01, "the points are stretched by {stretched}");
    window.picture("report-printed").await;

    // Printed pages are light.
    window.print(false).await;
    window.resize(1280, 900, true).await;
    let corner = "[...document.getElementById('space').getContext('2d').getImageData(1, 1, 1, 1).data]";
    window.until(&format!("{corner}[0] < 60")).await;
    window.print(true).await;
    window.until(&format!("{corner}[0] === 255")).await;
    assert_eq!(window.value(corner).await, json!([255, 255, 255, 255]));
    window.close().await;
    scene.cluster.stop().await;
}
