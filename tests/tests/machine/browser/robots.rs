//! Tests the editor of robots, on the page Play and on the page for a new campaign.

use crate::browser::{
    driver::{Driver, Window},
    looks::{SIZES, check},
};
use murmuration_tests::Cluster;
use serde_json::json;
use std::f64::consts::PI;

/// Script: the text that the editor writes.
const TEXT: &str = "document.getElementById('robot').value";
const QUERY: &str = "Object.fromEntries(new URLSearchParams(location.search))";
/// Script: the labels of the editor's fields, with their values.
const FIELDS: &str = "Object.fromEntries([...document.querySelectorAll('.robot-fields label:not(.box)')] \
    .map((label) => [label.firstChild.data.trim(), label.control.value]))";

/// Drags the handle of the selected sensor that is drawn at one place to another place. A place is an angle in degrees and a
/// distance, in units of the drawing.
async fn drag(window: &Window, handle: &str, to: (f64, f64)) {
    let selector = format!(".handle.{handle}");
    let script = format!(
        "(() => {{ const h = document.querySelector('{selector}'); return [h.cx.baseVal.value, h.cy.baseVal.value, h.ownerSVGElement.clientWidth]; }})()"
    );
    let drawn = window.value(&script).await;
    let number = |place: usize| drawn[place].as_f64().unwrap();
    // The drawing has 260 units, and a border of one pixel.
    let pixel = |x: f64| 1.0 + (x + 130.0) / 260.0 * number(2);
    let (angle, distance) = (to.0 * PI / 180.0, to.1);
    let to = (distance * angle.cos(), distance * angle.sin());
    let line = [
        (pixel(number(0)), pixel(number(1))),
        (pixel(to.0 - 3.0), pixel(to.1 - 3.0)),
        (pixel(to.0), pixel(to.1)),
    ];
    window.draw("#robot-editor svg", &line).await;
}

/// Writes into the field with this label.
async fn write(window: &Window, label: &str, value: &str) {
    let script = format!(
        "const label = [...document.querySelectorAll('.robot-fields label')].find((label) => label.textContent.trim().startsWith({label:?})); \
         label.control.value = {value:?}; \
         for (const kind of ['input', 'change']) label.control.dispatchEvent(new Event(kind, {{ bubbles: true }}))"
    );
    window.driver.execute(script, vec![]).await.unwrap();
}

pub async fn a_sensor_is_dragged_and_its_text_follows() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let driver = Driver::start();
    let window = driver.open(&format!("{}/play", cluster.url())).await;
    window.until(&format!("{QUERY}.genes")).await;
    window.click(".described summary").await;
    window.until("document.querySelector('.handle.direction')").await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("robot-editor-{width}-{scheme}")).await;
            check(&window, "robot-editor").await;
        }
    }
    window.resize(1280, 900, false).await;
    drag(&window, "direction", (45.0, 112.0)).await;
    window
        .until(&format!("{TEXT}.includes('{{ angle = 0.7854 }},')"))
        .await;
    assert_eq!(window.value(FIELDS).await["Angle, degrees"], json!("45"));
    // The handles are sliders.
    window.focus(".handle.direction").await;
    window.press("\u{e014}").await;
    window
        .until(&format!("{TEXT}.includes('{{ angle = 0.8029 }},')"))
        .await;
    assert_eq!(
        window
            .value("document.activeElement.getAttribute('aria-valuetext')")
            .await,
        json!("46 degrees")
    );
    drag(&window, "range", (46.0, 44.0)).await;
    window
        .until(&format!("{TEXT}.includes('angle = 0.8029, range = 25 }}')"))
        .await;
    // A robot with the same genes keeps its controller.
    slide_first_gene(&window).await;
    window.click(".described form button").await;
    window
        .until(&format!(
            "{QUERY}.robot?.includes('range = 25') && {QUERY}.genes?.startsWith('0.25,')"
        ))
        .await;

    fields_do_what_handles_do(&window).await;
    the_robot_goes_to_a_new_campaign(&window).await;
    window.close().await;
    cluster.stop().await;
}

/// Fields do what handles do; the unit of angles stays chosen.
async fn fields_do_what_handles_do(window: &Window) {
    window.click(".described summary").await;
    window.until("document.querySelector('.handle.direction')").await;
    write(window, "Half angle of the cone", "30").await;
    window
        .until(&format!("{TEXT}.includes('half_angle = 0.5236')"))
        .await;
    // More than half a turn, and a whole turn, stay what they are.
    for (degrees, radians) in [("270", "4.7124"), ("360", "6.283185307179586"), ("46", "0.8029")] {
        write(window, "Angle, degrees", degrees).await;
        window
            .until(&format!("{TEXT}.includes('angle = {radians},')"))
            .await;
    }
    write(window, "Half angle of the cone", "200").await;
    let told = window.text(".robot-editor .status").await;
    assert!(told.contains("must be a number from 0 to 180"), "{told}");
    write(window, "Angles in", "radians").await;
    window.driver.refresh().await.unwrap();
    window.click(".described summary").await;
    window
        .until(&format!("{FIELDS}['Angle, radians'] === '0.8029'"))
        .await;
    window
        .click(".robot-editor .drawn .plain:nth-last-of-type(2)")
        .await;
    write(window, "Sees", "no robots").await;
    window.until(&format!("{TEXT}.includes('{{}},')")).await;
    window.click(".robot-editor .box input").await;
    write(window, "Sees", "no robots").await;
    window
        .until(&format!(
            "/wall_range = \\d+, sees = \\[\"walls\"\\]/.test({TEXT})"
        ))
        .await;
}

async fn the_robot_goes_to_a_new_campaign(window: &Window) {
    let written = window.value(TEXT).await;
    window.click(".robot-editor a.button").await;
    window
        .until("location.pathname === '/new' && document.querySelector('.handle.direction')")
        .await;
    assert_eq!(window.value(TEXT).await, written);
    assert_eq!(
        window.value("document.getElementById('model').value").await,
        json!("")
    );
    let cost = "document.getElementById('outcome').textContent.includes('What it costs')";
    window.until(cost).await;
    for (width, height) in SIZES {
        for dark in [false, true] {
            window.resize(width, height, dark).await;
            let scheme = if dark { "dark" } else { "light" };
            window.picture(&format!("new-robot-{width}-{scheme}")).await;
            check(window, "new-robot").await;
        }
    }
}

async fn slide_first_gene(window: &Window) {
    let script = "const gene = document.getElementById('gene-0'); gene.value = '0.25'; \
        for (const kind of ['input', 'change']) gene.dispatchEvent(new Event(kind, { bubbles: true }))";
    window.driver.execute(script, vec![]).await.unwrap();
    window.until(&format!("{QUERY}.genes?.startsWith('0.25,')")).await;
}

pub async fn what_an_editor_of_robots_cannot_show_is_kept() {
    const SPECIES: &str = "# Two species\nratios = [[3, 3], [2, 4]]\n[world]\nwidth = 700.0\n[[species]]\nname = \"prey\"\n\
        robot.sensors = [{ sees = \"predator\" }] # flees\n[[species]]\nname = \"predator\"\nmodel = \"single-sensor\"\n";
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let driver = Driver::start();
    let window = driver.open(&format!("{}/play", cluster.url())).await;
    let go = format!("location.href = '/play?' + new URLSearchParams({{ robot: {SPECIES:?} }})");
    window.driver.execute(go, vec![]).await.unwrap();
    window
        .until(&format!("{QUERY}.robot && document.querySelector('.described')"))
        .await;
    window.click(".described summary").await;
    window
        .until("document.querySelector('.robot-editor .status').textContent.includes('comments')")
        .await;
    assert_eq!(window.value(FIELDS).await["Sees"], json!("species predator"));
    write(&window, "Range", "80").await;
    window
        .until(&format!("{TEXT}.includes('range = 80, sees = \"predator\"')"))
        .await;
    let text = window.value(TEXT).await.as_str().unwrap().to_owned();
    for kept in [
        "# Two species\nratios = [[3, 3], [2, 4]]\n",
        "[world]\nwidth = 700.0\n",
    ] {
        assert!(text.contains(kept), "{text}");
    }
    assert!(!text.contains("flees"), "{text}");
    window.click(".robot-editor .numbers .plain").await;
    window.until(&format!("{TEXT} === {SPECIES:?}")).await;
    // A text with an error waits, and is not changed.
    let break_it = "const text = document.getElementById('robot'); text.value = text.value.replace('sees', 'fov'); \
         text.dispatchEvent(new Event('input', { bubbles: true }))";
    window.driver.execute(break_it, vec![]).await.unwrap();
    window
        .until("document.querySelector('.robot-fields').inert && document.querySelector('.robot-editor .status').textContent.includes('half of the field of view')")
        .await;
    window.close().await;
    cluster.stop().await;
}
