//! Headless Chromium, driven through chromedriver.

use murmuration_tests::requirements::chromium;
use serde_json::{Value, json};
use std::{
    fs,
    io::{BufRead as _, BufReader},
    path::PathBuf,
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};
use thirtyfour::{
    Capabilities, ChromiumLikeCapabilities as _, DesiredCapabilities, WebDriver,
    error::{
        WebDriverError,
        WebDriverErrorInner::{
            ElementClickIntercepted, ElementNotInteractable, NoSuchElement, StaleElementReference,
        },
        WebDriverResult,
    },
    prelude::*,
};

/// Longer than any successful operation takes on a busy machine.
const DRIVER_TIMEOUT: Duration = Duration::from_secs(60);
const POLL_INTERVAL: Duration = Duration::from_millis(20);
/// Time between two checks of the browser's log during a wait.
const LOOK_INTERVAL: Duration = Duration::from_secs(10);

/// Records layout shifts on the window's pages that do not follow a key press, a click or typing.
const SHIFTS: &str = "new PerformanceObserver((list) => { \
    if (location.protocol === 'about:') return; \
    const noted = JSON.parse(sessionStorage.getItem('shifts') ?? '[]'); \
    const place = ({ x, y, width, height }) => [x, y, width, height].map(Math.round).join(' '); \
    for (const { hadRecentInput, sources } of list.getEntries()) { \
        if (hadRecentInput) continue; \
        for (const { node, previousRect, currentRect } of sources) { \
            const what = (node?.outerHTML ?? node?.textContent ?? 'gone').slice(0, 160); \
            noted.push(`${location.pathname}: ${what}: ${place(previousRect)} -> ${place(currentRect)}`); \
        } \
    } \
    sessionStorage.setItem('shifts', JSON.stringify(noted)); \
}).observe({ type: 'layout-shift', buffered: true })";

/// Makes a page's script fail when it reads a field that the coordinator did not send. The check covers the JSON of `fetch`,
/// events and attributes. JSON that a page stored itself may lack fields, because another version may have written it.
const UNSENT: &str = "(() => { \
    const strict = (value) => (typeof value !== 'object' || value === null) ? value : new Proxy(value, { \
        get(target, name, self) { \
            const isMethod = ['then', 'toJSON'].includes(name); \
            if (typeof name === 'string' && !(name in target) && !Array.isArray(target) && !isMethod) { \
                throw new TypeError(`no field ${name} was sent, only ${Object.keys(target)}`); \
            } \
            return strict(Reflect.get(target, name, self)); \
        } \
    }); \
    const { parse } = JSON; \
    const kept = (text) => text === '{}' || \
        [localStorage, sessionStorage].some((store) => Object.values(store).includes(text)); \
    JSON.parse = (text, ...rest) => { \
        const value = parse(text, ...rest); \
        return location.protocol === 'about:' || kept(text) ? value : strict(value); \
    }; \
    const { json } = Response.prototype; \
    Response.prototype.json = async function () { return strict(await json.call(this)); }; \
})()";

/// A chromedriver process. Dropping a `Driver` ends the process.
pub struct Driver {
    process: Child,
    url: String,
    binary: String,
}

/// Starts chromedriver; returns its process and port, or `None` if it ended before it listened.
fn listening(driver: &str) -> Option<(Child, u16)> {
    let mut process = Command::new(driver)
        .arg("--port=0")
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let message = BufReader::new(process.stdout.take().unwrap());
    let port = message.lines().map(Result::unwrap).find_map(|line| {
        let (_, port) = line.split_once("started successfully on port ")?;
        port.trim_end_matches('.').parse().ok()
    });
    if port.is_none() {
        process.wait().unwrap();
    }
    Some((process, port?))
}

/// A browser with one window.
pub struct Window {
    pub driver: WebDriver,
}

impl Driver {
    pub fn start() -> Self {
        let (binary, driver) = chromium().expect("the harness asks first whether there is a browser");
        // chromedriver takes a free IPv6 port, and ends if the same IPv4 port is in use, for example by a chromedriver of another
        // test.
        let (process, port) = (0..10)
            .find_map(|_| listening(&driver))
            .expect("chromedriver says where it listens");
        Self {
            process,
            url: format!("http://127.0.0.1:{port}"),
            binary,
        }
    }

    /// Opens `url` in a new browser without stored data.
    pub async fn open(&self, url: &str) -> Window {
        let mut chrome = DesiredCapabilities::chrome();
        chrome.set_binary(&self.binary).unwrap();
        for argument in [
            "--headless=new",
            "--no-sandbox",
            "--disable-dev-shm-usage",
            "--disable-gpu",
            "--no-first-run",
            "--hide-scrollbars",
            "--window-size=1280,900",
        ] {
            chrome.add_arg(argument).unwrap();
        }
        murmuration_tests::http::choose_cryptography();
        let driver = WebDriver::new(&self.url, Capabilities::from(chrome))
            .await
            .unwrap();
        let window = Window { driver };
        window.before_pages(UNSENT).await;
        window.driver.goto(url).await.unwrap();
        window
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // chromedriver may have ended by itself.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Window {
    /// Runs a script and returns its value.
    pub async fn value(&self, script: &str) -> Value {
        let answer = self.driver.execute(format!("return {script}"), vec![]).await;
        answer.unwrap().json().clone()
    }

    pub async fn text(&self, selector: &str) -> String {
        let element = self.driver.find(By::Css(selector)).await.unwrap();
        element.text().await.unwrap()
    }

    /// Waits until a script returns true; panics with the page's content if the script never does. While one page replaces
    /// another, elements are missing and the script may fail: a failed script counts as not true yet.
    ///
    /// Containers that start beside the tests change the machine's networks, and Chromium then aborts loading. Such a page is
    /// loaded again.
    pub async fn until(&self, script: &str) {
        let mut begun = Instant::now();
        let mut looked = begun;
        let script = format!("(() => {{ try {{ return Boolean({script}); }} catch {{ return false; }} }})()");
        while self.value(&script).await != json!(true) {
            if looked.elapsed() > LOOK_INTERVAL {
                looked = Instant::now();
                let log = format!("{:?}", self.driver.browser_log().await);
                if log.contains("ERR_NETWORK_CHANGED") {
                    self.driver.refresh().await.unwrap();
                    begun = looked;
                }
            }
            if begun.elapsed() > DRIVER_TIMEOUT {
                let shown = self.value("document.body.innerText").await;
                let log = self.driver.browser_log().await;
                panic!("never came true: {script}\nthe page shows {shown}\nits log: {log:?}");
            }
            tokio::time::sleep(POLL_INTERVAL).await;
        }
    }

    /// Presses keys, one after the other, without moving the focus.
    pub async fn press(&self, keys: &str) {
        let chain = self
            .driver
            .action_chain_with_delay(Some(Duration::ZERO), Some(Duration::ZERO));
        chain.send_keys(keys).perform().await.unwrap();
    }

    /// Clicks the first element that matches a selector, as soon as the element exists, is shown and enabled, and is not covered.
    pub async fn click(&self, selector: &str) {
        let begun = Instant::now();
        loop {
            let why = match self.try_click(selector).await.map_err(WebDriverError::into_inner) {
                Ok(true) => return,
                Ok(false) => "it is hidden or disabled".to_owned(),
                // These errors mean that the page is still changing. The driver has not clicked.
                Err(
                    error @ (ElementClickIntercepted(_)
                    | ElementNotInteractable(_)
                    | NoSuchElement(_)
                    | StaleElementReference(_)),
                ) => error.to_string(),
                Err(error) => panic!("{selector}: {error}"),
            };
            assert!(
                begun.elapsed() < DRIVER_TIMEOUT,
                "{selector} cannot be clicked: {why}"
            );
            tokio::time::sleep(POLL_INTERVAL).await;
        }
    }

    /// Returns whether the element could be clicked.
    async fn try_click(&self, selector: &str) -> WebDriverResult<bool> {
        let element = self.driver.find(By::Css(selector)).await?;
        let clickable = element.is_clickable().await?;
        if clickable {
            element.scroll_into_view().await?;
            element.click().await?;
        }
        Ok(clickable)
    }

    /// Focuses an element, as keyboard navigation does.
    pub async fn focus(&self, selector: &str) {
        let script = format!("document.querySelector({selector:?}).focus({{ focusVisible: true }})");
        self.driver.execute(script, vec![]).await.unwrap();
    }

    /// Draws a line with the pointer through points of an element. Coordinates are relative to the element's top left corner.
    pub async fn draw(&self, selector: &str, line: &[(f64, f64)]) {
        let place = self
            .value(&format!(
                "(() => {{ const e = document.querySelector({selector:?}); e.scrollIntoView({{ block: 'center' }}); \
                 const b = e.getBoundingClientRect(); return [b.left, b.top]; }})()"
            ))
            .await;
        let (left, top) = (place[0].as_f64().unwrap(), place[1].as_f64().unwrap());
        let at = |point: &(f64, f64)| ((left + point.0).round() as i64, (top + point.1).round() as i64);
        let mut chain = self
            .driver
            .action_chain_with_delay(Some(Duration::ZERO), Some(Duration::from_millis(10)));
        let (x, y) = at(&line[0]);
        chain = chain.move_to(x, y).click_and_hold();
        for point in &line[1..] {
            let (x, y) = at(point);
            chain = chain.move_to(x, y);
        }
        chain.release().perform().await.unwrap();
    }

    /// Records layout shifts on all following pages.
    pub async fn note_shifts(&self) {
        self.before_pages(SHIFTS).await;
    }

    /// Runs a script before the page's own scripts, on all following pages.
    pub async fn before_pages(&self, script: &str) {
        let script = json!({ "source": script });
        let cdp = self.driver.cdp();
        cdp.send_raw("Page.addScriptToEvaluateOnNewDocument", script)
            .await
            .unwrap();
    }

    /// The recorded layout shifts: each element with its places before and after the shift.
    pub async fn shifts(&self) -> Value {
        self.value("JSON.parse(sessionStorage.getItem('shifts') ?? '[]')")
            .await
    }

    /// Emulates a screen of this size in pixels, light or dark.
    pub async fn resize(&self, width: u32, height: u32, dark: bool) {
        self.zoom((width, height), 1, dark).await;
    }

    /// Emulates a zoomed screen of this size in pixels. The driver cannot press the browser's zoom keys, which have the same
    /// effect on a page: fewer pixels in each direction, each drawn with more pixels of the screen.
    pub async fn zoom(&self, (width, height): (u32, u32), times: u32, dark: bool) {
        let cdp = self.driver.cdp();
        let (width, height) = (width / times, height / times);
        let metrics =
            json!({ "width": width, "height": height, "deviceScaleFactor": times, "mobile": false });
        cdp.send_raw("Emulation.setDeviceMetricsOverride", metrics)
            .await
            .unwrap();
        let scheme = if dark { "dark" } else { "light" };
        let media = json!({ "features": [{ "name": "prefers-color-scheme", "value": scheme }] });
        cdp.send_raw("Emulation.setEmulatedMedia", media).await.unwrap();
    }

    /// Clicks a download link, waits for the whole file, and returns it as text.
    pub async fn download(&self, selector: &str, file: &str) -> String {
        let folder = tempfile::tempdir().unwrap();
        let to = json!({ "behavior": "allow", "downloadPath": folder.path() });
        let cdp = self.driver.cdp();
        cdp.send_raw("Browser.setDownloadBehavior", to).await.unwrap();
        self.click(selector).await;
        let begun = Instant::now();
        loop {
            // The browser may reserve the name with an empty file; it moves the file to this name once it is complete.
            match fs::read_to_string(folder.path().join(file)) {
                Ok(text) if !text.is_empty() => return text,
                _ => {}
            }
            assert!(begun.elapsed() < DRIVER_TIMEOUT, "{file} never came");
            tokio::time::sleep(POLL_INTERVAL).await;
        }
    }

    /// Switches the page between paper and screen.
    pub async fn print(&self, prints: bool) {
        let media = json!({ "media": if prints { "print" } else { "" } });
        let cdp = self.driver.cdp();
        cdp.send_raw("Emulation.setEmulatedMedia", media).await.unwrap();
    }

    /// Disables scripts on all pages from now on.
    pub async fn without_scripts(&self) {
        let cdp = self.driver.cdp();
        cdp.send_raw("Emulation.setScriptExecutionDisabled", json!({ "value": true }))
            .await
            .unwrap();
    }

    /// Stores a picture of the whole page in `target/screenshots`.
    pub async fn picture(&self, name: &str) {
        let asked = json!({ "format": "png", "captureBeyondViewport": true });
        let answer = self.driver.cdp().send_raw("Page.captureScreenshot", asked).await;
        let answer = answer.unwrap();
        let data = answer["data"].as_str().unwrap();
        let bytes = base64::Engine::decode(&base64::engine::general_purpose::STANDARD, data).unwrap();
        let folder = screenshots();
        fs::create_dir_all(&folder).unwrap();
        fs::write(folder.join(format!("{name}.png")), bytes).unwrap();
    }

    /// Closes the window; panics if a script failed on any of its pages.
    pub async fn close(self) {
        let log = self.driver.browser_log().await.unwrap();
        let failed: Vec<_> = log
            .iter()
            .filter(|entry| entry.source.as_deref() == Some("javascript"))
            .collect();
        assert!(failed.is_empty(), "scripts failed: {failed:?}");
        self.driver.quit().await.unwrap();
    }
}

fn screenshots() -> PathBuf {
    // target/PROFILE/deps/TEST -> target/screenshots
    let test = std::env::current_exe().unwrap();
    test.ancestors().nth(3).unwrap().join("screenshots")
}
