//! Comparing behaviours: which of two is more like a third.

use crate::browser::{
    driver::{Driver, Window},
    looks::{DRAWN, check},
    scene::Scene,
};
use murmuration_proto::{CampaignSpec, v1};
use murmuration_tests::Murmuration;
use serde_json::json;
use std::collections::BTreeSet;

/// A world that is no square: a page that took its shape from a motion would move when the motion arrives.
const WIDE: &str = "name = \"small\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n\
                    [world]\nhorizon = 200\nwidth = 800.0\nheight = 400.0\n\
                    [search]\npopulation = 20\ngenerations = 5\n[taxonomy]\nmedoids = 4\n";

/// A wide screen, the same in the dark, and a phone.
const SCREENS: [(u32, u32, bool); 3] = [(1280, 900, false), (1280, 900, true), (390, 844, false)];

/// Answers, each with the key or the button that gives it.
const ANSWERS: [(v1::Preference, &str); 6] = [
    (v1::Preference::Left, "\u{e012}"),
    (v1::Preference::Right, "\u{e014}"),
    (v1::Preference::Neither, "\u{e015}"),
    (v1::Preference::Left, "[data-preference=left]"),
    (v1::Preference::Right, "[data-preference=right]"),
    (v1::Preference::Neither, "[data-preference=neither]"),
];

/// Waits until the page asks a question and counts so many comparisons by the annotator; what it asks.
pub async fn asked_after(window: &Window, own: usize) -> String {
    let noun = if own == 1 { "comparison" } else { "comparisons" };
    window
        .until(&format!(
            "document.getElementById('count').textContent === '{own} {noun} by you' \
             && document.getElementById('question').textContent.startsWith('Is individual ')"
        ))
        .await;
    window.text("#question").await
}

/// What the page asks where it asks about this triple.
fn in_words(triple: v1::Triple) -> String {
    let v1::Triple {
        reference,
        left,
        right,
    } = triple;
    format!("Is individual {left} or individual {right} more like individual {reference}?")
}

pub async fn behaviours_are_compared_by_key_and_click_and_the_log_holds_what_the_page_counts() {
    let driver = Driver::start();
    let mut scene = Scene::of(&CampaignSpec::from_toml(WIDE).unwrap()).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    window.note_shifts().await;
    window.click("nav a[href$='/comparisons']").await;
    let mut seen = vec![asked_after(&window, 0).await];
    for (place, (_, how)) in ANSWERS.into_iter().enumerate() {
        if how.starts_with('[') {
            window.click(how).await;
        } else {
            window.press(how).await;
        }
        seen.push(asked_after(&window, place + 1).await);
    }
    assert_eq!(
        seen.iter().collect::<BTreeSet<_>>().len(),
        7,
        "asked twice: {seen:?}"
    );
    let standing = scene.labels.compared().await;
    let said: Vec<i32> = standing.iter().map(|comparison| comparison.preference).collect();
    assert_eq!(said, ANSWERS.map(|(preference, _)| preference as i32));
    let asked: Vec<String> = standing
        .iter()
        .map(|comparison| in_words(comparison.triple.unwrap()))
        .collect();
    assert_eq!(asked, seen[..6]);

    // A pointer leaves no focus behind: Space pauses, and does not answer again.
    window.press(" ").await;
    window
        .until("document.getElementById('rest').ariaPressed === 'true'")
        .await;
    assert_eq!(asked_after(&window, 6).await, seen[6]);

    // What is withdrawn is asked again, the last one first.
    window.press("u").await;
    assert_eq!(asked_after(&window, 5).await, seen[5]);
    window.click("#undo").await;
    assert_eq!(asked_after(&window, 4).await, seen[4]);
    assert_eq!(scene.labels.compared().await, standing[..4]);

    // A reload loses nothing, nor what is not acknowledged yet.
    window.driver.refresh().await.unwrap();
    assert_eq!(asked_after(&window, 4).await, seen[4]);
    window.press("\u{e014}").await;
    window.driver.refresh().await.unwrap();
    assert_eq!(asked_after(&window, 5).await, seen[5]);
    assert_eq!(scene.labels.compared().await.len(), 5);
    // Six answers, two withdrawals, and one more answer, each once.
    assert_eq!(scene.labels.entries().await, 9);

    for (width, height, dark) in SCREENS {
        // From an empty page, so that nothing is noted that moves because the screen became another one.
        window.driver.goto("about:blank").await.unwrap();
        window.resize(width, height, dark).await;
        window.driver.goto(scene.url("/comparisons")).await.unwrap();
        assert_eq!(asked_after(&window, 5).await, seen[5]);
        window.until(DRAWN).await;
        let scheme = if dark { "dark" } else { "light" };
        window
            .picture(&format!("comparisons-oblong-{width}-{scheme}"))
            .await;
        check(&window, "comparisons").await;
        assert_eq!(window.shifts().await, json!([]), "at {width}, {scheme}");
    }
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn who_compares_sees_how_many_are_by_others_and_withdraws_none_of_theirs() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let ana = scene.visit(&driver, "/comparisons", "Ana").await;
    for (place, (_, key)) in ANSWERS[..2].iter().enumerate() {
        asked_after(&ana, place).await;
        ana.press(key).await;
    }
    let open = asked_after(&ana, 2).await;
    let ben = scene.visit(&driver, "/comparisons", "Ben").await;
    asked_after(&ben, 0).await;
    assert_eq!(ben.text("#others").await, "2 by others");
    assert_eq!(
        ben.value("document.getElementById('undo').disabled").await,
        json!(true)
    );
    ben.press("u").await;
    ben.until("document.getElementById('status').textContent.includes('Ben has no comparison to withdraw')")
        .await;
    assert_eq!(scene.labels.compared().await.len(), 2);

    // Under another name it is that person's question which is asked, and that person's comparisons which are counted.
    let rename = "const name = document.getElementById('annotator'); name.value = 'Ana'; name.dispatchEvent(new Event('change'))";
    ben.driver.execute(rename, vec![]).await.unwrap();
    assert_eq!(asked_after(&ben, 2).await, open);
    assert_eq!(ben.text("#others").await, "0 by others");
    ana.close().await;
    ben.close().await;
    scene.cluster.stop().await;
}

pub async fn several_comparisons_are_withdrawn_at_once_and_asked_again() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/comparisons", "Ana").await;
    let mut seen = vec![asked_after(&window, 0).await];
    assert_eq!(
        window.value("document.getElementById('several').disabled").await,
        json!(true)
    );
    for (place, key) in ["\u{e012}", "\u{e014}", "\u{e015}", "\u{e012}"]
        .into_iter()
        .enumerate()
    {
        window.press(key).await;
        seen.push(asked_after(&window, place + 1).await);
    }
    window.click("#several").await;
    window.until("document.getElementById('withdraw').open").await;
    // More than there are is refused with the limit.
    window.press("9").await;
    window
        .until("document.getElementById('effect').textContent === 'You have 4 comparisons: choose a number from 1 to 4.'")
        .await;
    window.press("\u{e003}3").await;
    window
        .until("document.getElementById('effect').textContent.startsWith('Your last 3 comparisons will no longer count')")
        .await;
    window.picture("comparisons-withdraw").await;
    check(&window, "comparisons").await;
    window.press("\u{e007}").await;
    assert_eq!(asked_after(&window, 1).await, seen[1]);
    assert_eq!(scene.labels.compared().await.len(), 1);
    // They come again in their order.
    for (place, seen) in seen.iter().enumerate().take(4).skip(1) {
        assert_eq!(&asked_after(&window, place).await, seen);
        window.press("\u{e014}").await;
    }
    asked_after(&window, 4).await;
    window.close().await;
    scene.cluster.stop().await;
}

/// Gives a name on another page of the same browser.
async fn rename_elsewhere(window: &Window, name: &str) {
    let script = format!(
        "const other = document.createElement('iframe'); document.body.append(other); \
         other.contentWindow.localStorage.setItem('murmuration.annotator', '{name}'); other.remove()"
    );
    window.driver.execute(script, vec![]).await.unwrap();
}

pub async fn without_a_coordinator_buttons_do_not_look_as_if_they_answered() {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let murmuration = Murmuration::with_campaign(folder.path());
    let serve = |listen: &str| murmuration.serve(listen, &["--workers", "1"]);
    let (coordinator, url) = serve("127.0.0.1:0");
    let window = driver.open(&format!("{url}/campaigns/small-1/comparisons")).await;
    // Who is known on another page is asked no more.
    window.until("!document.getElementById('who').hidden").await;
    rename_elsewhere(&window, "Ana").await;
    asked_after(&window, 0).await;
    // Under a name that was changed there, nothing is answered here as somebody else.
    rename_elsewhere(&window, "Ben").await;
    window
        .until("document.getElementById('annotator').value === 'Ben'")
        .await;
    let all_are = |disabled: bool| {
        format!(
            "[...document.querySelectorAll('[data-preference]')].every((button) => button.ariaDisabled === '{disabled}')"
        )
    };
    window.until(&all_are(false)).await;
    let first = asked_after(&window, 0).await;

    coordinator.kill();
    window.press("\u{e012}").await;
    window.until(&all_are(true)).await;
    window.until("!document.getElementById('undo').disabled").await;
    window.press("u").await;
    window
        .until("document.querySelector('.stale-note').textContent.includes('1 answer and 1 withdrawal are stored in this browser')")
        .await;

    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    assert_eq!(asked_after(&window, 0).await, first);
    window.until(&all_are(false)).await;
    let all_is_well = "document.querySelector('.stale-note').hidden && document.getElementById('status').textContent === 'All saved.'";
    window.until(all_is_well).await;

    // A page that cannot ask complains, and takes that back.
    coordinator.kill();
    rename_elsewhere(&window, "Cyd").await;
    window.until("document.querySelector('#status.wrong')").await;
    let (coordinator, _) = serve(url.trim_start_matches("http://"));
    window.until(&all_are(false)).await;
    window
        .until(&format!("{all_is_well} && !document.querySelector('.wrong')"))
        .await;
    window.close().await;
    assert_eq!(coordinator.terminate(), Some(0));
}
