//! The poster: the picture with axes and a legend, as SVG, which prints at any size.

use super::{Atlas, Layout, Tally};
use crate::svg::{Drawing, MUTED};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use maud::{Markup, html};
use murmuration_model::colours;
use murmuration_proto::{Class, grouped};

/// Side of the picture, and the room around it.
const SIDE: f64 = 1323.0;
const LEFT: f64 = 110.0;
const TOP: f64 = 120.0;
const LEGEND: f64 = 430.0;
const BOTTOM: f64 = 90.0;

/// Pixels of the poster as PNG for a unit of its SVG: 3,726 pixels across, 319 dots an inch on a page of A4 on its side.
pub(super) const PNG_SCALE: f32 = 2.0;

/// Pixels that each controller's side has in the picture, which some programs blur where they enlarge it.
pub(super) fn scale(layout: &Layout) -> usize {
    (SIDE as usize).div_ceil(layout.side())
}

/// The poster, with the picture at its scale.
pub(super) fn svg(atlas: &Atlas, layout: &Layout, tallies: &[Tally], map: &[u8]) -> String {
    let (width, height) = (LEFT + SIDE + LEGEND, TOP + SIDE + BOTTOM);
    let picture = format!("data:image/png;base64,{}", STANDARD.encode(map));
    let starts = atlas.spec.starts().get();
    let title = format!("Every controller of the robot {}", atlas.spec.model());
    let subtitle = format!(
        "{} controllers, {} of them simulated from {starts} starts each, the others mirror images",
        grouped((layout.side() * layout.side()) as u64),
        grouped(atlas.entries.len() as u64)
    );
    let drawing = Drawing {
        size: [width, height],
        font_size: 16,
        title: &title,
        label: None,
        paper: &colours::hex(colours::PAPER),
        shrinks: true,
    };
    let content = html! {
        text x=(LEFT) y="52" font-size="34" font-weight="bold" { (title) }
        text x=(LEFT) y="90" font-size="20" fill=(MUTED) { (subtitle) }
        image x=(LEFT) y=(TOP) width=(SIDE) height=(SIDE) href=(picture) style="image-rendering: pixelated" {}
        (axes(atlas, layout))
        (legend(atlas, layout, tallies))
    };
    drawing.with(&content).into_string()
}

/// The speeds while nothing is seen, which tiles go by.
fn axes(atlas: &Atlas, layout: &Layout) -> Markup {
    let tile = SIDE / layout.values() as f64;
    let every = (layout.values() / 10).max(1);
    let [right, up, ..] = layout.speeds();
    let marks = |speeds: &[f64]| -> Vec<(f64, String)> {
        let places = speeds.iter().enumerate().step_by(every);
        places
            .map(|(place, speed)| ((place as f64 + 0.5) * tile, rounded(*speed)))
            .collect()
    };
    let turned = format!("rotate(-90 34 {})", TOP + SIDE / 2.0);
    html! {
        g font-size="17" text-anchor="middle" {
            @for (along, speed) in marks(right) {
                text x=(LEFT + along) y=(TOP + SIDE + 26.0) { (speed) }
            }
            @for (along, speed) in marks(up) {
                text x=(LEFT - 28.0) y=(TOP + SIDE - along + 6.0) { (speed) }
            }
            text x=(LEFT + SIDE / 2.0) y=(TOP + SIDE + 62.0) font-size="21" { (atlas.spec.model().gene_names()[0]) ", while nothing is seen: tiles" }
            text x="34" y=(TOP + SIDE / 2.0) font-size="21" transform=(turned) { (atlas.spec.model().gene_names()[1]) ", while nothing is seen: tiles" }
        }
    }
}

/// A speed as people read it.
fn rounded(speed: f64) -> String {
    format!("{}", (speed * 100.0).round() / 100.0)
}

/// The classes with their colours, and of how many controllers each is the most frequent one.
fn legend(atlas: &Atlas, layout: &Layout, tallies: &[Tally]) -> Markup {
    let x = LEFT + SIDE + 34.0;
    let counts = counts(atlas, layout, tallies);
    let all: u64 = counts.iter().map(|(_, count)| count).sum();
    let names = atlas.spec.model().gene_names();
    let (to_the_right, up) = (&names[2], &names[3]);
    let words = [
        "Within each tile, a pixel for each pair of".to_owned(),
        "speeds while something is seen:".to_owned(),
        format!("{to_the_right} to the right, {up} up."),
        String::new(),
        "Colour: what the judge calls most of the".to_owned(),
        "starts. Brightness: the share of the starts".to_owned(),
        "that it calls so, times how often people".to_owned(),
        "agree with it.".to_owned(),
    ];
    html! {
        g font-size="19" {
            @for (place, (class, count)) in counts.iter().enumerate() {
                @let y = TOP + 20.0 + 58.0 * place as f64;
                rect x=(x) y=(y) width="30" height="30" rx="4" fill=(colours::hex(colours::class_colour(*class))) {}
                text x=(x + 44.0) y=(y + 13.0) font-weight="bold" { (class.words()) }
                text x=(x + 44.0) y=(y + 34.0) fill=(MUTED) font-size="16" {
                    (grouped(*count)) " controllers, " (format!("{:.1}", 100.0 * *count as f64 / all.max(1) as f64)) " %"
                }
            }
            @for (place, line) in words.iter().enumerate() {
                text x=(x) y=(TOP + 540.0 + 26.0 * place as f64) font-size="18" { (line) }
            }
        }
    }
}

/// Of how many controllers of the picture each class is the most frequent one, mirror images included; the largest
/// first.
fn counts(atlas: &Atlas, layout: &Layout, tallies: &[Tally]) -> Vec<(Class, u64)> {
    let places = layout.places(atlas);
    let class = |class: Class| {
        let of_it = places
            .iter()
            .flatten()
            .filter(|place| tallies[place.entry as usize].class == class);
        (class, of_it.count() as u64)
    };
    let mut counts: Vec<_> = Class::ALL.into_iter().map(class).collect();
    counts.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    counts
}
