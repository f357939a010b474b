//! The poster of an atlas: the picture with axes and a legend.

use super::{Atlas, Layout, Tally};
use crate::figure::{Anchor, Figure, INK, MUTED, Shape, Unit, Words};
use murmuration_model::colours::{self, Rgb};
use murmuration_swarm::{Class, grouped};

/// Side of the picture, and the margins around it.
const SIDE: f64 = 1323.0;
const LEFT: f64 = 110.0;
const TOP: f64 = 120.0;
const LEGEND: f64 = 430.0;
const BOTTOM: f64 = 90.0;

/// PNG pixels per SVG unit of the poster. The poster is 3,726 pixels wide, which is 319 dots per inch on A4 paper in landscape.
pub(super) const PNG_SCALE: f32 = 2.0;

/// The poster of the picture with these pixels.
pub(super) fn poster(atlas: &Atlas, layout: &Layout, tallies: &[Tally], pixels: Vec<Rgb>) -> Figure {
    let starts = atlas.spec.starts().get();
    let title = format!("Every controller of the robot {}", atlas.spec.model());
    let subtitle = format!(
        "{} controllers, {} of them simulated from {starts} starts each, the others mirror images",
        grouped((layout.side() * layout.side()) as u64),
        grouped(atlas.entries.len() as u64)
    );
    let mut shapes = vec![
        Shape::Words(Words {
            bold: true,
            ..words(title.clone(), [LEFT, 52.0], 34.0)
        }),
        Shape::Words(Words {
            colour: MUTED,
            ..words(subtitle, [LEFT, 90.0], 20.0)
        }),
        Shape::Picture {
            at: [LEFT, TOP],
            side: SIDE,
            pixels,
        },
    ];
    shapes.extend(axes(atlas, layout).into_iter().map(Shape::Words));
    shapes.extend(legend(atlas, layout, tallies));
    Figure {
        size: [LEFT + SIDE + LEGEND, TOP + SIDE + BOTTOM],
        unit: Unit::Pixel,
        title,
        paper: colours::PAPER,
        shapes,
    }
}

/// Dark text that begins at a position.
fn words(text: String, at: [f64; 2], size: f64) -> Words {
    Words {
        text,
        at,
        size,
        anchor: Anchor::Start,
        colour: INK,
        bold: false,
        upwards: false,
    }
}

/// The axes of the tiles: the speeds while a robot sees nothing.
fn axes(atlas: &Atlas, layout: &Layout) -> Vec<Words> {
    let tile = SIDE / layout.values() as f64;
    let every = (layout.values() / 10).max(1);
    let centred = |text, at, size| Words {
        anchor: Anchor::Middle,
        ..words(text, at, size)
    };
    let marks = |speeds: &[f64], at: fn(f64) -> [f64; 2]| {
        let places = speeds.iter().enumerate().step_by(every);
        let mark =
            |(place, speed): (usize, &f64)| centred(rounded(*speed), at((place as f64 + 0.5) * tile), 17.0);
        places.map(mark).collect::<Vec<_>>()
    };
    let [right, up, ..] = layout.speeds();
    let mut all = marks(right, |along| [LEFT + along, TOP + SIDE + 26.0]);
    all.extend(marks(up, |along| [LEFT - 28.0, TOP + SIDE - along + 6.0]));
    let names = atlas.spec.model().gene_names();
    let titled = |name: &str| format!("{name}, while nothing is seen: tiles");
    all.push(centred(
        titled(&names[0]),
        [LEFT + SIDE / 2.0, TOP + SIDE + 62.0],
        21.0,
    ));
    all.push(Words {
        upwards: true,
        ..centred(titled(&names[1]), [34.0, TOP + SIDE / 2.0], 21.0)
    });
    all
}

/// A speed, rounded for people.
fn rounded(speed: f64) -> String {
    format!("{}", (speed * 100.0).round() / 100.0)
}

/// The classes with their colours, each with the number of controllers whose most frequent class it is.
fn legend(atlas: &Atlas, layout: &Layout, tallies: &[Tally]) -> Vec<Shape> {
    let x = LEFT + SIDE + 34.0;
    let counts = counts(atlas, layout, tallies);
    let all: u64 = counts.iter().map(|(_, count)| count).sum();
    let names = atlas.spec.model().gene_names();
    let (to_the_right, up) = (&names[2], &names[3]);
    let explanation = [
        "Within each tile, a pixel for each pair of".to_owned(),
        "speeds while something is seen:".to_owned(),
        format!("{to_the_right} to the right, {up} up."),
        String::new(),
        "Colour: what the judge calls most of the".to_owned(),
        "starts. Brightness: the share of the starts".to_owned(),
        "that it calls so, times how often the".to_owned(),
        "annotators of labelled sets agree with it.".to_owned(),
    ];
    let of_class = |(place, (class, count)): (usize, &(Class, u64))| {
        let y = TOP + 20.0 + 58.0 * place as f64;
        let share = 100.0 * *count as f64 / all.max(1) as f64;
        let counted = format!("{} controllers, {share:.1} %", grouped(*count));
        [
            Shape::Dots {
                centres: vec![[x + 15.0, y + 15.0]],
                diameter: 30.0,
                colour: colours::class_colour(*class),
            },
            Shape::Words(Words {
                bold: true,
                ..words(class.words().to_owned(), [x + 44.0, y + 13.0], 19.0)
            }),
            Shape::Words(Words {
                colour: MUTED,
                ..words(counted, [x + 44.0, y + 34.0], 16.0)
            }),
        ]
    };
    let explained = explanation.into_iter().enumerate().map(|(place, line)| {
        let y = TOP + 540.0 + 26.0 * place as f64;
        Shape::Words(words(line, [x, y], 18.0))
    });
    counts
        .iter()
        .enumerate()
        .flat_map(of_class)
        .chain(explained)
        .collect()
}

/// Number of controllers in the picture by their most frequent class, mirror images included, in descending order.
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
