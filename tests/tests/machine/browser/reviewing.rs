//! Tests classes and their keys, and the review of answers.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
    scene::{Scene, answer, introduce_to_offers, saved},
};
use serde_json::json;

/// Script: the sum of the layout shifts that do not follow an interaction, as browsers compute this sum.
const SHIFTED: &str = "new Promise((told) => { let sum = 0; \
    new PerformanceObserver((list) => { for (const one of list.getEntries()) if (!one.hadRecentInput) sum += one.value; }) \
        .observe({ type: 'layout-shift', buffered: true }); \
    setTimeout(() => told(sum), 400); })";

/// Script: the number of pixels of a canvas that have a strong colour.
const COLOURFUL: &str = "(() => { const { width, height } = document.getElementById('paths'); \
    const { data } = document.getElementById('paths').getContext('2d').getImageData(0, 0, width, height); \
    let count = 0; \
    for (let i = 0; i < data.length; i += 4) { \
        const [most, least] = [Math.max(data[i], data[i + 1], data[i + 2]), Math.min(data[i], data[i + 1], data[i + 2])]; \
        if (data[i + 3] > 60 && most - least > 60) count++; } \
    return count; })()";

pub async fn the_papers_classes_are_offered_and_keys_can_be_chosen() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = driver.open(&scene.url("/label")).await;
    introduce_to_offers(&window, "Ana").await;
    let offers = "[...document.querySelectorAll('.offer')].map((one) => one.textContent).join()";
    assert_eq!(
        window.value(offers).await,
        "1cyclic pursuit,2milling,3aggregation,4dispersal,5wall following,6random"
    );
    // The paths are drawn in the robots' colours.
    window.until(&format!("{COLOURFUL} > 30")).await;
    for (width, height) in SIZES {
        window.resize(width, height, false).await;
        window.picture(&format!("label-offers-{width}")).await;
        check(&window, "label").await;
    }
    window.resize(1280, 900, false).await;
    let second = answer(&window, "2").await;
    let fifth = answer(&window, "5").await;
    saved(&window).await;
    let classes = "[...document.querySelectorAll('.class')].map((one) => one.textContent).join()";
    window
        .until(&format!("{classes} === '2milling1,5wall following1'"))
        .await;
    let standing = scene.labels.standing().await;
    assert_eq!(
        (&*standing[&second], &*standing[&fifth]),
        ("milling", "wall_following")
    );
    assert_eq!(
        window.value("document.querySelectorAll('.offer').length").await,
        4
    );
    window.click("[data-do=own]").await;
    window.until("!document.querySelector('.offer')").await;

    // A person chooses another key for a class.
    window.driver.goto(scene.url("/classes")).await.unwrap();
    choose(&window, "shortcut milling", "w").await;
    window.click("#agree").await;
    window
        .until("document.querySelector('.class-row kbd')?.textContent === 'w'")
        .await;
    window.driver.goto(scene.url("/label")).await.unwrap();
    let other = answer(&window, "w").await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await[&other], "milling");
    window.close().await;
    scene.cluster.stop().await;
}

/// Opens the dialog of a class and chooses a value.
async fn choose(window: &Window, act: &str, value: &str) {
    begin(window, act).await;
    let set = format!(
        "const field = document.querySelector('#change .field :is(input, select)'); field.value = '{value}'; \
         field.dispatchEvent(new Event('input', {{ bubbles: true }}))"
    );
    window.driver.execute(&set, vec![]).await.unwrap();
}

async fn begin(window: &Window, act: &str) {
    let button = format!("[data-act=\"{act}\"]");
    window.until(&format!("document.querySelector('{button}')")).await;
    window.click(&button).await;
    window.until("document.getElementById('change').open").await;
}

pub async fn every_page_with_keys_lists_them() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.say("Ben", [(0, "ring".to_owned())]).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    for page in ["/label", "/sheet", "/map", "/answers", "/taxonomy", "/classes"] {
        window.driver.goto(scene.url(page)).await.unwrap();
        window
            .until("document.querySelector('.class, .class-row, .medoid') && document.querySelector('[data-do=keys]')")
            .await;
        window.press("?").await;
        window.until("document.getElementById('keys').open").await;
        let listed = window.text("#keys").await;
        assert!(listed.contains("show these keys"), "{page}: {listed}");
        // Keys pressed while the list of keys is open are not answers.
        window.press("1").await;
        if page == "/label" {
            window.picture("keys").await;
        }
        window.press("\u{e00c}").await;
        window.until("!document.getElementById('keys').open").await;
    }
    assert_eq!(scene.labels.standing().await.len(), 1);
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn answers_are_looked_through_changed_and_withdrawn() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let message = |from: u64, to: u64, class: &str| {
        (from..to)
            .map(|index| (index, class.to_owned()))
            .collect::<Vec<_>>()
    };
    scene.labels.say("Ben", message(0, 4, "ring")).await;
    scene
        .labels
        .say("Ana", [message(2, 8, "ring"), message(8, 10, "clump")].concat())
        .await;
    let window = scene.visit(&driver, "/answers", "Ana").await;
    window
        .until("document.querySelectorAll('.answer').length === 12")
        .await;
    let menu = |id: &str, value: &str| {
        format!(
            "const menu = document.getElementById('{id}'); menu.value = '{value}'; menu.dispatchEvent(new Event('change'))"
        )
    };
    window.driver.execute(&menu("by", "Ben"), vec![]).await.unwrap();
    window
        .until("document.querySelectorAll('.answer').length === 4")
        .await;
    window.driver.execute(&menu("by", "Ana"), vec![]).await.unwrap();
    window
        .driver
        .execute(&menu("given", "ring"), vec![])
        .await
        .unwrap();
    window
        .until("document.querySelectorAll('.answer').length === 6")
        .await;

    // A person changes several of their own answers, after a confirmation.
    window.click("#all").await;
    window.until("document.getElementById('selected').textContent.startsWith('6 answers selected, 6 of them yours')").await;
    let key = "[...document.querySelectorAll('.class')].find((one) => one.dataset.answer === 'clump').querySelector('kbd').textContent";
    let key = window.value(key).await;
    window.press(key.as_str().unwrap()).await;
    window.until("document.getElementById('confirm').open").await;
    assert!(
        window
            .text("#confirm p")
            .await
            .contains("You have already answered 6 of the 6 selected behaviours differently")
    );
    window.click("#confirm [value='']").await;
    assert_eq!(scene.labels.entries().await, 12);
    window.press(key.as_str().unwrap()).await;
    window.until("document.getElementById('confirm').open").await;
    window.click("#confirm [value=yes]").await;
    saved(&window).await;
    // No answers match the menus any more.
    window
        .until("document.querySelectorAll('.answer').length === 0")
        .await;

    // A person withdraws their own answer at once, and cannot withdraw another person's answer.
    window.driver.execute(&menu("given", ""), vec![]).await.unwrap();
    window.driver.execute(&menu("by", ""), vec![]).await.unwrap();
    window
        .until("document.querySelectorAll('.answer').length === 12")
        .await;
    window.click("[data-key='9 Ana']").await;
    window.press("\u{e017}").await;
    window
        .until("document.querySelectorAll('.answer').length === 11")
        .await;
    saved(&window).await;
    window.click("[data-key='0 Ben']").await;
    window.until("document.getElementById('withdraw').disabled").await;
    window.press("\u{e017}").await;
    window
        .until("document.getElementById('status').textContent.includes('only your own')")
        .await;
    let standing = scene.labels.standing().await;
    assert_eq!((standing.len(), standing.contains_key(&9)), (9, false));
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn classes_are_changed_after_it_was_said_what_that_does() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene
        .labels
        .say("Ben", (0..4).map(|index| (index, "ring".to_owned())))
        .await;
    scene
        .labels
        .say(
            "Cem",
            (4..6)
                .map(|index| (index, "ring".to_owned()))
                .chain([(7, "clump".to_owned())]),
        )
        .await;
    let window = scene.visit(&driver, "/classes", "Ana").await;
    choose(&window, "rename ring", "wheel").await;
    assert_eq!(
        window.text("#effect").await,
        "6 answers (by Ben, Cem) will be called “wheel”."
    );
    window.picture("classes-rename").await;
    window.click("#agree").await;
    window
        .until("document.querySelector('.class-row h2').textContent === 'wheel'")
        .await;
    choose(&window, "colour wheel", "#123456").await;
    window.click("#agree").await;
    window
        .until("document.getElementById('changes').textContent.includes('the colour #123456')")
        .await;
    choose(&window, "merge clump", "wheel").await;
    assert!(
        window
            .text("#effect")
            .await
            .starts_with("1 answer (by Cem) will be called “wheel”, like the 6 answers")
    );
    window.click("#agree").await;
    window
        .until("document.querySelectorAll('.class-row').length === 1")
        .await;
    assert_eq!(scene.labels.standing().await[&7], "wheel");
    begin(&window, "delete wheel").await;
    assert!(
        window
            .text("#effect")
            .await
            .starts_with("7 answers (by Ben, Cem) will no longer count")
    );
    for (width, height) in SIZES {
        window.resize(width, height, true).await;
        window.picture(&format!("classes-delete-{width}")).await;
    }
    window.resize(1280, 900, false).await;
    window.click("#agree").await;
    window.until("!document.querySelector('.class-row')").await;
    assert_eq!(scene.labels.standing().await.len(), 0);

    // A person undoes the changes one after the other.
    window.click("#revert").await;
    window
        .until("document.querySelectorAll('.class-row').length === 1")
        .await;
    window
        .until("document.getElementById('changes').textContent.includes('merged “clump” into “wheel”')")
        .await;
    window.click("#revert").await;
    window
        .until("document.querySelectorAll('.class-row').length === 2")
        .await;
    let standing = scene.labels.standing().await;
    assert_eq!(
        (standing.len(), &*standing[&7], &*standing[&0]),
        (7, "clump", "wheel")
    );
    // The log has 7 answers, 4 changes of classes, and 2 undone changes.
    assert_eq!(scene.labels.entries().await, 7 + 4 + 2);
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn who_names_on_the_map_first_stays_where_they_are_and_sees_a_part() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene
        .labels
        .say("Ben", (0..5).map(|index| (index, "ring".to_owned())))
        .await;
    let window = driver.open(&scene.url("/map")).await;
    window.until("document.querySelector('#legend button')").await;
    window.driver.execute("scrollTo(0, 150)", vec![]).await.unwrap();
    let line = [(3.0, 8.0), (3.0, 500.0), (600.0, 500.0), (600.0, 3.0), (3.0, 3.0)];
    window.draw("#over", &line).await;
    window
        .until("/^[0-9,]+ selected/.test(document.getElementById('selected').textContent)")
        .await;
    window.press("n").await;
    window.press("wall").await;
    let before = window.value("scrollY").await;
    window.press("\u{e007}").await;
    window
        .until("document.querySelector('dialog.introduction').open")
        .await;
    window.press("Ana").await;
    window.press("\u{e007}").await;
    window
        .until("!document.querySelector('dialog.introduction').open")
        .await;
    assert_eq!(window.value("scrollY").await, before);
    // Some individuals have a class already.
    window.until("document.getElementById('overwrite').open").await;
    window.click("#overwrite [value=rest]").await;
    saved(&window).await;
    assert!(scene.labels.standing().await.len() > 5);

    let choose = |id: &str, value: &str| {
        format!(
            "const menu = document.getElementById('{id}'); menu.value = '{value}'; menu.dispatchEvent(new Event('change'))"
        )
    };
    window
        .until("document.querySelector('#answered-by [value=Ben]')")
        .await;
    window
        .driver
        .execute(&choose("answered-by", "Ben"), vec![])
        .await
        .unwrap();
    window
        .until("document.getElementById('shown').textContent.startsWith('5 of 100')")
        .await;
    window
        .driver
        .execute(&choose("answered-by", ""), vec![])
        .await
        .unwrap();
    window
        .driver
        .execute(&choose("of-cluster", "0"), vec![])
        .await
        .unwrap();
    let size = "document.querySelector('#of-cluster [value=\"0\"]').textContent.match(/\\((\\d+)\\)/)[1]";
    window
        .until(&format!(
            "document.getElementById('shown').textContent.startsWith({size} + ' of 100')"
        ))
        .await;
    window.click("#show-all").await;
    window
        .until("document.getElementById('shown').textContent === 'All 100 individuals are shown.'")
        .await;
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn the_motion_stays_in_view_beside_a_long_sheet() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene
        .labels
        .say("Ben", (0..30).map(|index| (index, format!("class {index}"))))
        .await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    for (width, height) in [(1280, 600), (390, 600)] {
        window.resize(width, height, false).await;
        window
            .until("document.querySelectorAll('.card').length > 3")
            .await;
        for to in [
            "0",
            "document.querySelector('#sheet').getBoundingClientRect().bottom + scrollY - innerHeight",
        ] {
            window
                .driver
                .execute(format!("scrollTo(0, {to})"), vec![])
                .await
                .unwrap();
            let shown = window
                .value("(({ top, bottom }) => top >= -1 && bottom <= innerHeight + 1)(document.querySelector('.stage').getBoundingClientRect())")
                .await;
            if width == 390 || to != "0" {
                assert_eq!(shown, json!(true), "at {width} scrolled to {to}");
            }
        }
        window.picture(&format!("sheet-long-{width}")).await;
    }
    for page in ["/label", "/sheet", "/answers", "/classes"] {
        window.resize(1280, 900, false).await;
        window.driver.goto(scene.url(page)).await.unwrap();
        window.until("document.querySelector('.class, .class-row')").await;
        let shifted = window.value(SHIFTED).await.as_f64().unwrap();
        assert!(shifted < 0.05, "{page} moves by {shifted}");
    }
    window.close().await;
    scene.cluster.stop().await;
}
