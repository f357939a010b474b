//! Tests which keys the page handles while a control has the focus.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
    scene::{Scene, answer, asked, name, saved},
};
use serde_json::json;

pub async fn answers_are_given_from_any_menu_and_box_and_these_keep_their_own_keys() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "milling").await;
    name(&window, "wall").await;
    window.click("summary").await;
    let mut seen = Vec::new();
    for control in [
        ".speed",
        "#strategy",
        "#goal",
        "#agreement",
        ".scrub",
        ".toggle",
        "summary",
    ] {
        window.focus(control).await;
        for key in ["2", "s", "0", "1"] {
            seen.push(answer(&window, key).await);
        }
        let focused = format!("document.activeElement === document.querySelector('{control}')");
        assert_eq!(
            window.value(&focused).await,
            json!(true),
            "{control} lost the focus"
        );
    }
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(standing.len(), 2 + seen.len());
    assert_eq!(
        (standing[&seen[0]].as_str(), standing[&seen[3]].as_str()),
        ("wall", "milling")
    );
    let chosen = "[document.querySelector('.speed').value, document.querySelector('#goal').value]";
    assert_eq!(window.value(chosen).await, json!(["4", "200"]));

    // A control that handles a key handles it once, and the page ignores the key.
    window.focus("#agreement").await;
    window.press(" ").await;
    window.until("document.querySelector('#agreement').checked").await;
    window.press(" ").await;
    window
        .until("!document.querySelector('#agreement').checked")
        .await;
    window.focus(".speed").await;
    window.press("\u{e015}").await;
    window
        .until("document.querySelector('.speed').value === '8'")
        .await;
    asked(&window).await;
    let plays = "document.querySelector('.toggle').classList.contains('playing')";
    window.until(plays).await;
    window.focus(".toggle").await;
    window.press(" ").await;
    window.until(&format!("!{plays}")).await;

    // A clicked control does not keep the focus. Ana is the only annotator, so there is no answer to agree with.
    window.click("#agreement").await;
    window
        .until("document.getElementById('which').textContent === 'No questions left'")
        .await;
    window.press(" ").await;
    window.until(plays).await;
    assert_eq!(
        window.value("document.querySelector('#agreement').checked").await,
        json!(true)
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_class_keeps_its_key_when_another_goes() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.say("Ben", [(3, "ring".to_owned())]).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    name(&window, "wall").await;
    let keys = "[...document.querySelectorAll('.class')].map((one) => one.textContent).join(' ')";
    window.until(&format!("{keys} === '1ring1 2wall1'")).await;
    // A class without answers disappears from the palette.
    scene.labels.undo("Ben").await;
    window.until(&format!("{keys} === '2wall1'")).await;
    let wall = answer(&window, "2").await;
    name(&window, "dispersal").await;
    window.until(&format!("{keys} === '2wall2 1dispersal1'")).await;
    let dispersal = answer(&window, "1").await;
    saved(&window).await;
    let standing = scene.labels.standing().await;
    assert_eq!(
        (standing[&wall].as_str(), standing[&dispersal].as_str()),
        ("wall", "dispersal")
    );
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn an_arrow_on_the_sheet_moves_the_motion_or_goes_to_another_cluster_never_both() {
    let driver = Driver::start();
    let scene = Scene::set().await;
    let window = scene.visit(&driver, "/sheet", "Ana").await;
    window
        .until("document.querySelectorAll('.card').length > 3")
        .await;
    window.focus(".card").await;
    window.until("!document.querySelector('.scrub').disabled").await;
    window.press("\u{e014}").await;
    window
        .until("document.querySelector('#cluster').value === '1'")
        .await;
    window.focus(".scrub").await;
    let before = window
        .value("Number(document.querySelector('.scrub').value)")
        .await;
    window.press("\u{e014}\u{e014}").await;
    window
        .until(&format!(
            "Number(document.querySelector('.scrub').value) !== {before}"
        ))
        .await;
    assert_eq!(
        window.value("document.querySelector('#cluster').value").await,
        json!("1")
    );
    window.close().await;
    scene.cluster.stop().await;
}

/// Opens the list of keys, and starts changing the key of an action.
async fn change(window: &Window, action: &str) {
    if window.value("document.getElementById('keys').open").await == json!(false) {
        window.press("?").await;
        window.until("document.getElementById('keys').open").await;
    }
    window
        .click(&format!("[data-of='{action}'] [data-do=choose]"))
        .await;
}

async fn expect_message(window: &Window, text: &str) {
    window
        .until(&format!(
            "document.getElementById('keys-message').textContent.includes({text:?})"
        ))
        .await;
}

async fn close(window: &Window) {
    window.press("\u{e00c}").await;
    window.until("!document.getElementById('keys').open").await;
}

pub async fn keys_of_actions_are_chosen_and_a_clash_is_said() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.say("Ben", [(3, "ring".to_owned())]).await;
    let window = scene.visit(&driver, "/label", "Ana").await;
    let undo = "document.querySelector('[data-do=undo] kbd').textContent";

    // The page refuses keys of another action or of a class, and keys that browsers need.
    change(&window, "undo").await;
    window.press("s").await;
    expect_message(&window, "s is taken: skip the behaviour").await;
    window.press("1").await;
    expect_message(&window, "1 names the class “ring”").await;
    window.press("\u{e007}").await;
    expect_message(&window, "Enter cannot be chosen").await;
    // Escape cancels the change, and the list stays open.
    window.press("\u{e00c}").await;
    expect_message(&window, "Nothing was changed").await;
    assert_eq!(
        window.value("document.getElementById('keys').open").await,
        json!(true)
    );
    assert_eq!(window.value(undo).await, json!("u"));
    change(&window, "undo").await;
    window.press(",").await;
    expect_message(&window, ",: undo your last answer").await;
    // While a person chooses a key, controls ignore key presses. A key that no action has any more can be given to another
    // action.
    change(&window, "skip").await;
    window.press("u").await;
    expect_message(&window, "u: skip the behaviour").await;
    change(&window, "play").await;
    window.press("p").await;
    expect_message(&window, "p: play or pause").await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("keys-chosen-{width}-{scheme}")).await;
            check(&window, "keys").await;
        }
    }
    window.resize(1280, 900, false).await;
    close(&window).await;
    // The buttons show the chosen keys, and the keys work.
    let marks =
        "[...document.querySelectorAll('.palette [data-action]')].map((mark) => mark.textContent).join()";
    assert_eq!(window.value(marks).await, json!("n,0,u,,"));
    let index = answer(&window, "1").await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await[&index], "ring");
    window.press(",").await;
    saved(&window).await;
    window
        .until("document.querySelector('.class .labels').textContent === '1'")
        .await;
    let skipped = answer(&window, "u").await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await[&skipped], "skip");
    let plays = "document.querySelector('.toggle').classList.contains('playing')";
    window.until(plays).await;
    window.press(" ").await;
    window.press("p").await;
    window.until(&format!("!{plays}")).await;

    // The chosen keys work on every page, and after a reload. No class gets a chosen key automatically.
    scene
        .labels
        .say("Cem", (10..40).map(|index| (index, format!("class {index}"))))
        .await;
    window.driver.goto(scene.url("/sheet")).await.unwrap();
    window
        .until("document.querySelectorAll('.class').length === 31")
        .await;
    assert_eq!(window.value(undo).await, json!(","));
    let class_with_p = "[...document.querySelectorAll('.class kbd')].some((key) => key.textContent === 'p')";
    assert_eq!(window.value(class_with_p).await, json!(false));

    // A class takes an action's key if a person gives the key to the class. The list of keys shows this.
    window.driver.goto(scene.url("/classes")).await.unwrap();
    window
        .until("document.querySelector('[data-act=\"shortcut ring\"]')")
        .await;
    window.click("[data-act='shortcut ring']").await;
    let give = "const field = document.querySelector('#change .field select'); field.value = 'p'; \
                field.dispatchEvent(new Event('input', { bubbles: true }))";
    window.driver.execute(give, vec![]).await.unwrap();
    window
        .until("document.getElementById('effect').textContent.includes('play or pause')")
        .await;
    window.click("#agree").await;
    window
        .until("document.querySelector('.class-row kbd')?.textContent === 'p'")
        .await;
    window.driver.goto(scene.url("/label")).await.unwrap();
    let taken = "document.querySelector('[data-of=play] .taken').textContent";
    window.until(&format!("{taken}.includes('ring')")).await;
    let index = answer(&window, "p").await;
    saved(&window).await;
    assert_eq!(scene.labels.standing().await[&index], "ring");

    // The default key of an action can be restored, unless another action has this key.
    change(&window, "undo").await;
    window.press("\u{e00c}").await;
    window.click("[data-of=undo] [data-do=reset]").await;
    expect_message(&window, "u is taken: skip the behaviour").await;
    window.click("[data-of=skip] [data-do=reset]").await;
    expect_message(&window, "s: skip the behaviour").await;
    window.click("[data-of=undo] [data-do=reset]").await;
    expect_message(&window, "u: undo your last answer").await;
    window
        .until("document.querySelector('[data-of=undo] [data-do=reset]').hidden")
        .await;
    close(&window).await;
    assert_eq!(window.value(undo).await, json!("u"));
    window.close().await;
    scene.cluster.stop().await;
}
