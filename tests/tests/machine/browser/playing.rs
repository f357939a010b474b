//! Tests the page Play.

use crate::browser::{
    driver::{Driver, Window},
    looks::{self, SIZES},
};
use murmuration_swarm::{CampaignSpec, Controller};
use murmuration_tests::{Cluster, small_spec};
use serde_json::{Value, json};
use tempfile::TempDir;

/// A coordinator, and a browser at the page Play.
struct Playground {
    _folder: TempDir,
    _driver: Driver,
    cluster: Cluster,
    window: Window,
}

impl Playground {
    async fn open() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let cluster = Cluster::start(folder.path(), 0).await;
        Self::at(folder, cluster).await
    }

    /// A coordinator with a worker and a completed campaign.
    async fn beside_a_campaign() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let mut cluster = Cluster::start(folder.path(), 1).await;
        cluster.run(&small_spec("")).await;
        Self::at(folder, cluster).await
    }

    async fn at(folder: TempDir, cluster: Cluster) -> Self {
        let driver = Driver::start();
        let window = driver.open(&format!("{}/play", cluster.url())).await;
        Self {
            _folder: folder,
            _driver: driver,
            cluster,
            window,
        }
    }

    async fn goto(&self, query: &str) {
        let url = format!("{}/play?{query}", self.cluster.url());
        self.window.driver.goto(url).await.unwrap();
    }

    async fn close(self) {
        self.window.close().await;
        self.cluster.stop().await;
    }
}

const STEP: &str = "Number(document.querySelector('output.step').textContent.replace(/\\D/g, ''))";
const QUERY: &str = "Object.fromEntries(new URLSearchParams(location.search))";
const PLAYS: &str = "document.querySelector('.toggle').classList.contains('playing')";
/// Script: a hash of the drawn swarm.
const DRAWN: &str = "(() => { const c = document.querySelector('canvas'); \
    const { data } = c.getContext('2d').getImageData(0, 0, c.width, c.height); \
    return data.reduce((sum, value) => (31 * sum + value) % 1000003, 0); })()";

/// Moves the slider of a gene, as a pointer does.
async fn slide(window: &Window, gene: u32, value: &str) {
    let script = format!(
        "const slider = document.querySelector('[data-slides=gene-{gene}]'); slider.value = '{value}'; \
         for (const kind of ['input', 'change']) slider.dispatchEvent(new Event(kind, {{ bubbles: true }}))"
    );
    window.driver.execute(script, vec![]).await.unwrap();
}

/// Script: whether the motion of the current controller has arrived.
const IS_THERE: &str = "document.querySelector('.stage').getAttribute('aria-busy') === 'false'";

/// A hash of the swarm at the first step, after the motion has arrived.
async fn drawn_at_start(window: &Window) -> Value {
    window.until(IS_THERE).await;
    if window.value(PLAYS).await == json!(true) {
        window.press(" ").await;
    }
    window.press("r").await;
    window.until(&format!("{IS_THERE} && {STEP} === 0")).await;
    window.press("\u{e014}").await;
    window.until(&format!("{STEP} === 1")).await;
    window.value(DRAWN).await
}

pub async fn a_controller_is_changed_and_its_address_shows_the_same_again() {
    let playground = Playground::open().await;
    let window = &playground.window;
    window.until(&format!("{STEP} > 20 && {PLAYS}")).await;
    window
        .click("nav[aria-label=Robots] a[href$='single-sensor']")
        .await;
    window
        .until(&format!("{QUERY}.model === 'single-sensor' && {STEP} > 20"))
        .await;
    let before = drawn_at_start(window).await;
    let usual = "-0.7,0.3,1,1";
    assert_eq!(window.value(&format!("{QUERY}.genes")).await, json!(usual));

    slide(window, 0, "0.9").await;
    window.until(&format!("{QUERY}.genes === '0.9,0.3,1,1'")).await;
    let after = drawn_at_start(window).await;
    assert_ne!(before, after, "the motion does not follow its controller");
    window.driver.refresh().await.unwrap();
    assert_eq!(
        drawn_at_start(window).await,
        after,
        "a reload shows another motion"
    );
    assert_eq!(
        window.value("document.getElementById('gene-0').value").await,
        json!("0.9")
    );

    window.press("n").await;
    window.until(&format!("{QUERY}.seed === '2'")).await;
    assert_ne!(
        drawn_at_start(window).await,
        after,
        "another seed has the same start"
    );
    for genes in ["0.9,0.3,1,1", usual] {
        window.driver.back().await.unwrap();
        window
            .until(&format!(
                "{QUERY}.seed === '1' && {QUERY}.genes === '{genes}' && {STEP} > 0"
            ))
            .await;
    }
    assert_eq!(drawn_at_start(window).await, before);
    window.driver.forward().await.unwrap();
    window
        .until(&format!(
            "document.getElementById('gene-0').value === '0.9' && {STEP} > 0"
        ))
        .await;
    playground.close().await;
}

pub async fn a_swarm_goes_on_pauses_and_grows() {
    let playground = Playground::open().await;
    let window = &playground.window;
    // The page loads a motion in pieces of 600 steps.
    for _ in 0..2 {
        window.press("+").await;
    }
    window.until(&format!("{STEP} > 2000")).await;
    window.press(" ").await;
    window.until(&format!("!{PLAYS}")).await;
    let at = window.value(STEP).await.as_u64().unwrap();
    window.press("\u{e014}").await;
    window.until(&format!("{STEP} === {}", at + 1)).await;
    let script = "const robots = document.getElementById('robots-slider'); robots.value = 1000; \
         for (const kind of ['input', 'change']) robots.dispatchEvent(new Event(kind, { bubbles: true }))";
    window.driver.execute(script, vec![]).await.unwrap();
    window
        .until(&format!("{QUERY}.robots === '1000' && {STEP} === 0"))
        .await;
    window.press(" ").await;
    window.until(&format!("{STEP} > 500")).await;
    playground.close().await;
}

/// Moves the slider of the steps, as a pointer does.
async fn scrub(window: &Window, step: u32) {
    let script = format!(
        "const slider = document.querySelector('#play .scrub'); slider.value = {step}; \
         slider.dispatchEvent(new Event('input', {{ bubbles: true }}))"
    );
    window.driver.execute(script, vec![]).await.unwrap();
    window
        .until(&format!("{IS_THERE} && {STEP} === {step} && !{PLAYS}"))
        .await;
}

/// Script: counts the requests for pieces in `asked`.
const COUNT_PIECES: &str = "window.asked = 0; \
    const usual = window.fetch; \
    window.fetch = (address, ...rest) => { \
        if (String(address).endsWith('/play/motion')) window.asked += 1; \
        return usual(address, ...rest); }";

pub async fn a_motion_is_scrubbed_without_requests_and_goes_on_from_there() {
    let playground = Playground::open().await;
    let window = &playground.window;
    for _ in 0..2 {
        window.press("+").await;
    }
    window.until(&format!("{STEP} > 1500")).await;
    window.press(" ").await;
    window.until(&format!("!{PLAYS}")).await;
    // The piece after the shown one can still be under way: only requests from now on count.
    window.driver.execute(COUNT_PIECES, vec![]).await.unwrap();
    scrub(window, 700).await;
    let drawn = window.value(DRAWN).await;
    scrub(window, 100).await;
    assert_ne!(window.value(DRAWN).await, drawn);
    scrub(window, 700).await;
    assert_eq!(window.value(DRAWN).await, drawn);
    // The keys ArrowLeft and ArrowRight.
    for (key, step) in [("\u{e012}", 699), ("\u{e014}", 700)] {
        window.press(key).await;
        window.until(&format!("{STEP} === {step}")).await;
    }
    assert_eq!(window.value(DRAWN).await, drawn);
    assert_eq!(
        window.value("asked").await,
        json!(0),
        "kept pieces are requested again"
    );
    window.press(" ").await;
    window.until(&format!("{STEP} > 2000 && {PLAYS}")).await;
    // A motion that begins in the middle has its first steps when a person goes there.
    window.press(" ").await;
    scrub(window, 1000).await;
    let drawn = window.value(DRAWN).await;
    slide(window, 0, "0.9").await;
    window.until(&format!("{IS_THERE} && {STEP} === 1000")).await;
    scrub(window, 0).await;
    slide(window, 0, "0.8").await;
    window.until(&format!("{IS_THERE} && {STEP} === 0")).await;
    playground.goto("#step=1000").await;
    window.driver.refresh().await.unwrap();
    window
        .until(&format!("{IS_THERE} && {STEP} === 1000 && !{PLAYS}"))
        .await;
    assert_eq!(window.value(DRAWN).await, drawn);
    playground.close().await;
}

/// Script: the texts of the table of marked moments, row by row.
const MARKED: &str = "[...document.querySelectorAll('#marks tr')].map((row) => [...row.cells].map((cell) => cell.textContent.trim()))";

pub async fn features_and_names_over_time_lead_to_moments_that_are_marked() {
    let playground = Playground::open().await;
    let window = &playground.window;
    let judged = "document.getElementById('judged')?.textContent";
    window
        .until(&format!(
            "{STEP} > 600 && {judged}.startsWith('The judge calls this ')"
        ))
        .await;
    window
        .until("document.querySelectorAll('#timeline polyline').length === 5")
        .await;
    scrub(window, 100).await;
    window
        .until(&format!("{judged}.startsWith('Not enough motion yet')"))
        .await;
    window.press("m").await;
    window.click("#timeline svg").await;
    window.until(&format!("{STEP} > 200 && {STEP} % 40 === 0")).await;
    let step = window.value(STEP).await.as_u64().unwrap();
    window.click("#mark").await;
    let marked = window.value(MARKED).await;
    assert_eq!(marked[0], json!(["", "Step 100", format!("Step {step}")]));
    assert_eq!(marked[1][1], json!("no name"));
    assert_eq!(marked[2][0], json!("average speed"));
    assert_eq!(
        marked[7],
        json!(["Measured at", "step 80", format!("step {step}")])
    );
    assert_eq!(marked[8], json!(["Swarm", "this one", "this one"]));
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("play-marks-{width}-{scheme}")).await;
            looks::check(window, "play-marks").await;
        }
    }
    window.resize(1280, 900, false).await;
    // The moments of another swarm stay, and lead back to it.
    window.press("n").await;
    window
        .until(&format!(
            "{QUERY}.seed === '2' && {MARKED}[8][1] === 'two-sensor, 24 robots, seed 1'"
        ))
        .await;
    window.click("#marks .moment").await;
    window
        .until(&format!(
            "{QUERY}.seed === '1' && {IS_THERE} && {STEP} === 100 && !{PLAYS}"
        ))
        .await;
    window.click("#marks [aria-label='Remove step 100']").await;
    window.until(&format!("{MARKED}[0].length === 2")).await;
    playground.goto("robots=2").await;
    window
        .until(&format!(
            "{judged} === 'The judge names only the motion of 3 or more robots.'"
        ))
        .await;
    playground.close().await;
}

pub async fn controllers_around_one_are_drawn_named_and_led_to() {
    let playground = Playground::open().await;
    let window = &playground.window;
    const AROUND: &str = "document.querySelectorAll('#around li').length";
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            playground
                .goto("model=single-sensor&genes=0.6,1,0.4,0.5&seed=3")
                .await;
            window.until(&format!("{STEP} > 20")).await;
            window.click("#around summary").await;
            window.until(&format!("{AROUND} === 7")).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("play-around-{width}-{scheme}")).await;
            looks::check(window, "play-around").await;
        }
    }
    window.resize(1280, 900, false).await;
    let drawn = "[...document.querySelectorAll('#around svg')].every((svg) => svg.querySelectorAll('circle').length === 24)";
    assert_eq!(window.value(drawn).await, json!(true));
    // Another controller has others around it.
    slide(window, 1, "0.5").await;
    window.until(&format!("{AROUND} === 8")).await;
    window.click("#around a").await;
    window
        .until(&format!(
            "{QUERY}.genes === '0.5,0.5,0.4,0.5' && {QUERY}.seed === '3' && {STEP} > 20"
        ))
        .await;
    playground.goto("robots=100").await;
    window.until(&format!("{STEP} > 20")).await;
    window.click("#around summary").await;
    window
        .until("document.querySelector('#around .status').textContent.includes('must be at most 64')")
        .await;
    playground.close().await;
}

pub async fn a_robot_is_described_and_what_is_wrong_with_it_is_said() {
    let playground = Playground::open().await;
    let window = &playground.window;
    window.click(".described summary").await;
    let describe = |text: &str| {
        let script = format!(
            "document.getElementById('robot').value = {text:?}; document.querySelector('.described form button').click()"
        );
        let driver = window.driver.clone();
        async move { driver.execute(script, vec![]).await.unwrap() }
    };
    describe("[robot]\nsensors = [{ agnle = 1.0 }]\n").await;
    window
        .until("document.querySelector('pre.error')?.textContent.includes('did you mean `angle`?')")
        .await;
    let kept = window.value("document.getElementById('robot').value").await;
    assert_eq!(kept, json!("[robot]\nsensors = [{ agnle = 1.0 }]\n"));
    describe("[robot]\nsensors = [{ angle = 1.0 }, {}, {}]\n").await;
    window
        .until(&format!(
            "document.querySelectorAll('.states tbody tr').length === 8 && {STEP} > 20"
        ))
        .await;
    slide(window, 15, "0.5").await;
    window.until(&format!("{QUERY}.genes?.endsWith(',0.5')")).await;
    window.driver.refresh().await.unwrap();
    window
        .until(&format!(
            "document.getElementById('gene-15').value === '0.5' && {STEP} > 20"
        ))
        .await;
    playground.close().await;
}

pub async fn the_page_fits_every_screen_and_rests_where_motion_is_not_wanted() {
    const SPECIES: &str = "robot=ratios+%3D+%5B%5B12,12%5D,%5B6,18%5D%5D%0A%5B%5Bspecies%5D%5D%0Aname+%3D+%22a%22%0Arobot.sensors+%3D+%5B%7B%7D%5D%0A\
         %5B%5Bspecies%5D%5D%0Aname+%3D+%22b%22%0Arobot.sensors+%3D+%5B%7B%7D,%7Bangle%3D%22free%22,angle_range%3D%5B-1.0,1.0%5D%7D%5D";
    let playground = Playground::open().await;
    let window = &playground.window;
    for (width, height) in SIZES.into_iter().chain([(360, 740)]) {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            for (name, query) in [
                ("play", ""),
                ("play-species", SPECIES),
                ("play-wrong", "model=x&robots=0"),
            ] {
                playground.goto(query).await;
                window.until(&format!("{STEP} > 40")).await;
                window.picture(&format!("{name}-{width}-{scheme}")).await;
                looks::check(window, name).await;
                // The swarm stays in view although the controls are far below it.
                let stays = "(() => { scrollTo({ top: 450, behavior: 'instant' }); \
                    const { top, bottom } = document.querySelector('.stage').getBoundingClientRect(); \
                    return width > 999 || (top >= 0 && bottom < innerHeight); })()";
                let stays = stays.replace("width", &width.to_string());
                assert_eq!(window.value(&stays).await, json!(true), "{name} at {width}");
            }
        }
    }
    window.resize(1280, 900, false).await;
    for (name, query) in [
        ("play-flockbots", "model=flockbots"),
        ("play-turbopi", "model=turbopi"),
        ("play-crowd", "robots=1000"),
    ] {
        playground.goto(query).await;
        window.until(&format!("{STEP} > 300")).await;
        window.picture(name).await;
    }
    let media = json!({ "features": [{ "name": "prefers-reduced-motion", "value": "reduce" }] });
    let cdp = window.driver.cdp();
    cdp.send_raw("Emulation.setEmulatedMedia", media).await.unwrap();
    playground.goto("").await;
    window
        .until(&format!(
            "document.querySelector('output.step').textContent === 'step 0' && !{PLAYS}"
        ))
        .await;
    window.click(".toggle").await;
    window.until(&format!("{STEP} > 10")).await;
    playground.close().await;
}

/// Script: the number of similar individuals on the page.
const LIKE: &str = "document.querySelectorAll('#likes li').length";

pub async fn what_a_swarm_is_like_is_shown_with_ways_to_see_it() {
    let playground = Playground::beside_a_campaign().await;
    let window = &playground.window;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            playground.goto("model=single-sensor&genes=0.6,1,0.4,0.5").await;
            window.until(&format!("{STEP} > 20")).await;
            window.press("l").await;
            window.until(&format!("{LIKE} === 6 && [...document.querySelectorAll('#likes img')].every((it) => it.naturalWidth > 0)")).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("play-like-{width}-{scheme}")).await;
            looks::check(window, "play-like").await;
        }
    }
    // The swarm's own picture is drawn, and the similar individuals are sorted by distance.
    let white = "(() => { const c = document.querySelector('#likes canvas'); \
        return Math.max(...c.getContext('2d').getImageData(0, 0, c.width, c.height).data.filter((_, i) => i % 4 < 3)); })()";
    assert!(window.value(white).await.as_u64().unwrap() > 200);
    let distances =
        "[...document.querySelectorAll('#likes .reason')].map((it) => parseFloat(it.textContent))";
    let distances: Vec<f64> = serde_json::from_value(window.value(distances).await).unwrap();
    assert!(distances.len() == 5 && distances.is_sorted(), "{distances:?}");
    // For another controller, the page shows no similar individuals until a person asks.
    slide(window, 0, "0.9").await;
    window
        .until(&format!("{LIKE} === 0 && {QUERY}.genes === '0.9,1,0.4,0.5'"))
        .await;
    window.click("#ask").await;
    window.until(&format!("{LIKE} === 6")).await;
    window.click("#likes a").await;
    window
        .until("location.pathname.endsWith('/map') && document.getElementById('chosen').textContent.startsWith('Individual ' + location.hash.split('-')[1])")
        .await;
    playground.close().await;
}

pub async fn a_search_begins_with_the_controller_that_was_played_with() {
    let playground = Playground::beside_a_campaign().await;
    let window = &playground.window;
    playground
        .goto("model=single-sensor&genes=0.6,1,0.4,0.5&seed=7")
        .await;
    window.until(&format!("{STEP} > 20")).await;
    slide(window, 1, "0.35").await;
    window.click("#search button").await;
    window.until("location.pathname === '/campaigns/play-2'").await;
    let spec = window.value("document.querySelector('pre').textContent").await;
    let spec = CampaignSpec::from_toml(spec.as_str().unwrap()).unwrap();
    let initial: Vec<_> = spec
        .controllers()
        .initial()
        .iter()
        .map(Controller::genes)
        .collect();
    assert_eq!(
        (initial[0], initial.len(), spec.seed()),
        (&[0.6, 0.35, 0.4, 0.5][..], 50, 7)
    );
    playground.close().await;
}

pub async fn a_search_and_a_sweep_take_the_robot_as_it_was_edited() {
    let playground = Playground::beside_a_campaign().await;
    let window = &playground.window;
    const BUTTONS: &str = "#search button";
    let edit = async |text: &str| {
        let script = format!(
            "const text = document.getElementById('robot'); text.value = {text:?}; \
             text.dispatchEvent(new Event('input', {{ bubbles: true }}))"
        );
        window.driver.execute(script, vec![]).await.unwrap();
    };
    playground
        .goto("model=single-sensor&genes=0.6,1,0.4,0.5&seed=7")
        .await;
    window.until(&format!("{STEP} > 20")).await;
    // A browser can restore an edited text before the editor reads it. The controller does not fit a robot with another sensor, so
    // that the page says what to do first.
    let restore = "document.getElementById('robot').value = '[robot]\\nsensors = [{}, { angle = 1.0 }]\\n'";
    window.driver.execute(restore, vec![]).await.unwrap();
    window.click(".described summary").await;
    window.until("document.querySelector('.robot-fields svg')").await;
    window.click(BUTTONS).await;
    window
        .until("document.querySelector('#compared.wrong')?.textContent.includes('Press “Use this robot”')")
        .await;
    // A controller that fits goes with the edited robot, and with the edited number of robots.
    const THIRTY: &str = "[robot]\nradius = 7.0\nsensors = [{}]\n[world]\nagents = 30 # not 24\n";
    edit(THIRTY).await;
    window.click(&format!("{BUTTONS}[value=sweep]")).await;
    // The map shows the centre of the sweep.
    window
        .until(
            "location.pathname === '/campaigns/play-sweep-2/map' \
             && document.getElementById('chosen').textContent.endsWith('the centre of the sweep.')",
        )
        .await;
    window.picture("sweep-map").await;
    let page = format!("{}/campaigns/play-sweep-2", playground.cluster.url());
    window.driver.goto(page).await.unwrap();
    let spec = window.value("document.querySelector('pre').textContent").await;
    let spec = CampaignSpec::from_toml(spec.as_str().unwrap()).unwrap();
    assert_eq!(spec.model().species()[0].robot().radius(), 7.0);
    assert_eq!(spec.world().agents(), 30);
    assert_eq!(
        spec.sweep_centre().map(Controller::genes),
        Some(&[0.6, 1.0, 0.4, 0.5][..])
    );
    // “Use this robot” also takes the edited number, and keeps the controller and the seed.
    playground
        .goto("model=single-sensor&genes=0.6,1,0.4,0.5&seed=7")
        .await;
    window.until(&format!("{QUERY}.robots === '24'")).await;
    window.click(".described summary").await;
    window.until("document.querySelector('.robot-fields svg')").await;
    edit(THIRTY).await;
    window
        .until("document.querySelector('.robot-editor .status').textContent.includes('comments')")
        .await;
    window.click(".described form button").await;
    window
        .until(&format!(
            "{QUERY}.robots === '30' && {QUERY}.genes === '0.6,1,0.4,0.5' && {QUERY}.seed === '7'"
        ))
        .await;
    playground.close().await;
}

pub async fn where_nothing_can_be_compared_the_page_says_so() {
    let playground = Playground::open().await;
    let window = &playground.window;
    window
        .until("document.querySelector('.compare .reason')?.textContent.includes('No campaign in a world of 500 × 500')")
        .await;
    window.press("l").await;
    assert_eq!(window.value(LIKE).await, json!(0));
    playground.close().await;
    // Tests a completed campaign without a worker that could simulate.
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start(folder.path(), 1).await;
    cluster.run(&small_spec("")).await;
    cluster.stop().await;
    let cluster = Cluster::start(folder.path(), 0).await;
    let playground = Playground::at(folder, cluster).await;
    let window = &playground.window;
    window.until(&format!("{STEP} > 20")).await;
    window.click("#ask").await;
    window
        .until("document.getElementById('compared').textContent.startsWith('No worker is connected')")
        .await;
    playground.close().await;
}
