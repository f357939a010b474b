//! A map of points in the colours of their classes, with a legend, as SVG and as PNG; suitable for a paper.

use crate::{
    figure::{Anchor, Figure, GRID, INK, MUTED, Shape, Unit, Words},
    picture::PictureError,
    point_map::places,
};
use murmuration_model::colours::class_colour;
use murmuration_swarm::{Class, grouped};

/// A point with its class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassPoint {
    /// The point's coordinates, to the right and upwards, in any unit; finite.
    pub at: [f64; 2],
    /// The point's class.
    pub class: Class,
}

/// Side of the map, margins for title and legend, and diameter of a point; pixels.
const SIDE: f64 = 640.0;
const TOP: f64 = 44.0;
const LEGEND: f64 = 190.0;
const DOT: f64 = 4.0;
/// PNG pixels per SVG pixel.
const PNG_SCALE: f32 = 2.0;

/// The map as SVG and as PNG, with the same scale in both directions.
pub fn draw(points: &[ClassPoint], title: &str) -> Result<(String, Vec<u8>), PictureError> {
    let figure = figure(points, title);
    Ok((figure.svg()?, figure.png(PNG_SCALE)?))
}

fn figure(points: &[ClassPoint], title: &str) -> Figure {
    let at: Vec<[f64; 2]> = points.iter().map(|point| point.at).collect();
    let places = places(&at, SIDE);
    let of_class = |class: Class| -> Vec<[f64; 2]> {
        let points = points.iter().zip(&places);
        let points = points.filter(|(point, _)| point.class == class);
        points.map(|(_, [x, y])| [*x, y + TOP]).collect()
    };
    let words = |text: String, at: [f64; 2], anchor: Anchor| Words {
        text,
        at,
        anchor,
        size: 14.0,
        colour: INK,
        bold: false,
        upwards: false,
    };
    let dots = |class: Class, centres: Vec<[f64; 2]>, diameter: f64| Shape::Dots {
        centres,
        diameter,
        colour: class_colour(class),
    };
    let mut shapes = vec![
        Shape::Words(Words {
            size: 17.0,
            bold: true,
            ..words(title.to_owned(), [12.0, 28.0], Anchor::Start)
        }),
        Shape::Frame {
            at: [0.5, TOP],
            side: SIDE - 0.5,
            colour: GRID,
        },
    ];
    shapes.extend(in_order().map(|class| dots(class, of_class(class), DOT)));
    let there = Class::ALL.into_iter().map(|class| (class, of_class(class).len()));
    for (place, (class, count)) in there.filter(|(_, count)| *count > 0).enumerate() {
        let y = TOP + 18.0 + 24.0 * place as f64;
        shapes.push(dots(class, vec![[SIDE + 20.0, y]], 12.0));
        shapes.push(Shape::Words(words(
            class.words().to_owned(),
            [SIDE + 34.0, y + 5.0],
            Anchor::Start,
        )));
        shapes.push(Shape::Words(Words {
            colour: MUTED,
            ..words(
                grouped(count as u64),
                [SIDE + LEGEND - 14.0, y + 5.0],
                Anchor::End,
            )
        }));
    }
    Figure {
        size: [SIDE + LEGEND, SIDE + TOP],
        unit: Unit::Pixel,
        title: title.to_owned(),
        paper: [0xff; 3],
        shapes,
    }
}

/// Classes in the order of drawing: the points of random behaviours are drawn first, under the other points.
fn in_order() -> impl Iterator<Item = Class> {
    let others = Class::ALL.into_iter().filter(|class| *class != Class::Random);
    [Class::Random].into_iter().chain(others)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::decode_png;

    fn points() -> [ClassPoint; 3] {
        let point = |x: f64, y: f64, class: Class| ClassPoint { at: [x, y], class };
        [
            point(-1.0, 0.0, Class::Milling),
            point(1.0, 0.5, Class::Dispersal),
            point(1.0, 0.5, Class::Random),
        ]
    }

    #[test]
    fn random_behaviours_hide_no_other() {
        let (width, height, pixels) = decode_png(&draw(&points(), "A map").unwrap().1);
        assert_eq!(
            [width, height].map(f64::from),
            [2.0 * (SIDE + LEGEND), 2.0 * (SIDE + TOP)]
        );
        let at = points().map(|point| point.at);
        let [x, y] = places(&at, SIDE)[1];
        let [x, y] = [x, y + TOP].map(|pixel| (2.0 * pixel) as usize);
        let at = 3 * (y * width as usize + x);
        assert_eq!(pixels[at..at + 3], class_colour(Class::Dispersal));
    }

    #[test]
    fn the_legend_counts_what_there_is() {
        let mut points = points().to_vec();
        points.extend([points[1]; 2]);
        let (svg, _) = draw(&points, "A & B").unwrap();
        assert!(svg.contains("A &amp; B") && svg.contains("dispersal") && !svg.contains("aggregation"));
        // `h0` draws a dot: the map has five points, and the legend has a dot for each of three classes.
        assert_eq!(svg.matches("h0").count(), 5 + 3);
        let counts: Vec<&str> = svg
            .split("</text>")
            .filter(|text| text.contains("text-anchor=\"end\""))
            .filter_map(|text| text.rsplit('>').next())
            .collect();
        // The legend's counts are in the order of the classes: milling, dispersal, random.
        assert_eq!(counts, ["1", "3", "1"]);
    }
}
