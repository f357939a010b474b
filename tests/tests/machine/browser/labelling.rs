//! Tests labelling one behaviour at a time, with the keyboard.

use crate::browser::{
    driver::{Driver, Window},
    scene::{LabelClient, Scene, answer, asked, introduce, name, saved},
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::Murmuration;
use serde_json::json;
use std::collections::BTreeSet;

/// A campaign whose world is not square: a page that took its shape from a motion would shift when the motion arrives.
const WIDE: &str = "name = \"small\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
                    [world]\nhorizon = 200\nwidth = 800.0\nheight = 400.0\n\
                    [search]\npopulation = 20\ngenerations = 5\n[taxonomy]\nmedoids = 4\n";

pub async fn thirty_are_labelled_two_undone_and_a_refresh_loses_nothing() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    let mut seen = vec![name(&window, "milling").await, name(&window, "wall").await];
    window
        .until("document.querySelectorAll('.class').length === 2")
        .await;
    for turn in 0..13 {
        seen.push(answer(&window, ["1", "2", "0", "s"][turn % 4]).await);
    }
    // Some of these answers may not be acknowledged yet.
    window.driver.refresh().await.unwrap();
    for _ in 0..15 {
        seen.push(answer(&window, "1").await);
    }
    saved(&window).await;
    assert_eq!(
        seen.iter().collect::<BTreeSet<_>>().len(),
        30,
        "asked twice: {seen:?}"
    );
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), 30);
    assert!(seen.iter().all(|index| standing.contains_key(index)));
    assert_eq!(standing[&seen[1]], "wall");

    // The page asks undone questions again, the last question first.
    for &index in seen[28..].iter().rev() {
        window.press("u").await;
        window
            .until(&format!(
                "document.getElementById('which').textContent === 'Individual {index}'"
            ))
            .await;
    }
    saved(&window).await;
    assert_eq!(scene.labels.standing().await.len(), 28);
    assert_eq!(scene.labels.entries().await, 32);
    assert!(window.text("#count").await.starts_with("28 of 100"));
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn two_who_label_at_once_are_never_asked_the_same() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let ana = scene.visit(&driver, "/label", "Ana").await;
    let ben = scene.visit(&driver, "/label", "Ben").await;
    name(&ana, "milling").await;
    ben.until("document.querySelectorAll('.class').length === 1")
        .await;
    let label = async |window| {
        let mut seen = Vec::new();
        for _ in 0..20 {
            seen.push(answer(window, "1").await);
        }
        saved(window).await;
        seen
    };
    let (first, second) = tokio::join!(label(&ana), label(&ben));
    let both: BTreeSet<_> = first.iter().chain(&second).collect();
    assert_eq!(both.len(), 40, "{first:?} and {second:?}");
    assert_eq!(scene.labels.standing().await.len(), 41);
    ana.close().await;
    ben.close().await;
    scene.cluster.stop().await;
}

pub async fn a_killed_coordinator_loses_no_answer() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let serve = |listen: &str| murmuration.serve(listen, &["--workers", "1"]);
    let (coordinator, url) = serve("127.0.0.1:0");
    let window = driver.open(&format!("{url}/campaigns/small-1/label")).await;
    introduce(&window, "Ana").await;
    let mut seen = vec![name(&window, "milling").await];
    for _ in 0..4 {
        seen.push(answer(&window, "1").await);
    }
    saved(&window).await;
    coordinator.kill();
    // The page has already fetched the next questions.
    for _ in 0..2 {
        seen.push(answer(&window, "1").await);
    }
    window
        .until("document.querySelector('.stale-note').textContent.includes('2 answers are stored in this browser')")
        .await;
    // The coordinator must restart at the same address.
    let (coordinator, again) = serve(url.trim_start_matches("http://"));
    assert_eq!(again, url);
    saved(&window).await;
    seen.push(answer(&window, "1").await);
    saved(&window).await;
    let standing = LabelClient::at(&url).await.standing().await;
    assert_eq!(
        standing.into_keys().collect::<BTreeSet<_>>(),
        seen.into_iter().collect()
    );
    asked(&window).await;
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}

pub async fn a_window_without_its_coordinator_says_so_where_it_is_seen() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let serve = |listen: &str| murmuration.serve(listen, &["--workers", "1"]);
    let (coordinator, url) = serve("127.0.0.1:0");
    let window = driver.open(&format!("{url}/campaigns/small-1/label")).await;
    window.resize(390, 844, false).await;
    introduce(&window, "Ana").await;
    name(&window, "milling").await;
    assert_eq!(
        window.value("document.querySelector('.stale-note').hidden").await,
        true
    );
    coordinator.kill();
    // Answers until the window has no more questions.
    let mut answers = 0;
    while window
        .value("/^Individual/.test(document.getElementById('which').textContent)")
        .await
        == true
    {
        answer(&window, "1").await;
        answers += 1;
    }
    assert!(answers > 0);
    window
        .until("document.getElementById('which').textContent === 'No question available'")
        .await;
    let kept = match answers {
        1 => "1 answer is stored in this browser".to_owned(),
        _ => format!("{answers} answers are stored in this browser"),
    };
    let note = "document.querySelector('.stale-note')";
    window
        .until(&format!("{note}.textContent.includes('{kept}')"))
        .await;
    assert!(
        window
            .text(".stale-note")
            .await
            .starts_with("The coordinator is not responding")
    );
    let place = window
        .value(&format!(
            "(({{ top, bottom }}) => top >= 0 && bottom < innerHeight)({note}.getBoundingClientRect())"
        ))
        .await;
    assert_eq!(place, true, "it is below the fold");
    window.picture("label-silent-390").await;
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    saved(&window).await;
    asked(&window).await;
    window.until(&format!("{note}.hidden")).await;
    assert_eq!(LabelClient::at(&url).await.standing().await.len(), answers + 1);
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}

/// Cuts off the reply to the first answer that a page sends, as if a person left the page before the reply.
const CUT_OFF: &str = "{ \
    const fetched = fetch; \
    let cut = false; \
    globalThis.fetch = (...given) => { \
        if (cut || given[1]?.method !== 'POST' || !String(given[0]).endsWith('/labels')) return fetched(...given); \
        cut = true; \
        const body = new ReadableStream({ start: (stream) => stream.error(new TypeError('cut off')) }); \
        return Promise.resolve(new Response(body, { status: 503 })); }; }";

pub async fn an_answer_whose_reply_is_cut_off_is_sent_again() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/answers", "Ana").await;
    window.before_pages(CUT_OFF).await;
    window.driver.goto(scene.url("/label")).await.unwrap();
    let named = name(&window, "milling").await;
    let standing = scene.labels.standing().await;
    assert_eq!(
        standing.into_iter().collect::<Vec<_>>(),
        [(named, "milling".to_owned())]
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn who_goes_on_after_the_goal_is_told_so() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let many = (0..60).map(|index| (index, "milling".to_owned()));
    scene.labels.say("Ana", many).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    asked(&window).await;
    assert_eq!(window.text("#count").await, "60 of 100 answered by you");
    window.click("summary").await;
    let choose = "const goal = document.getElementById('goal'); goal.value = '50'; goal.dispatchEvent(new Event('change'))";
    window.driver.execute(choose, vec![]).await.unwrap();
    window
        .until(
            "document.getElementById('count').textContent === '60 answered by you, more than the goal of 50'",
        )
        .await;
    assert_eq!(window.value("document.getElementById('share').value").await, 50.0);
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn who_begins_sees_what_others_answered_as_theirs_and_no_empty_frames_before() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.judge(60).await;
    let judged = scene.labels.standing().await;
    let open = (0..100).filter(|index| !judged.contains_key(index));
    let message = open.take(10).map(|index| (index, "milling".to_owned()));
    scene.labels.say("Ben", message).await;
    for page in ["/label", "/sheet"] {
        let window = driver.open(&scene.url(page)).await;
        window.until("!document.getElementById('who').hidden").await;
        let frames = window
            .value("[...document.querySelectorAll('main img, main canvas, main button')].filter((part) => part.checkVisibility()).map((part) => part.textContent)")
            .await;
        assert_eq!(frames, json!(["Begin"]), "{page}");
        window.close().await;
    }
    let window = scene.visit(&driver, "/label", "Ana").await;
    asked(&window).await;
    assert_eq!(window.text("#count").await, "0 of 30 answered by you");
    assert_eq!(
        window.text("#others").await,
        "10 by other annotators, 60 by the rule-based judge only, 30 not answered yet"
    );
    answer(&window, "1").await;
    saved(&window).await;
    window
        .until("document.getElementById('count').textContent === '1 of 30 answered by you'")
        .await;
    window.picture("label-others").await;
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_name_that_was_typed_wrongly_is_exchanged_with_a_button() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    let right = name(&window, "milling").await;
    let wrong = name(&window, "miling").await;
    window.until("!document.querySelector('.near').hidden").await;
    window.picture("label-near").await;
    assert_eq!(window.text("[data-do=instead]").await, "Use “milling” instead");
    window.click("[data-do=instead]").await;
    window.until("document.querySelector('.near').hidden").await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!((&*standing[&right], &*standing[&wrong]), ("milling", "milling"));
    assert_eq!(
        window.value("document.querySelectorAll('.class').length").await,
        1
    );

    // A person can also keep a name that is close to an existing name.
    name(&window, "mixing").await;
    name(&window, "mixings").await;
    window.until("!document.querySelector('.near').hidden").await;
    window.click("[data-do=differ]").await;
    window.until("document.querySelector('.near').hidden").await;
    assert_eq!(
        window.value("document.querySelectorAll('.class').length").await,
        3
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_motion_in_an_oblong_world_moves_nothing_when_it_arrives() {
    let driver = Driver::start();
    let scene = Scene::of(&CampaignSpec::from_toml(WIDE).unwrap()).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    window.note_shifts().await;
    for (width, height) in [(1280, 900), (390, 844)] {
        // The test starts from an empty page, so that shifts because of the new screen size are not recorded.
        window.driver.goto("about:blank").await.unwrap();
        window.resize(width, height, false).await;
        window.driver.goto(scene.url("/label")).await.unwrap();
        asked(&window).await;
        window.until("document.querySelector('.scrub').value > 40").await;
        window.picture(&format!("label-oblong-{width}")).await;
        assert_eq!(window.shifts().await, json!([]), "at {width}");
    }
    window.close().await;
    scene.cluster.stop().await;
}

/// Sets the annotator's name from another page of the same browser.
async fn rename_elsewhere(window: &Window, name: &str) {
    let script = format!(
        "const other = document.createElement('iframe'); document.body.append(other); \
         other.contentWindow.localStorage.setItem('murmuration.annotator', '{name}'); other.remove()"
    );
    window.driver.execute(script, vec![]).await.unwrap();
}

pub async fn a_name_that_is_given_on_another_page_holds_here() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = driver.open(&scene.url("/label")).await;
    window.until("!document.getElementById('who').hidden").await;
    // If the annotator's name was given on another page, this page does not ask for it.
    rename_elsewhere(&window, "Ana").await;
    window.until("document.getElementById('who').hidden").await;
    name(&window, "milling").await;
    // After the name changes on another page, this page answers under the new name.
    rename_elsewhere(&window, "Ben").await;
    window
        .until("document.getElementById('annotator').value === 'Ben'")
        .await;
    window
        .until("document.getElementById('others').textContent.startsWith('1 by other annotators')")
        .await;
    name(&window, "ring").await;
    window
        .until("document.getElementById('count').textContent.startsWith('1 of 99')")
        .await;
    window.close().await;
    scene.cluster.stop().await;
}
