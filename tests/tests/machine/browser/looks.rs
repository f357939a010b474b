//! Tests the appearance of pages: screenshots, and automatic checks.

use crate::browser::{
    axe::check_barriers,
    driver::{Driver, Window},
    scene::{Scene, answer, asked, name, saved},
};
use serde_json::json;

/// Finds texts whose contrast with their background is below WCAG AA (4.5, or 3 for large texts).
const FAINT: &str = include_str!("contrast.js");

pub const SIZES: [(u32, u32); 2] = [(1280, 900), (390, 844)];

pub async fn every_page_is_readable_wide_and_narrow_light_and_dark() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "milling").await;
    name(&window, "wall following").await;
    name(&window, "dispersal").await;
    for turn in 0..20 {
        answer(&window, ["1", "2", "3"][turn % 3]).await;
    }
    saved(&window).await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            for (page, ready) in PAGES {
                window.driver.goto(scene.url(page)).await.unwrap();
                window.until(ready).await;
                let name = page.trim_start_matches('/');
                let name = if name.is_empty() { "progress" } else { name };
                window.picture(&format!("{name}-{width}-{scheme}")).await;
                check(&window, name).await;
            }
            window.driver.goto(scene.cluster.url()).await.unwrap();
            window.picture(&format!("campaigns-{width}-{scheme}")).await;
            check(&window, "campaigns").await;
        }
    }
    window.driver.goto(scene.url("/label")).await.unwrap();
    asked(&window).await;
    window.close().await;
    scene.cluster.stop().await;
}

/// Sizes of a page on a screen of 1280 pixels at 200 %, and at 400 %.
const ZOOMED: [(u32, u32); 2] = [(640, 450), (320, 225)];

pub async fn long_names_many_classes_and_large_type_stay_within_the_page() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let class = |place: u64| match place % 12 {
        0 => "x".repeat(64),
        other => format!("class {other}"),
    };
    scene
        .labels
        .say("Ben", (0..60).map(|place| (place, class(place))))
        .await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    for (width, height) in SIZES.into_iter().chain(ZOOMED) {
        window.resize(width, height, false).await;
        for (page, ready) in PAGES {
            window.driver.goto(scene.url(page)).await.unwrap();
            window
                .until(&ready.replace("length === 4", "length === 13"))
                .await;
            let name = page.trim_start_matches('/');
            let name = if name.is_empty() { "progress" } else { name };
            window.picture(&format!("{name}-{width}-crowded")).await;
            check(&window, name).await;
            assert_eq!(window.value(OUTSIDE).await, json!([]), "{name} at {width}");
            // The page shows only keys that work.
            let keys = "[...document.querySelectorAll('.class kbd')].map((key) => key.textContent).join('')";
            let shown = window.value(keys).await;
            let teaches = ["label", "sheet", "map", "answers"].contains(&name);
            assert_eq!(shown, json!(if teaches { "123456789abc" } else { "" }), "{name}");
        }
    }
    window.close().await;
    scene.cluster.stop().await;
}

/// Finds words of class names that are broken across lines although the palette is wide enough.
const BROKEN: &str = "[...document.querySelectorAll('.class .name')].flatMap((name) => { \
    const text = name.firstChild; \
    return [...text.data.matchAll(/[^ -]+/g)].filter(({ 0: word, index }) => { \
        const range = document.createRange(); \
        range.setStart(text, index); \
        range.setEnd(text, index + word.length); \
        return new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size > 1; \
    }).map(([word]) => word); })";

pub async fn a_word_of_a_class_is_not_broken() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let classes = [
        "dispersal",
        "wall following",
        "synchronisation",
        "cyclic pursuit",
        "aggregation",
    ];
    let message = (0..).zip(classes).map(|(index, class)| (index, class.to_owned()));
    scene.labels.say("Ben", message).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    for (width, height) in SIZES.into_iter().chain(ZOOMED) {
        window.resize(width, height, false).await;
        for page in ["/label", "/sheet", "/map"] {
            window.driver.goto(scene.url(page)).await.unwrap();
            window
                .until("document.querySelectorAll('.class').length === 5")
                .await;
            assert_eq!(window.value(BROKEN).await, json!([]), "{page} at {width}");
        }
    }
    window.close().await;
    scene.cluster.stop().await;
}

/// Finds controls that extend beyond their player.
const OUTSIDE: &str = "[...document.querySelectorAll('.transport > *')].filter((part) => { \
    const [own, player] = [part, part.closest('.player, .film')].map((one) => one.getBoundingClientRect()); \
    return part.checkVisibility() && (own.left < player.left - 1 || own.right > player.right + 1); }).map((part) => part.outerHTML)";

const PAGES: [(&str, &str); 7] = [
    ("", "document.querySelector('.behaviour img').complete"),
    ("/label", "document.querySelector('.scrub').value > 40"),
    (
        "/sheet",
        "[...document.querySelectorAll('.card img')].some((image) => image.naturalWidth > 0)",
    ),
    (
        "/map",
        "!document.querySelector('#projection [value=neighbours]').disabled && document.querySelectorAll('.legend li').length === 4",
    ),
    (
        "/answers",
        "[...document.querySelectorAll('.answer img')].some((image) => image.naturalWidth > 0)",
    ),
    (
        "/classes",
        "[...document.querySelectorAll('.samples img')].some((image) => image.naturalWidth > 0)",
    ),
    (
        "/taxonomy",
        "[...document.querySelectorAll('.medoid img')].every((image) => image.complete || image.loading === 'lazy')",
    ),
];

/// Checks that a page fits the screen's width, is readable, and has no accessibility barriers.
pub async fn check(window: &Window, page: &str) {
    let over = window
        .value("document.documentElement.scrollWidth - document.documentElement.clientWidth")
        .await;
    assert_eq!(over, json!(0), "{page} is wider than the screen");
    let faint = window.value(FAINT).await;
    assert_eq!(faint, json!([]), "{page} has texts that are hard to read");
    check_barriers(window, page).await;
}
