//! A researcher's first hour, from an empty list of campaigns to a comparison of two campaigns. Nothing on a page may move by
//! itself, and no page may have accessibility barriers.

use crate::browser::{
    driver::{Driver, Window},
    looks::check,
    scene::{answer, introduce_to_offers, name, saved},
    selecting::{lasso_ten, name_selected},
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, small_latent_spec};
use serde_json::json;
use tempfile::TempDir;

const FEEDBACK: &str = "[feedback]\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 2\nsteps = 4";

/// The links to two of the three places of a campaign.
const LABEL: &str = "nav[aria-label=Campaign] a[href$='/label']";
const ANALYSE: &str = "nav[aria-label=Campaign] a[href$='/taxonomy']";

/// Scrolls to the top, and waits until the page no longer scrolls. The browser takes a picture of the whole page from the page's
/// top, and on a scrolled page everything would shift twice. The page may still scroll for some frames after typing.
const TO_THE_TOP: &str = "(async () => { \
    for (let still = 0; still < 3; still = scrollY === 0 ? still + 1 : 0) { \
        scrollTo({ top: 0, behavior: 'instant' }); \
        await new Promise(requestAnimationFrame); } })()";

/// A researcher at a screen, with a coordinator that has no campaigns yet.
struct Researcher {
    window: Window,
    screen: &'static str,
    cluster: Cluster,
    /// The folder of the data directory; dropping this field removes the folder.
    _folder: TempDir,
    _driver: Driver,
}

pub async fn at_a_wide_screen() {
    hour("1280", (1280, 900), 1, false).await;
}

pub async fn at_a_phone() {
    hour("390", (390, 844), 1, false).await;
}

pub async fn at_200_percent() {
    hour("200-percent", (1280, 900), 2, false).await;
}

pub async fn in_the_dark() {
    hour("dark", (1280, 900), 1, true).await;
}

async fn hour(screen: &'static str, size: (u32, u32), zoom: u32, dark: bool) {
    let driver = Driver::start();
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 2).await;
    let window = driver.open("about:blank").await;
    window.zoom(size, zoom, dark).await;
    let seen = window
        .value("[innerWidth * devicePixelRatio, devicePixelRatio]")
        .await;
    assert_eq!(seen, json!([size.0, zoom]));
    window.note_shifts().await;
    window.driver.goto(cluster.url()).await.unwrap();
    let researcher = Researcher {
        window,
        screen,
        cluster,
        _folder: folder,
        _driver: driver,
    };
    researcher.start().await;
    researcher.watch().await;
    researcher.label().await;
    researcher.lasso().await;
    researcher.learn().await;
    researcher.see_what_changed().await;
    researcher.name().await;
    researcher.export().await;
    researcher.start_another().await;
    researcher.compare().await;
    researcher.wait_for_a_trainer().await;
    researcher.search_by_example().await;
    assert_eq!(researcher.window.shifts().await, json!([]), "{screen}");
    researcher.window.close().await;
    researcher.cluster.stop().await;
}

impl Researcher {
    /// Checks that the page has no accessibility barriers; stores a screenshot.
    async fn look(&self, page: &str) {
        self.window.value(TO_THE_TOP).await;
        self.window.picture(&format!("hour-{page}-{}", self.screen)).await;
        check(&self.window, page).await;
    }

    async fn go(&self, page: &str) {
        let url = format!("{}{page}", self.cluster.url());
        self.window.driver.goto(url).await.unwrap();
    }

    /// Follows a link or a button to another page.
    async fn follow(&self, selector: &str, path: &str) {
        self.window.click(selector).await;
        let there = format!("document.readyState === 'complete' && location.pathname === {path:?}");
        self.window.until(&there).await;
    }

    async fn start(&self) {
        let window = &self.window;
        self.look("campaigns-none").await;
        self.go("/nowhere").await;
        window
            .until("document.querySelector('h1').textContent === 'Page not found'")
            .await;
        self.look("not-found").await;
        self.go("/").await;
        self.follow(".heading a[href='/new']", "/new").await;
        self.look("new").await;
        self.follow("a[href='/new?as=file']", "/new").await;
        self.paste(&small_latent_spec(FEEDBACK)).await;
        self.look("new-file").await;
        self.follow("[value=start]", "/campaigns/small-1").await;
    }

    /// Pastes a campaign file into the page for a new campaign.
    async fn paste(&self, spec: &CampaignSpec) {
        let paste = format!(
            "const text = document.getElementById('text'); text.value = {}; \
             text.dispatchEvent(new Event('input', {{ bubbles: true }}))",
            json!(spec.to_toml())
        );
        self.window.driver.execute(paste, vec![]).await.unwrap();
        let cost = "document.getElementById('outcome').textContent.includes('100 (5 generations of 20)')";
        self.window.until(cost).await;
    }

    async fn watch(&self) {
        self.look("progress-running").await;
        self.window
            .until("document.querySelectorAll('#novelty polyline').length === 2")
            .await;
        self.completed().await;
        self.look("progress").await;
    }

    /// Waits until the page's campaign is completed and its behaviours are shown.
    async fn completed(&self) {
        self.window
            .until("document.querySelectorAll('#found .behaviour').length > 0")
            .await;
        self.window
            .until("[...document.querySelectorAll('#found .behaviour img')].every((image) => image.complete || image.loading === 'lazy')")
            .await;
    }

    async fn label(&self) {
        self.follow("nav a[href$='/label']", "/campaigns/small-1/label")
            .await;
        self.window.until("!document.getElementById('who').hidden").await;
        self.look("label-name").await;
        introduce_to_offers(&self.window, "Ana").await;
        self.look("label").await;
        name(&self.window, "milling").await;
        name(&self.window, "my own class").await;
        for turn in 0..28 {
            answer(&self.window, ["1", "2"][turn % 2]).await;
        }
        saved(&self.window).await;
        self.look("label-30").await;
    }

    async fn lasso(&self) {
        let window = &self.window;
        self.go_to(ANALYSE, "map").await;
        window
            .until("!document.querySelector('#projection [value=neighbours]').disabled && document.querySelector('.legend li')")
            .await;
        self.look("map").await;
        let count = lasso_ten(window).await as u64;
        let pictured = "document.querySelectorAll('#gallery img').length";
        window.until(&format!("{pictured} === {count}")).await;
        self.look("map-selected").await;
        name_selected(window, "edge").await;
        // Some of the selected individuals may be among the thirty labelled individuals.
        let asked = "document.getElementById('overwrite').open";
        window
            .until(&format!(
                "{asked} || document.getElementById('legend').textContent.includes('edge')"
            ))
            .await;
        if window.value(asked).await == json!(true) {
            self.look("map-asks").await;
            window.click("#overwrite [value=all]").await;
        }
        window
            .until(&format!(
                "document.getElementById('legend').textContent.includes('edge · {count}')"
            ))
            .await;
        saved(window).await;
    }

    async fn learn(&self) {
        let window = &self.window;
        let version =
            "(async () => (await (await fetch('/campaigns/small-1/points')).json()).archive_version)()";
        let before = window.value(version).await;
        window.click(".learn button").await;
        window.until("document.querySelector('dialog.ask').open").await;
        self.look("map-learn").await;
        window.click("dialog.ask [value=yes]").await;
        // The campaign evaluates one more generation of 20, in the behaviour space of the fine-tuned embedder. The page shows the
        // progress, possibly only for a moment.
        let in_cluster = "Number(/\\((\\d+)\\)/.exec(option.textContent)?.[1] ?? 0)";
        let all = format!(
            "[...document.querySelectorAll('#of-cluster option')].reduce((sum, option) => sum + {in_cluster}, 0)"
        );
        window.until(&format!("{all} === 120")).await;
        window
            .until("document.getElementById('doing').textContent === ''")
            .await;
        assert_ne!(window.value(version).await, before);
        self.look("map-learned").await;
    }

    async fn see_what_changed(&self) {
        let window = &self.window;
        self.follow("nav a[href$='/taxonomy']", "/campaigns/small-1/taxonomy")
            .await;
        // The page links to the taxonomies before and after learning.
        window
            .until("document.querySelectorAll('.versions a').length === 2")
            .await;
        self.look("taxonomy-learned").await;
        self.follow(
            "a[href$='/taxonomy/changes']",
            "/campaigns/small-1/taxonomy/changes",
        )
        .await;
        // The page shows both maps, each with a ring for each of four medoids.
        window
            .until("document.querySelectorAll('.version-map circle').length === 8")
            .await;
        window
            .until("[...document.querySelectorAll('.changes li')].length >= 4")
            .await;
        self.look("taxonomy-changes").await;
        self.follow("a.button[href$='/taxonomy']", "/campaigns/small-1/taxonomy")
            .await;
    }

    /// Goes to a page of the campaign through the place that has the page.
    async fn go_to(&self, place: &str, page: &str) {
        self.window.click(place).await;
        self.follow(
            &format!("nav.parts a[href$='/{page}']"),
            &format!("/campaigns/small-1/{page}"),
        )
        .await;
    }

    async fn name(&self) {
        let window = &self.window;
        window
            .until("document.querySelectorAll('.medoid').length === 4")
            .await;
        window.click(".medoid form input").await;
        // The field may already contain a name.
        window
            .driver
            .execute("document.activeElement.select()", vec![])
            .await
            .unwrap();
        window.press("whirl").await;
        window.press("\u{e007}").await;
        saved(window).await;
        self.look("taxonomy").await;
        for (page, ready) in [
            ("sheet", "document.querySelectorAll('.card').length > 3"),
            ("answers", "document.querySelectorAll('.answer').length > 3"),
            ("classes", "document.querySelectorAll('.class-row').length >= 3"),
        ] {
            self.go_to(LABEL, page).await;
            window.until(ready).await;
            self.look(page).await;
        }
    }

    async fn export(&self) {
        let window = &self.window;
        self.go_to(ANALYSE, "map").await;
        // The links appear together with the classes.
        window
            .until("document.querySelector('.palette').classList.contains('ready')")
            .await;
        for (table, rows) in [("labels", 30), ("archive", 120)] {
            let link = format!("a[href$='/{table}.csv']");
            let read = window.download(&link, &format!("small-1-{table}.csv")).await;
            let read = read.trim().lines().count() - 1;
            assert!(read >= rows, "{table} has {read} rows");
        }
        self.follow("nav a[href$='/taxonomy']", "/campaigns/small-1/taxonomy")
            .await;
        let report = window.download("a[href$='/report']", "small-1.html").await;
        assert!(report.contains("into 4 clusters"), "the report is another page");
        let index = window
            .value("document.querySelector('.medoid').dataset.index")
            .await;
        let file = format!("small-1-individual-{}.svg", index.as_str().unwrap());
        window.click(".medoid .more summary").await;
        let paths = window.download(".medoid a[href*='paths.svg']", &file).await;
        assert!(paths.contains("<svg"), "{paths}");
    }

    async fn start_another(&self) {
        let window = &self.window;
        self.follow("nav a", "/campaigns/small-1").await;
        self.follow(
            "[aria-labelledby=specification] a[href='/new?from=small-1']",
            "/new",
        )
        .await;
        window.click("[name=seed]").await;
        window.press("7").await;
        self.follow("[value=start]", "/campaigns/small-2").await;
        self.completed().await;
    }

    async fn compare(&self) {
        let window = &self.window;
        self.go("/").await;
        window.click("[value='small-1']").await;
        window.click("[value='small-2']").await;
        self.look("campaigns").await;
        self.follow("#compare button", "/compare").await;
        window
            .until("['#best', '#accuracy'].every((id) => [0, 1].every((line) => document.querySelector(`${id} .line-${line}`)))")
            .await;
        self.look("compare").await;
    }

    /// Starts two campaigns, of which one waits for the only trainer, and cancels both.
    async fn wait_for_a_trainer(&self) {
        let window = &self.window;
        let busy = small_latent_spec("")
            .to_toml()
            .replace("epochs = 3", "epochs = 5000")
            .replace("patience = 8", "patience = 5000");
        for (number, name) in [(3, "busy"), (4, "patient")] {
            let spec = busy.replace("name = \"small\"", &format!("name = \"{name}\""));
            self.go("/new?as=file").await;
            self.paste(&CampaignSpec::from_toml(&spec).unwrap()).await;
            self.follow("[value=start]", &format!("/campaigns/{name}-{number}"))
                .await;
            window
                .until("document.querySelector('.stands').textContent.startsWith('training') || document.querySelector('.stands').textContent === 'waiting'")
                .await;
        }
        window
            .until("document.querySelector('[data-slot=status] .error')?.textContent.startsWith('waits for a trainer: the only trainer is at work for busy-3')")
            .await;
        self.look("waits-for-a-trainer").await;
        for campaign in ["patient-4", "busy-3"] {
            self.go(&format!("/campaigns/{campaign}")).await;
            window.click("#cancel").await;
            window.click("dialog.ask [value=yes]").await;
            window
                .until("document.querySelector('.stands')?.textContent === 'cancelled'")
                .await;
        }
    }

    /// Takes a behaviour to Play, looks at its robot in the editor, and searches for more like it.
    async fn search_by_example(&self) {
        let window = &self.window;
        self.go("/campaigns/small-1/taxonomy").await;
        window.click(".medoid .more summary").await;
        self.follow(".medoid .more a[href^='/play?']", "/play").await;
        window
            .until("document.querySelector('output.step').textContent.includes('step')")
            .await;
        window.click(".described summary").await;
        window.until("document.querySelector('.handle.direction')").await;
        // A motion that goes on changes the page while it is looked at.
        window.click(".transport .toggle").await;
        self.look("robot-editor").await;
        self.go("/campaigns/small-1/taxonomy").await;
        window.click(".medoid .more summary").await;
        let index = window
            .value("document.querySelector('.medoid').dataset.index")
            .await;
        let like = format!("/campaigns/like-small-1-{}-5", index.as_str().unwrap());
        self.follow(".medoid .more form button", &like).await;
        self.look("more-like-this").await;
    }
}
