//! The axes of SVG plots.

use crate::svg::{GRID, INK, MUTED, tenth};
use maud::{Markup, html};

/// A rectangle of a drawing, with a scale of values in each direction.
#[derive(Debug, Clone, Copy)]
pub struct Axes {
    /// Left and right edge of the rectangle, in pixels.
    pub across: [f64; 2],
    /// Upper and lower edge of the rectangle, in pixels.
    pub down: [f64; 2],
    /// The values at the left and right edge.
    pub x: [f64; 2],
    /// The values at the lower and upper edge.
    pub y: [f64; 2],
}

/// The numbers along an axis, and the title of the axis.
#[derive(Debug, Clone)]
pub struct Scale<'a> {
    /// Name of the quantity.
    pub title: &'a str,
    /// The numbers along the axis, ascending.
    pub ticks: Vec<f64>,
    /// The unit that follows each number.
    pub unit: &'a str,
}

impl Axes {
    /// The pixel of a point, x to the right and y down.
    pub fn at(&self, x: f64, y: f64) -> [f64; 2] {
        let place = |value: f64, [low, high]: [f64; 2], [from, to]: [f64; 2]| {
            tenth(from + (value - low) / (high - low) * (to - from))
        };
        let [top, bottom] = self.down;
        [place(x, self.x, self.across), place(y, self.y, [bottom, top])]
    }

    /// The points of a line, in the format of the attribute `points` of a `polyline`.
    pub fn line(&self, points: impl IntoIterator<Item = (f64, f64)>) -> String {
        let pixel = |(x, y)| {
            let [x, y] = self.at(x, y);
            format!("{x},{y}")
        };
        points.into_iter().map(pixel).collect::<Vec<_>>().join(" ")
    }

    /// Draws the axes with their numbers and titles. `grid` adds a horizontal line at each number of the vertical axis.
    pub fn draw(&self, [x, y]: [&Scale<'_>; 2], grid: bool) -> Markup {
        let ([left, right], [top, bottom]) = (self.across, self.down);
        let number = |tick: f64, [low, high]: [f64; 2], unit| axis_number(tick, high - low) + unit;
        let middle = f64::midpoint(top, bottom);
        html! {
            g stroke=(GRID) {
                line x1=(left) x2=(left) y1=(top) y2=(bottom) {}
                line x1=(left) x2=(right) y1=(bottom) y2=(bottom) {}
                @for [at, _] in x.ticks.iter().map(|tick| self.at(*tick, self.y[0])) {
                    line x1=(at) x2=(at) y1=(bottom) y2=(bottom + 5.0) {}
                }
                @for [_, at] in y.ticks.iter().map(|tick| self.at(self.x[0], *tick)) {
                    line x1=(left - 5.0) x2=(if grid { right } else { left }) y1=(at) y2=(at) {}
                }
            }
            g fill=(MUTED) {
                g text-anchor="middle" {
                    @for tick in &x.ticks {
                        text x=(self.at(*tick, self.y[0])[0]) y=(bottom + 20.0) { (number(*tick, self.x, x.unit)) }
                    }
                }
                g text-anchor="end" {
                    @for tick in &y.ticks {
                        text x=(left - 9.0) y=(self.at(self.x[0], *tick)[1] + 5.0) { (number(*tick, self.y, y.unit)) }
                    }
                }
            }
            g fill=(INK) text-anchor="middle" {
                text x=(f64::midpoint(left, right)) y=(bottom + 40.0) { (x.title) }
                text x="16" y=(middle) transform={ "rotate(-90 16 " (middle) ")" } { (y.title) }
            }
        }
    }
}

/// Round numbers from `low` to `high`, at most `most` + 1, with distances of at least `least`.
pub fn ticks([low, high]: [f64; 2], most: u32, least: f64) -> Vec<f64> {
    let rough = (high - low) / f64::from(most);
    let power = 10f64.powf(rough.log10().floor());
    let steps = [1.0, 2.0, 5.0, 10.0].map(|digit| digit * power);
    let step = steps
        .into_iter()
        .find(|step| *step >= rough)
        .unwrap_or(rough)
        .max(least);
    let first = (low / step).ceil();
    (0..=most)
        .map(|place| (first + f64::from(place)) * step)
        .take_while(|tick| *tick <= high)
        .collect()
}

/// A tick nearer to zero than this fraction of the axis is zero with a rounding error.
const NEAR: f64 = 1e-9;

/// The number at a tick of an axis that is `span` long. It has enough decimals to distinguish neighbouring ticks and no trailing
/// zeros; very long and very short axes have powers of ten.
fn axis_number(value: f64, span: f64) -> String {
    if value.abs() <= span * NEAR {
        return "0".to_owned();
    }
    if !(1e-3..1e6).contains(&span) {
        let text = format!("{value:.3e}");
        return match text.split_once('e') {
            Some((digits, power)) => format!("{}e{power}", without_noughts(digits)),
            None => text,
        };
    }
    // Numbers have four decimals, and up to six on an axis shorter than 0.1.
    let decimals = (3.0 - span.log10().floor()).clamp(4.0, 6.0) as usize;
    without_noughts(&format!("{value:.decimals$}")).to_owned()
}

/// Removes trailing zeros.
fn without_noughts(digits: &str) -> &str {
    if digits.contains('.') {
        digits.trim_end_matches('0').trim_end_matches('.')
    } else {
        digits
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within() {
        for (ends, most, least, expected) in [
            ([0.0, 10.0], 5, 0.0, &[0.0, 2.0, 4.0, 6.0, 8.0, 10.0][..]),
            ([0.0, 3.0], 10, 1.0, &[0.0, 1.0, 2.0, 3.0]),
            ([-0.3, 0.5], 4, 0.0, &[-0.2, 0.0, 0.2, 0.4]),
            ([0.0, 1e-300], 2, 0.0, &[0.0, 5e-301, 1e-300]),
            ([0.0, 1e300], 2, 0.0, &[0.0, 5e299, 1e300]),
            ([7.0, 7.0], 5, 0.0, &[]),
        ] {
            let ticks = ticks(ends, most, least);
            assert_eq!(ticks.len(), expected.len(), "{ticks:?}");
            let off = |(tick, expected): (&f64, &f64)| (tick - expected).abs() > 1e-12 * expected.abs();
            assert!(!ticks.iter().zip(expected).any(off), "{ticks:?}");
        }
    }

    #[test]
    fn values_are_at_their_pixels() {
        let axes = Axes {
            across: [10.0, 110.0],
            down: [20.0, 70.0],
            x: [0.0, 4.0],
            y: [-1.0, 1.0],
        };
        assert_eq!(axes.at(0.0, -1.0), [10.0, 70.0]);
        assert_eq!(axes.at(1.0, 1.0), [35.0, 20.0]);
        assert_eq!(axes.line([(0.0, -1.0), (4.0, 0.0)]), "10,70 110,45");
    }

    #[test]
    fn numbers_are_short_and_neighbours_differ() {
        for (value, span, expected) in [
            (0.0, 1.0, "0"),
            (-2e-16, 1.0, "0"),
            (2e-16, 1e-15, "2e-16"),
            (-0.25, 2.0, "-0.25"),
            (0.1 + 0.2, 1.0, "0.3"),
            (0.005, 0.01, "0.005"),
            (0.000_25, 0.002, "0.00025"),
            (0.002_5, 0.02, "0.0025"),
            (2.5e-5, 1e-4, "2.5e-5"),
            (1200.0, 5000.0, "1200"),
            (2.5e300, 1e301, "2.5e300"),
            (10.0, 100.0, "10"),
        ] {
            assert_eq!(axis_number(value, span), expected);
        }
    }
}
