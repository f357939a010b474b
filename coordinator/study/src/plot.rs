//! The plot of a table: for each row the mean of a figure, its spread, the judge's errors, and the published figure.

use crate::{
    figure::Figure,
    tables::{Entry, Row},
};
use maud::{Markup, html};
use murmuration_report::{axes::ticks, svg::tenth};

/// Width of the plot and of the names of its rows; height of a row and of the axis; pixels.
pub(crate) const WIDTH: f64 = 900.0;
pub(crate) const NAMES: f64 = 330.0;
pub(crate) const ROW: f64 = 30.0;
pub(crate) const AXIS: f64 = 46.0;
/// Free pixels beside the smallest and the largest value.
pub(crate) const MARGIN: f64 = 24.0;

/// The plot of a figure; empty if no row has the figure. `name` returns the name of a row.
pub(crate) fn dots(rows: &[Row], figure: Figure, name: impl Fn(&Row) -> String) -> Markup {
    let shown: Vec<(&Row, &Entry)> = rows
        .iter()
        .filter_map(|row| Some((row, row.entries.get(&figure)?)))
        .collect();
    let Some(scale) = Scale::of(shown.iter().map(|(_, entry)| *entry)) else {
        return html! {};
    };
    let height = shown.len() as f64 * ROW + AXIS;
    html! {
        svg.plot viewBox={ "0 0 " (WIDTH) " " (height) } role="img" aria-label={ (figure) ", by row" } {
            @for tick in ticks([scale.low, scale.high], 8, 0.0) {
                @let x = scale.x(tick);
                line.grid x1=(x) x2=(x) y1="0" y2=(height - AXIS) {}
                text.tick x=(x) y=(height - AXIS + 18.0) text-anchor="middle" { (number(tick)) }
            }
            text.tick x=(WIDTH - MARGIN) y=(height - 6.0) text-anchor="end" { (figure) }
            @for (place, (row, entry)) in shown.iter().enumerate() {
                @let y = (place as f64 + 0.5) * ROW;
                text.name x=(NAMES - 12.0) y=(y + 4.5) text-anchor="end" { (name(row)) }
                (marks(entry, &scale, y))
            }
        }
    }
}

fn marks(entry: &Entry, scale: &Scale, y: f64) -> Markup {
    let deviation = entry.deviation.unwrap_or_default();
    html! {
        @if let Some(resampled) = entry.resampled {
            rect.judge x=(scale.x(resampled.low)) y=(y - 8.0) height="16" rx="3"
                width=((scale.x(resampled.high) - scale.x(resampled.low)).max(1.0)) {}
        }
        line.spread x1=(scale.x(entry.mean - deviation)) x2=(scale.x(entry.mean + deviation)) y1=(y) y2=(y) {}
        circle.mean cx=(scale.x(entry.mean)) cy=(y) r="5" {}
        @if let Some(published) = entry.published {
            @let x = scale.x(published);
            path.published d={ "M" (x) " " (y - 7.0) "l7 7l-7 7l-7 -7z" } {}
        }
    }
}

/// Maps values to positions across the plot.
struct Scale {
    low: f64,
    high: f64,
}

impl Scale {
    /// The scale that shows these entries; `None` without finite values.
    fn of<'a>(entries: impl Iterator<Item = &'a Entry>) -> Option<Self> {
        let values: Vec<f64> = entries
            .flat_map(values)
            .filter(|value| value.is_finite())
            .collect();
        let low = values.iter().copied().reduce(f64::min)?;
        let high = values.iter().copied().reduce(f64::max)?;
        let room = if high > low { 0.0 } else { 0.5 };
        Some(Self {
            low: low - room,
            high: high + room,
        })
    }

    fn x(&self, value: f64) -> f64 {
        let share = (value - self.low) / (self.high - self.low);
        let x = NAMES + MARGIN + share * (WIDTH - NAMES - 2.0 * MARGIN);
        tenth(x)
    }
}

/// The values of an entry that the plot shows.
fn values(entry: &Entry) -> Vec<f64> {
    let deviation = entry.deviation.unwrap_or_default();
    let resampled = entry.resampled.map(|resampled| [resampled.low, resampled.high]);
    let mut values = vec![entry.mean - deviation, entry.mean + deviation];
    values.extend(resampled.into_iter().flatten());
    values.extend(entry.published);
    values
}

/// A tick's value without its rounding error.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// A table or plot that scrolls on narrow screens, also with keys; `name` distinguishes it from the other tables and plots of the
/// page.
pub fn wide(name: &str, content: &Markup) -> Markup {
    html! { div.wide tabindex="0" role="region" aria-label=(name) { (content) } }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_lowest_value_is_at_the_left_and_the_highest_at_the_right() {
        let scale = Scale { low: 0.0, high: 1.0 };
        assert_eq!(scale.x(0.0), NAMES + MARGIN);
        assert_eq!(scale.x(1.0), WIDTH - MARGIN);
        let shown = |tick: &f64| number(*tick);
        let numbers: Vec<String> = ticks([2.9, 6.1], 8, 0.0).iter().map(shown).collect();
        assert_eq!(numbers, ["3", "3.5", "4", "4.5", "5", "5.5", "6"]);
    }
}
