//! The plots of a report as SVG: novelty and filtering over generations, and the map of the behaviour space.

use super::{GenerationSummary, Report};
use crate::{
    axes::{Axes, Scale, ticks},
    picture::columns::span,
    svg::{INK, WHITE},
};
use maud::{Markup, html};
use murmuration_model::colours;
use serde::Serialize;

/// Size of a plot in pixels, for a wide page and for papers.
pub(super) const WIDE: [f64; 2] = [1180.0, 340.0];
/// Size of a plot in pixels, for a narrow page.
pub(super) const NARROW: [f64; 2] = [360.0, 260.0];

// On dark screens, the page's style sheet finds these colours and those of `svg` by their values, and replaces them.
const BEST: &str = "#1f5f8b";
const MEAN: &str = "#b0621c";

/// Size of the map in pixels, and margins around the points: left, above, right, below.
const MAP: [f64; 2] = [1080.0, 720.0];
const MAP_FREE: [f64; 4] = [80.0, 16.0, 16.0, 60.0];

/// Maximum number of points of a line, and of individuals that a map draws.
const MOST_STEPS: usize = 1500;
const MOST_POINTS: usize = 20_000;

/// A plot over generations, with the data for a script that shows its values.
pub(super) struct Curves {
    pub(super) svg: String,
    /// The lines, with their values by generation.
    pub(super) lines: Vec<Line>,
    pub(super) frame: Frame,
}

/// Position of a plot's axes in its picture.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Frame {
    /// Positions of the first and the `last` generation, as fractions of the width from the left.
    pub(super) across: [f64; 2],
    /// Positions of 0 and `top`, as fractions of the height from above.
    pub(super) down: [f64; 2],
    pub(super) last: u32,
    pub(super) top: f64,
}

pub(super) fn novelty(generations: &[GenerationSummary], size: [f64; 2]) -> Curves {
    let steps = condensed(generations);
    let of = |value: fn(&GenerationSummary) -> f64| {
        steps.iter().map(|step| (step.generation, value(step))).collect()
    };
    let (best, mean) = (of(|step| step.best_novelty), of(|step| step.mean_novelty));
    over_generations(size, vec![("best", BEST, best), ("mean", MEAN, mean)], "novelty")
}

/// Proposals that the filter rejected, over generations.
pub(super) fn filtered(generations: &[GenerationSummary], size: [f64; 2]) -> Curves {
    let steps = condensed(generations);
    let filtered = steps
        .iter()
        .map(|step| (step.generation, step.filtered as f64))
        .collect();
    over_generations(size, vec![("", BEST, filtered)], "rejected")
}

/// A line of a plot: its name, its colour, and its values by generation.
pub(super) type Line = (&'static str, &'static str, Vec<(u32, f64)>);

fn over_generations(size: [f64; 2], lines: Vec<Line>, title: &str) -> Curves {
    let finite = |line: &Line| -> Vec<(f64, f64)> {
        let points = line
            .2
            .iter()
            .map(|(generation, value)| (f64::from(*generation), *value));
        points.filter(|(_, value)| value.is_finite()).collect()
    };
    let points: Vec<_> = lines.iter().map(finite).collect();
    let last = points
        .iter()
        .flatten()
        .fold(1.0, |most: f64, (generation, _)| most.max(*generation));
    let top = points
        .iter()
        .flatten()
        .fold(0.0, |most: f64, (_, value)| most.max(*value));
    let top = if top > 0.0 {
        (top * 1.08).min(f64::MAX)
    } else {
        1.0
    };
    let [width, height] = size;
    let axes = Axes {
        across: [68.0, width - if lines.len() > 1 { 56.0 } else { 16.0 }],
        down: [12.0, height - 46.0],
        x: [0.0, last],
        y: [0.0, top],
    };
    let generations = Scale {
        title: "generation",
        ticks: ticks(axes.x, if width < 600.0 { 4 } else { 10 }, 1.0),
        unit: "",
    };
    let values = Scale {
        title,
        ticks: ticks(axes.y, 6, 0.0),
        unit: "",
    };
    let content = html! {
        (axes.draw([&generations, &values], true))
        @for ((name, colour, _), points) in lines.iter().zip(&points) {
            polyline points=(axes.line(points.iter().copied())) fill="none" stroke=(colour) stroke-width="2" {}
            @if let Some([x, y]) = points.last().map(|end| axes.at(end.0, end.1)) {
                text x=(x + 8.0) y=(y + 5.0) fill=(colour) { (name) }
            }
        }
    };
    let [top_pixel, bottom] = axes.down;
    Curves {
        svg: drawing(size, &content),
        frame: Frame {
            across: axes.across.map(|x| x / width),
            down: [bottom / height, top_pixel / height],
            last: last as u32,
            top,
        },
        lines,
    }
}

/// An SVG without a title: the page already names the plot, and a browser would show a title as a tooltip.
fn drawing([width, height]: [f64; 2], content: &Markup) -> String {
    let plot = html! {
        svg xmlns="http://www.w3.org/2000/svg" width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) }
            font-family="sans-serif" font-size="14" { (content) }
    };
    plot.into_string()
}

/// The map of at most 20,000 individuals in the colours of their clusters, and of the medoids with their numbers.
pub(super) fn map(report: &Report) -> String {
    let points = &report.map.points;
    let axes = map_axes(points);
    let scale = |axis: usize, ends| Scale {
        title: &report.map.axis_titles[axis],
        ticks: ticks(ends, 10, 0.0),
        unit: "",
    };
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    let coloured = points.iter().zip(&report.clusters).step_by(stride);
    let content = html! {
        rect width="100%" height="100%" fill=(WHITE) {}
        (axes.draw([&scale(0, axes.x), &scale(1, axes.y)], false))
        g fill-opacity="0.6" {
            @for ([x, y], cluster) in coloured.map(|(&[x, y], &cluster)| (axes.at(x, y), cluster)) {
                circle cx=(x) cy=(y) r="2" fill=(colours::hex(colours::cluster(cluster as usize))) {}
            }
        }
        g text-anchor="middle" {
            @for (place, medoid) in report.medoids.iter().enumerate() {
                @let [x, y] = points[medoid.index as usize];
                @let [x, y] = axes.at(x, y);
                circle cx=(x) cy=(y) r="10.5" fill=(INK) stroke=(WHITE) {}
                text x=(x) y=(y + 5.0) fill=(WHITE) { (place + 1) }
            }
        }
    };
    drawing(MAP, &content)
}

/// The axes of the map, with room around the points and the same scale in both directions.
fn map_axes(points: &[[f64; 2]]) -> Axes {
    let [left, above, right, below] = MAP_FREE;
    let (across, down) = ([left, MAP[0] - right], [above, MAP[1] - below]);
    let pixels = [across, down].map(|[from, to]| to - from);
    let values = |axis: usize| points.iter().map(move |point| point[axis]);
    let spans = [0, 1].map(|axis| span(values(axis)));
    let a_pixel = (spans[0] / pixels[0]).max(spans[1] / pixels[1]);
    let a_pixel = if a_pixel > 0.0 {
        1.1 * a_pixel
    } else {
        1.0 / pixels[1]
    };
    let ends = |axis: usize| {
        let low = values(axis).fold(f64::INFINITY, f64::min);
        let (middle, half) = (low + spans[axis] / 2.0, a_pixel * pixels[axis] / 2.0);
        [middle - half, middle + half]
    };
    Axes {
        across,
        down,
        x: ends(0),
        y: ends(1),
    }
}

/// At most 1,500 points of a curve over generations. Neighbouring generations are merged: the result has their highest best
/// novelty, the mean of their mean novelties, and the sum of their filtered proposals.
pub fn condensed(generations: &[GenerationSummary]) -> Vec<GenerationSummary> {
    let together = generations.len().div_ceil(MOST_STEPS).max(1);
    let one = |group: &[GenerationSummary]| GenerationSummary {
        generation: group[0].generation,
        best_novelty: group
            .iter()
            .map(|step| step.best_novelty)
            .fold(f64::NEG_INFINITY, f64::max),
        mean_novelty: group.iter().map(|step| step.mean_novelty).sum::<f64>() / group.len() as f64,
        filtered: group.iter().map(|step| step.filtered).sum(),
    };
    generations.chunks(together).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sample;

    fn run(count: u32) -> Vec<GenerationSummary> {
        let step = |generation: u32| GenerationSummary {
            generation,
            best_novelty: 1.0 / f64::from(generation + 1),
            mean_novelty: 0.5 / f64::from(generation + 1),
            filtered: 2,
        };
        (0..count).map(step).collect()
    }

    #[test]
    fn long_runs_are_condensed_without_losing_peaks_or_counts() {
        let mut long = run(100_000);
        long[77_777].best_novelty = 9.0;
        let short = condensed(&long);
        assert!(short.len() <= MOST_STEPS);
        assert_eq!(short.iter().map(|step| step.filtered).sum::<u64>(), 200_000);
        assert!(short.iter().any(|step| step.best_novelty == 9.0));
        assert_eq!(condensed(&run(5)), run(5));
    }

    /// The texts of a plot that are numbers.
    fn numbers(svg: &str) -> Vec<&str> {
        let texts = svg.split("<text").skip(1);
        let texts = texts.filter_map(|text| Some(text.split_once('>')?.1.split_once("</text>")?.0.trim()));
        texts.filter(|text| text.parse::<f64>().is_ok()).collect()
    }

    #[test]
    fn no_tick_of_a_map_is_a_rounding_error() {
        let mut report = sample::report(&sample::SMALL);
        let count = report.map.points.len() as f64;
        for (places, nought) in [(-1.0..1.0, "0"), (-0.3..0.5, "0"), (-3e-7..5e-7, "0")] {
            for (i, point) in report.map.points.iter_mut().enumerate() {
                let place = places.start + (places.end - places.start) * i as f64 / (count - 1.0);
                *point = [place, -place];
            }
            let svg = map(&report);
            // `ticks` also has the numbers of the medoids, which are whole numbers.
            let ticks = numbers(&svg);
            assert!(ticks.contains(&nought), "{ticks:?}");
            let nearest = ticks.iter().map(|tick| tick.parse::<f64>().unwrap().abs());
            let nearest = nearest.filter(|&tick| tick != 0.0).fold(f64::INFINITY, f64::min);
            assert!(nearest > 1e-3 * (places.end - places.start), "{ticks:?}");
        }
    }

    #[test]
    fn a_unit_of_the_map_is_as_long_across_as_up() {
        let mut report = sample::report(&sample::SMALL);
        for (width, height) in [(8.0, 1.0), (1.0, 1.0), (0.01, 3.0), (2.0, 0.0)] {
            let count = report.map.points.len() as f64;
            for (i, point) in report.map.points.iter_mut().enumerate() {
                let part = i as f64 / (count - 1.0);
                *point = [width * part, height * part];
            }
            let svg = map(&report);
            let place = |circle: &str, axis: &str| -> f64 {
                let text = circle.split_once(axis).unwrap().1;
                text.split('"').nth(1).unwrap().parse().unwrap()
            };
            // The circles of the individuals come before those of the medoids.
            let circles: Vec<&str> = svg
                .split("<circle")
                .skip(1)
                .take(report.map.points.len())
                .collect();
            let spans = ["cx", "cy"]
                .map(|axis| (place(circles[0], axis) - place(circles.last().unwrap(), axis)).abs());
            let (across, up) = (spans[0] * height, spans[1] * width);
            // Positions are rounded to a tenth of a pixel.
            assert!(
                (across - up).abs() <= 0.2 * width.max(height),
                "{spans:?} for {width} by {height}"
            );
            assert!(
                spans[0] > 560.0 || spans[1] > 560.0,
                "{spans:?} leaves the map empty"
            );
        }
    }

    #[test]
    fn generations_are_whole_and_no_tick_is_there_twice() {
        for count in [1, 2, 3, 20] {
            let svg = novelty(&run(count), WIDE).svg;
            let ticks = numbers(&svg);
            let once: std::collections::BTreeSet<_> = ticks.iter().collect();
            // Both axes begin at 0, and both can have a 1.
            assert!(ticks.len() <= once.len() + 2, "{count} generations: {ticks:?}");
        }
    }

    #[test]
    fn the_frame_says_where_the_lines_are() {
        for size in [WIDE, NARROW] {
            let Curves { svg, lines, frame } = novelty(&run(20), size);
            let line = svg.split("<polyline").find(|line| line.contains(BEST)).unwrap();
            let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            let points: Vec<&str> = points.split_whitespace().collect();
            let at = |part: f64, [from, to]: [f64; 2]| from + part * (to - from);
            for (point, (generation, value)) in points.iter().zip(&lines[0].2) {
                let (x, y) = point.split_once(',').unwrap();
                let across = at(f64::from(*generation) / f64::from(frame.last), frame.across);
                let down = at(value / frame.top, frame.down);
                let off =
                    |place: &str, part: f64, size: f64| (place.parse::<f64>().unwrap() - part * size).abs();
                assert!(
                    off(x, across, size[0]) < 0.1 && off(y, down, size[1]) < 0.1,
                    "{point}: {frame:?}"
                );
            }
            assert_eq!(points.len(), 20);
        }
    }

    #[test]
    fn plots_are_drawn_whatever_the_numbers() {
        let odd = [f64::NAN, f64::INFINITY, 0.0, 1e300, 1e-300].map(|novelty| GenerationSummary {
            generation: 0,
            best_novelty: novelty,
            mean_novelty: novelty,
            filtered: u64::MAX,
        });
        for generations in [
            &[][..],
            &run(1),
            &run(300),
            &odd[..1],
            &odd[1..2],
            &odd[2..3],
            &odd[3..4],
            &odd[4..],
        ] {
            for size in [WIDE, NARROW] {
                let svg = novelty(generations, size).svg;
                assert!(
                    svg.ends_with("</svg>") && !svg.contains("NaN") && !svg.contains("inf"),
                    "{svg}"
                );
                assert!(filtered(generations, size).svg.contains("rejected"));
            }
        }
    }
}
