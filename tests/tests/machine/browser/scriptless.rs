//! Tests pages without JavaScript.

use crate::browser::{driver::Driver, scene::Scene};
use serde_json::json;

/// Script: visible controls that do nothing without scripts.
const DEAD: &str = "[...document.querySelectorAll('button, input:not([type=hidden]), select, textarea')] \
     .filter((control) => control.checkVisibility() && !['post', 'get'].includes(control.form?.getAttribute('method'))) \
     .map((control) => control.outerHTML.slice(0, 120))";

pub async fn a_page_without_scripts_says_what_it_needs_and_shows_what_it_has() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.labels.say("Ben", [(3, "milling".to_owned())]).await;
    let window = driver.open(&scene.cluster.url()).await;
    window.without_scripts().await;
    for (page, says) in [
        ("", "does not update"),
        ("/label", "needs JavaScript"),
        ("/sheet", "needs JavaScript"),
        ("/map", "needs JavaScript"),
        ("/taxonomy", "cannot be named here"),
    ] {
        window.driver.goto(scene.url(page)).await.unwrap();
        let shown = window
            .value("document.body.innerText")
            .await
            .as_str()
            .unwrap()
            .to_owned();
        assert!(shown.contains(says), "{page}: {shown}");
        // No text of the page may promise an effect of a script.
        for waits in ["…", "Click", "Point at", "Simulating"] {
            assert!(!shown.contains(waits), "{page}: {waits} in {shown}");
        }
        assert_eq!(
            window.value(DEAD).await,
            json!([]),
            "{page} shows what does nothing"
        );
        let name = page.trim_start_matches('/');
        window
            .picture(&format!(
                "scriptless-{}",
                if name.is_empty() { "progress" } else { name }
            ))
            .await;
    }
    // The taxonomy consists of pictures and numbers.
    assert_eq!(
        window
            .value("document.querySelectorAll('.medoid .stage img').length")
            .await,
        json!(4)
    );
    let play = format!("{}/play", scene.cluster.url());
    window.driver.goto(play).await.unwrap();
    let shown = window.text("main").await;
    assert!(shown.contains("needs JavaScript"), "{shown}");
    assert_eq!(
        window.value(DEAD).await,
        json!([]),
        "Play shows what does nothing"
    );
    window.driver.goto(scene.cluster.url()).await.unwrap();
    let list = window
        .value("document.body.innerText")
        .await
        .as_str()
        .unwrap()
        .to_owned();
    assert!(
        list.contains("small-1") && list.contains("Reload the page"),
        "{list}"
    );
    window.close().await;
    scene.cluster.stop().await;
}
