//! Draws the curves of accuracy against the number of labels.

use super::Point;
use maud::{Markup, html};
use murmuration_accuracy::Summary;
use murmuration_report::{
    axes::{Axes, Scale, ticks},
    svg::{Drawing, GRID, WHITE},
};
use murmuration_swarm::Strategy;
use std::collections::BTreeMap;

/// Size of the drawing in pixels.
const SIZE: [f64; 2] = [900.0, 520.0];

/// Accuracy (anchor not random) against the number of labels as SVG: for each strategy the mean over the seeds, a bar of one
/// standard deviation either way, and a dot for every seed.
pub fn plot(points: &[Point], title: &str) -> String {
    let figures = points.iter().filter_map(|point| point.not_random);
    let lowest = (figures.fold(100.0, f64::min) - 2.0).max(0.0);
    let most = points.iter().map(|point| point.labels).max().unwrap_or(1).max(1) as f64;
    let axes = Axes {
        across: [76.0, SIZE[0] - 16.0],
        down: [50.0, SIZE[1] - 60.0],
        x: [0.0, 1.03 * most],
        y: [lowest, 100.0],
    };
    let labels = Scale {
        title: "labels",
        ticks: ticks(axes.x, 10, 1.0),
        unit: "",
    };
    let percent = Scale {
        title: "triplets told apart, anchor not random",
        ticks: ticks(axes.y, 10, 0.0),
        unit: " %",
    };
    let is_measured = |strategy: &Strategy| points.iter().any(|point| point.strategy == *strategy);
    let measured: Vec<Strategy> = Strategy::ALL.into_iter().filter(is_measured).collect();
    let drawing = Drawing {
        size: SIZE,
        font_size: 15,
        title,
        label: None,
        paper: WHITE,
        shrinks: true,
    };
    let content = html! {
        text x=(SIZE[0] / 2.0) y="32" font-size="20" text-anchor="middle" { (title) }
        (axes.draw([&labels, &percent], true))
        @for strategy in &measured { (curve(points, *strategy, &axes)) }
        (legend(&measured, &axes))
    };
    drawing.with(&content).into_string()
}

fn curve(points: &[Point], strategy: Strategy, axes: &Axes) -> Markup {
    let mut by_labels: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
    for point in points.iter().filter(|point| point.strategy == strategy) {
        by_labels
            .entry(point.labels)
            .or_default()
            .extend(point.not_random);
    }
    let summaries: Vec<(f64, Summary)> = by_labels
        .iter()
        .filter_map(|(&labels, figures)| Some((labels as f64, Summary::of(figures)?)))
        .collect();
    let means = summaries.iter().map(|(labels, summary)| (*labels, summary.mean));
    let bar = |(labels, summary): &(f64, Summary)| {
        let deviation = summary.deviation.unwrap_or(0.0);
        [summary.mean - deviation, summary.mean + deviation].map(|end| axes.at(*labels, end))
    };
    html! {
        g stroke=(colour(strategy)) fill=(colour(strategy)) {
            polyline points=(axes.line(means)) fill="none" stroke-width="2" {}
            @for [[x, from], [_, to]] in summaries.iter().map(bar) {
                line x1=(x) x2=(x) y1=(from) y2=(to) stroke-opacity="0.6" {}
            }
            g stroke="none" fill-opacity="0.6" {
                @for (labels, figures) in &by_labels {
                    @for [x, y] in figures.iter().map(|figure| axes.at(*labels as f64, *figure)) {
                        circle cx=(x) cy=(y) r="3" {}
                    }
                }
            }
        }
    }
}

/// The strategies with their colours, at the lower right.
fn legend(measured: &[Strategy], axes: &Axes) -> Markup {
    let height = 10.0 + 22.0 * measured.len() as f64;
    let (left, top) = (axes.across[1] - 170.0, axes.down[1] - height - 12.0);
    html! {
        rect x=(left) y=(top) width="158" height=(height) fill=(WHITE) stroke=(GRID) {}
        @for (place, strategy) in measured.iter().enumerate() {
            @let y = top + 16.0 + 22.0 * place as f64;
            line x1=(left + 10.0) x2=(left + 28.0) y1=(y) y2=(y) stroke=(colour(*strategy)) stroke-width="2" {}
            text x=(left + 38.0) y=(y + 5.0) { (strategy) }
        }
    }
}

const fn colour(strategy: Strategy) -> &'static str {
    match strategy {
        Strategy::Random => "#5f5e58",
        Strategy::Medoids => "#1f5f8b",
        Strategy::Coverage => "#9a5b13",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn every_strategy_that_was_measured_is_in_the_legend() {
        let point = |strategy, labels, percent| Point {
            strategy,
            labels,
            seed: 1,
            not_random: Some(percent),
            every: Some(percent),
            took: Duration::ZERO,
        };
        let points = [
            point(Strategy::Random, 0, 80.0),
            point(Strategy::Random, 100, 90.0),
            point(Strategy::Medoids, 100, 92.0),
        ];
        let svg = plot(&points, "two sensors");
        assert!(svg.contains("random") && svg.contains("medoids"));
        assert_eq!(svg.matches("<circle").count(), 3);
    }
}
