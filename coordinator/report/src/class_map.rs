//! A map of points in the colours of their classes with a legend, fit for a paper: as SVG and as PNG.

use crate::{
    picture::PictureError,
    point_map::places,
    raster,
    svg::{Drawing, GRID, MUTED, WHITE, tenth},
};
use maud::html;
use murmuration_model::colours::{self, class_colour};
use murmuration_proto::{Class, grouped};

/// A point with its class.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClassPoint {
    /// Where it is: right and up, in any unit; finite.
    pub at: [f64; 2],
    /// What it is.
    pub class: Class,
}

/// Side of the map, room around it for title and legend, and diameter of a point; pixels.
const SIDE: f64 = 640.0;
const TOP: f64 = 44.0;
const LEGEND: f64 = 190.0;
const DOT: f64 = 4.0;
/// Pixels of the PNG for one of the SVG.
const PNG_SCALE: f32 = 2.0;

/// The map as SVG. A unit is as long across as it is up.
#[must_use]
pub fn svg(points: &[ClassPoint], title: &str) -> String {
    let at: Vec<[f64; 2]> = points.iter().map(|point| point.at).collect();
    let places = places(&at, SIDE);
    let of_class = |class: Class| {
        points
            .iter()
            .zip(&places)
            .filter(move |(point, _)| point.class == class)
    };
    let path = |class: Class| -> String {
        let dot = |(_, [x, y]): (&ClassPoint, &[f64; 2])| format!("M{} {}h0", tenth(*x), tenth(y + TOP));
        of_class(class).map(dot).collect()
    };
    let drawing = Drawing {
        size: [SIDE + LEGEND, SIDE + TOP],
        font_size: 14,
        title,
        label: None,
        paper: WHITE,
        shrinks: true,
    };
    let content = html! {
        text x="12" y="28" font-size="17" font-weight="bold" { (title) }
        rect x="0.5" y=(TOP) width=(SIDE) height=(SIDE - 0.5) fill="none" stroke=(GRID) {}
        @for class in in_order() {
            path d=(path(class)) stroke=(colours::hex(class_colour(class))) stroke-width=(DOT) stroke-linecap="round" fill="none" {}
        }
        @for (place, class) in Class::ALL.into_iter().filter(|&class| of_class(class).next().is_some()).enumerate() {
            @let y = TOP + 18.0 + 24.0 * place as f64;
            circle cx=(SIDE + 20.0) cy=(y) r="6" fill=(colours::hex(class_colour(class))) {}
            text x=(SIDE + 34.0) y=(y + 5.0) {
                (class.words()) " " tspan fill=(MUTED) { (grouped(of_class(class).count() as u64)) }
            }
        }
    };
    drawing.with(&content).into_string()
}

/// A map that [`svg`] made, as PNG.
///
/// # Errors
/// [`PictureError`] if it cannot be drawn.
pub fn png(svg: &str) -> Result<Vec<u8>, PictureError> {
    raster::png(svg, PNG_SCALE)
}

/// Classes as they are drawn: what is random lies below the others.
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
        let (width, height, pixels) = decode_png(&png(&svg(&points(), "A map")).unwrap());
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
        let svg = svg(&points, "A & B");
        assert!(svg.contains("A &amp; B") && svg.contains("dispersal") && !svg.contains("aggregation"));
        assert_eq!(svg.matches("h0").count(), 5);
        let counts: Vec<&str> = svg
            .split("</tspan>")
            .filter_map(|part| part.rsplit_once("<tspan fill=\"#5f5e58\">"))
            .map(|(_, count)| count)
            .collect();
        // In the order of the classes: milling, dispersal, random.
        assert_eq!(counts, ["1", "3", "1"]);
    }
}
