//! Tests the list of campaigns, a new campaign, and campaigns side by side.

use crate::browser::{
    driver::Driver,
    looks::{SIZES, check},
    scene::Scene,
};
use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::small_spec;
use serde_json::json;

fn named(name: &str) -> CampaignSpec {
    let text = small_spec("seed = 2").to_toml();
    let text = text.replace("name = \"small\"", &format!("name = \"{name}\""));
    CampaignSpec::from_toml(&text).unwrap()
}

pub async fn campaigns_are_found_compared_and_deleted_after_a_question() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    scene.cluster.run(&named("second")).await;
    let request = v1::CreateCampaignRequest {
        campaign: Some(v1::create_campaign_request::Campaign::Spec(
            (&named("cell")).into(),
        )),
        study: "mini".to_owned(),
        ..v1::CreateCampaignRequest::default()
    };
    let cell = scene.cluster.client.create_campaign(request).await.unwrap();
    scene.cluster.finish(&cell.into_inner().id).await;
    let notes = v1::NoteCampaignRequest {
        campaign: "second-2".to_owned(),
        add_tags: vec!["paper".to_owned(), "with-noise".to_owned()],
        note: Some("Repeat with more noise\nand with 48 robots".to_owned()),
        ..v1::NoteCampaignRequest::default()
    };
    scene.cluster.client.note_campaign(notes).await.unwrap();
    let window = driver.open(&scene.cluster.url()).await;
    let shown = "[...document.querySelectorAll('.listed')].filter((line) => line.checkVisibility()).length";
    // The study with the cell is folded.
    window.until(&format!("{shown} === 2")).await;
    window.click(".study summary").await;
    window.until(&format!("{shown} === 3")).await;
    window.click(".tag").await;
    window.until(&format!("{shown} === 1")).await;
    assert_eq!(
        window.text("#shown").await,
        "With the tag paper: 1 of 3 shown. Show all"
    );
    window.click("#shown a").await;
    window.until(&format!("{shown} === 3")).await;
    window.click(".choice summary").await;
    for scalar in ["evaluations", "clusters", "loss"] {
        window.click(&format!(".choice [value='{scalar}']")).await;
    }
    window
        .until("document.querySelectorAll('#line-second-2 .scalars dd').length === 3")
        .await;
    window.click("#words").await;
    window.press("second").await;
    window.until(&format!("{shown} === 1")).await;
    assert_eq!(window.text("#shown").await, "1 of 3 shown. Show all");
    // A selected campaign stays selected, even if its line is hidden.
    window.click("[value='second-2']").await;
    window
        .driver
        .execute("const words = document.getElementById('words'); words.value = ''; words.dispatchEvent(new Event('input', { bubbles: true }))", vec![])
        .await
        .unwrap();
    window
        .until("document.querySelector('#compare button').disabled")
        .await;
    window
        .until("document.querySelector(\"[value='small-1']\")")
        .await;
    window.click("[value='small-1']").await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("campaigns-{width}-{scheme}")).await;
            check(&window, "campaigns").await;
        }
    }
    window.resize(1280, 900, false).await;
    window.click("#compare button").await;
    window
        .until("document.querySelectorAll('#best polyline').length === 2")
        .await;
    assert_eq!(
        window
            .value("document.querySelectorAll('.taxonomies .behaviour').length")
            .await,
        json!(8)
    );
    // Both campaigns have the same behaviour space: one map shows the behaviours of both, and a click on a behaviour leads to its
    // row.
    assert_eq!(
        window
            .value("document.querySelectorAll('.common-map circle').length")
            .await,
        json!(8)
    );
    let rows = "[...document.querySelectorAll('.taxonomies tbody th')].map((row) => row.textContent)";
    let rows = window.value(rows).await;
    // Each of the eight behaviours is in one row, either with a behaviour of the other campaign or alone.
    let behaviours = |row: &serde_json::Value| match row.as_str().unwrap() {
        "all 2" => 2,
        row if row.starts_with("only in ") => 1,
        row => panic!("{row}"),
    };
    let behaviours: usize = rows.as_array().unwrap().iter().map(behaviours).sum();
    assert_eq!(behaviours, 8, "{rows}");
    window.click(".common-map a").await;
    window
        .until("document.querySelector('.taxonomies tr:target')")
        .await;
    window.focus("#best svg").await;
    window.press("\u{e012}").await;
    window.press("\u{e012}").await;
    let told = window.text("#best .chart p").await;
    assert!(told.contains("small-1 ") && told.contains("second-2 "), "{told}");
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("compare-{width}-{scheme}")).await;
            check(&window, "compare").await;
        }
    }

    // Before a person deletes a campaign, the page shows what will be deleted and asks for confirmation.
    window.driver.goto(scene.url("")).await.unwrap();
    let campaign = window.value("location.pathname").await;
    window.click(".actions .menu summary").await;
    window.click(".actions a.delete").await;
    window.until("location.pathname.endsWith('/delete')").await;
    let asked = window.text("p.lead").await;
    assert!(
        asked.contains("100 individuals") && asked.contains("cannot be undone"),
        "{asked}"
    );
    assert_eq!(scene.cluster.campaigns().await.len(), 3);
    window.click("main p a").await;
    window.until(&format!("location.pathname === {campaign}")).await;
    window.click(".actions .menu summary").await;
    window.click(".actions a.delete").await;
    window.until("location.pathname.endsWith('/delete')").await;
    window.click("#delete").await;
    window.until("location.pathname === '/'").await;
    assert_eq!(scene.cluster.campaigns().await.len(), 2);
    window.close().await;
    scene.cluster.stop().await;
}

pub async fn a_campaign_is_described_checked_and_started_once() {
    let driver = Driver::start();
    let mut scene = Scene::set().await;
    let page = format!("{}/new", scene.cluster.url());
    let window = driver.open(&page).await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("new-{width}-{scheme}")).await;
            check(&window, "new").await;
        }
    }
    window.resize(390, 844, true).await;
    window.click(".every-field summary").await;
    window
        .until("document.querySelector('.every-field').textContent.includes('world.start.shape')")
        .await;
    window.picture("new-every-field-390-dark").await;
    check(&window, "new").await;
    window.resize(1280, 900, false).await;
    window.picture("new-every-field-1280").await;
    check(&window, "new").await;
    // The page updates the costs when a field changes. The sections after the first are folded at first.
    window.click(".group:nth-of-type(2) > summary").await;
    window.click("[name='search.population']").await;
    window.press("7").await;
    window
        .until("document.getElementById('outcome').textContent.includes('700 (100 generations of 7)')")
        .await;
    // A person who looks something up and comes back finds the form as it was.
    window.click("a[href^='/glossary']").await;
    window.until("location.pathname === '/glossary'").await;
    window.driver.back().await.unwrap();
    window
        .until("document.querySelector(\"[name='search.population']\")?.value === '7'")
        .await;
    window
        .until("document.getElementById('outcome').textContent.includes('700 (100 generations of 7)')")
        .await;
    window.click("[name='search.generations']").await;
    window.press("none").await;
    window
        .until("document.querySelector('[aria-invalid]')?.name === 'search.generations'")
        .await;
    // All errors are shown at once, with limits; a submitted form opens their sections.
    window.click("[name='world.agents']").await;
    window.press("-4").await;
    let marked = "[...document.querySelectorAll('[aria-invalid]')].map((field) => field.name).join()";
    let both = format!("{marked} === 'world.agents,search.generations'");
    window.until(&both).await;
    window.click("[value=start]").await;
    window
        .until(&format!("document.querySelector('[role=alert]') && {both}"))
        .await;
    let told = window.text("[role=alert]").await;
    assert!(
        told.contains("2 errors")
            && told.contains("Number of robots must be a whole number from 1 to 10000, not -4")
            && told.contains("Generations must be a whole number from 1 to"),
        "{told}"
    );
    window.picture("new-wrong-1280").await;
    check(&window, "new").await;
    window.resize(390, 844, false).await;
    window.picture("new-wrong-390").await;
    check(&window, "new").await;
    window.resize(1280, 900, false).await;
    // For an error in a campaign file, the page gives the line and selects it.
    window.driver.goto(format!("{page}?as=file")).await.unwrap();
    let text = "const text = document.getElementById('text'); text.value = 'model = \"single-sensor\"\\nmethod = \"random\"\\nseeed = 1\\n'";
    window.driver.execute(text, vec![]).await.unwrap();
    window.click("[value=start]").await;
    window
        .until("document.getElementById('text').selectionStart === 42")
        .await;
    let told = window.text("#outcome").await;
    assert!(
        told.contains("Line 3") && told.contains("did you mean `seed`?"),
        "{told}"
    );
    assert_eq!(scene.cluster.campaigns().await.len(), 1);
    // A copy of a campaign starts only once, even if a person presses the button twice.
    window.driver.goto(format!("{page}?from=small-1")).await.unwrap();
    window.click("[name=name]").await;
    window.press("-again").await;
    let twice = "const form = document.getElementById('new'); const fields = new URLSearchParams(new FormData(form)); \
                 fields.set('step', 'start'); fetch(form.action, { method: 'POST', body: fields })";
    window.driver.execute(twice, vec![]).await.unwrap();
    window.click("[value=start]").await;
    window
        .until("location.pathname === '/campaigns/small-again-2'")
        .await;
    assert_eq!(scene.cluster.campaigns().await.len(), 2);
    window.close().await;
    scene.cluster.stop().await;
}
