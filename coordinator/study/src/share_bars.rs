//! The plot of the shares of classes: for each row a bar of the classes' colours, and the published share of `random`.

use crate::{
    figure::Figure,
    plot::{AXIS, NAMES, ROW, WIDTH},
    tables::Row,
};
use maud::{Markup, html};
use murmuration_model::colours::{self, class_colour};
use murmuration_report::svg::tenth;
use murmuration_swarm::Class;

/// Free pixels to the right of the bars.
const RIGHT: f64 = 24.0;
/// Height of a bar.
const BAR: f64 = 20.0;

/// The bars of the rows with shares; empty without such rows. `name` returns the name of a row.
pub(crate) fn bars(rows: &[Row], name: impl Fn(&Row) -> String) -> Markup {
    let shown: Vec<(&Row, Vec<Part>)> = rows
        .iter()
        .map(|row| (row, parts(row)))
        .filter(|(_, parts)| !parts.is_empty())
        .collect();
    if shown.is_empty() {
        return html! {};
    }
    let height = shown.len() as f64 * ROW + AXIS;
    html! {
        svg.plot viewBox={ "0 0 " (WIDTH) " " (height) } role="img" aria-label="shares of classes, by row" {
            @for percent in [0.0, 20.0, 40.0, 60.0, 80.0, 100.0] {
                line.grid x1=(x(percent)) x2=(x(percent)) y1="0" y2=(height - AXIS) {}
                text.tick x=(x(percent)) y=(height - AXIS + 18.0) text-anchor="middle" { (percent) }
            }
            text.tick x=(WIDTH - RIGHT) y=(height - 6.0) text-anchor="end" { "share of all trials, %" }
            @for (place, (row, parts)) in shown.iter().enumerate() {
                @let y = (place as f64 + 0.5) * ROW;
                text.name x=(NAMES - 12.0) y=(y + 4.5) text-anchor="end" { (name(row)) }
                @for part in parts {
                    rect x=(x(part.from)) y=(y - BAR / 2.0) height=(BAR) width=(tenth(x(part.to) - x(part.from)))
                        fill=(colours::hex(class_colour(part.class))) {
                        title { (part.class.words()) " " (format!("{:.1} %", part.to - part.from)) }
                    }
                }
                @if let Some(published) = row.entries.get(&Figure::Share(Class::Random)).and_then(|entry| entry.published) {
                    path.published d={ "M" (x(published)) " " (y - 7.0) "l7 7l-7 7l-7 -7z" } { title { "random, published: " (published) " %" } }
                }
            }
        }
    }
}

/// A legend of the classes in the rows.
pub(crate) fn legend(rows: &[Row]) -> Markup {
    let parts: Vec<Part> = rows.iter().flat_map(parts).collect();
    let classes = Class::ALL
        .into_iter()
        .filter(|class| parts.iter().any(|part| part.class == *class));
    html! {
        @for class in classes {
            span.key-class {
                svg viewBox="0 0 12 12" aria-hidden="true" { rect width="12" height="12" rx="2" fill=(colours::hex(class_colour(class))) {} }
                (class.words())
            }
        }
    }
}

/// A part of a bar, percent from its left end.
struct Part {
    class: Class,
    from: f64,
    to: f64,
}

/// The classes of a row in the order of the table. The class `random` comes first, where the plot marks its published share.
fn parts(row: &Row) -> Vec<Part> {
    let mut from = 0.0;
    let mut parts = Vec::new();
    for figure in crate::Measure::Shares.figures() {
        if let Figure::Share(class) = figure
            && let Some(entry) = row.entries.get(&figure).filter(|entry| entry.mean > 0.0)
        {
            let to = from + entry.mean;
            parts.push(Part { class, from, to });
            from = to;
        }
    }
    parts
}

fn x(percent: f64) -> f64 {
    tenth(NAMES + percent / 100.0 * (WIDTH - NAMES - RIGHT))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tables::Entry;

    #[test]
    fn the_parts_of_a_bar_follow_each_other_and_classes_that_nobody_saw_have_none() {
        let entry = |mean| Entry {
            count: 1,
            mean,
            deviation: None,
            resampled: None,
            published: Some(77.7),
        };
        let shares = [
            (Class::Milling, 25.0),
            (Class::Random, 75.0),
            (Class::Dispersal, 0.0),
        ];
        let entries = shares.map(|(class, mean)| (Figure::Share(class), entry(mean)));
        let row = Row {
            values: Vec::new(),
            entries: entries.into_iter().collect(),
        };
        let ends: Vec<_> = parts(&row)
            .iter()
            .map(|part| (part.class, part.from, part.to))
            .collect();
        assert_eq!(ends, [(Class::Random, 0.0, 75.0), (Class::Milling, 75.0, 100.0)]);
        let drawn = bars(&[row], |_| "all".to_owned()).into_string();
        assert_eq!(drawn.matches("<rect").count(), 2);
        assert!(drawn.contains("random, published: 77.7 %"));
    }
}
