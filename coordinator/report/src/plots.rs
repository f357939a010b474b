//! The plots as SVG: novelty and filtering over generations, and the map of the behaviour space.

use super::{GenerationSummary, Report, ReportError};
use crate::picture::{axis::axis_number, columns::span};
use murmuration_model::colours::{self, Rgb};
use plotters::{
    coord::Shift,
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};
use std::ops::Range;

/// Size in pixels for a wide page and for papers.
pub(super) const WIDE: (u32, u32) = (1180, 340);
/// Size in pixels for a narrow page.
pub(super) const NARROW: (u32, u32) = (360, 260);

// The page's style sheet knows these colours by value and replaces them in the dark.
const INK: RGBColor = RGBColor(0x1d, 0x1d, 0x1b);
const MUTED: RGBColor = RGBColor(0x5f, 0x5e, 0x58);
const GRID: RGBColor = RGBColor(0xe4, 0xe1, 0xd8);
const BEST: RGBColor = RGBColor(0x1f, 0x5f, 0x8b);
const MEAN: RGBColor = RGBColor(0xb0, 0x62, 0x1c);

/// Size in pixels of the map, and of the margins around the points.
const MAP: (u32, u32) = (1080, 720);
const MAP_MARGIN: u32 = 16;
const MAP_LABELS: (u32, u32) = (64, 44);

/// Most points of a line and most individuals of a map that are drawn one by one.
const MOST_STEPS: usize = 1500;
const MOST_POINTS: usize = 20_000;

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
type Failed = DrawingAreaErrorKind<std::io::Error>;

/// A plot over generations, and what a script needs to tell its values.
pub(super) struct Curves {
    pub(super) svg: String,
    /// Each with its values by generation.
    pub(super) lines: Vec<Line>,
    pub(super) frame: Frame,
}

/// Where the values of a plot are in its picture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    /// Where the first generation and the `last` one are, as parts of the width from the left.
    pub(super) across: [f64; 2],
    /// Where 0 and `top` are, as parts of the height from above.
    pub(super) down: [f64; 2],
    pub(super) last: u32,
    pub(super) top: f64,
}

/// Best and mean novelty over generations.
pub(super) fn novelty(generations: &[GenerationSummary], size: (u32, u32)) -> Result<Curves, ReportError> {
    let steps = condensed(generations);
    let best = steps
        .iter()
        .map(|step| (step.generation, step.best_novelty))
        .collect();
    let mean = steps
        .iter()
        .map(|step| (step.generation, step.mean_novelty))
        .collect();
    let lines = vec![("best", BEST, best), ("mean", MEAN, mean)];
    curves("novelty.svg", size, lines, "novelty")
}

/// Proposals that the filter rejected, over generations.
pub(super) fn filtered(generations: &[GenerationSummary], size: (u32, u32)) -> Result<Curves, ReportError> {
    let steps = condensed(generations);
    let filtered = steps
        .iter()
        .map(|step| (step.generation, step.filtered as f64))
        .collect();
    let lines = vec![("", BEST, filtered)];
    curves("the filter's plot", size, lines, "rejected")
}

fn curves(
    plot: &'static str,
    size: (u32, u32),
    lines: Vec<Line>,
    title: &str,
) -> Result<Curves, ReportError> {
    let (svg, frame) = draw(plot, size, |area| over_generations(area, &lines, title))?;
    Ok(Curves { svg, lines, frame })
}

/// All individuals in the colours of their clusters, and the medoids with their numbers.
pub(super) fn map(report: &Report) -> Result<String, ReportError> {
    let (svg, ()) = draw("map.svg", MAP, |area| behaviour_space(area, report))?;
    Ok(svg)
}

/// A drawing as SVG, and what `fill` says of it.
fn draw<T>(
    plot: &'static str,
    size: (u32, u32),
    fill: impl FnOnce(&Area<'_>) -> Result<T, Failed>,
) -> Result<(String, T), ReportError> {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, size).into_drawing_area();
    let drawn = fill(&area).and_then(|told| area.present().map(|()| told));
    drop(area);
    let told = drawn.map_err(|error| ReportError::Plot {
        plot,
        reason: error.to_string(),
    })?;
    Ok((svg, told))
}

/// What a line is called, its colour, and its values by generation.
pub(super) type Line = (&'static str, RGBColor, Vec<(u32, f64)>);

fn over_generations(area: &Area<'_>, lines: &[Line], title: &str) -> Result<Frame, Failed> {
    let values = || {
        lines
            .iter()
            .flat_map(|(_, _, points)| points)
            .filter(|(_, value)| value.is_finite())
    };
    let last = values().fold(1, |most, &(generation, _)| most.max(generation));
    let top = values().fold(0.0, |most: f64, &(_, value)| most.max(value));
    let top = if top > 0.0 { top * 1.08 } else { 1.0 };
    let narrow = area.dim_in_pixel().0 < 600;
    let mut chart = ChartBuilder::on(area)
        .margin_top(12)
        .margin_right(if lines.len() > 1 { 56 } else { 16 })
        .x_label_area_size(46)
        .y_label_area_size(68)
        // Whole numbers have whole ticks.
        .build_cartesian_2d(0..last, 0.0..top)?;
    let text = |colour: RGBColor| ("sans-serif", 16).into_font().color(&colour);
    chart
        .configure_mesh()
        .disable_x_mesh()
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .axis_style(GRID)
        .label_style(text(MUTED))
        .axis_desc_style(text(INK))
        .x_labels(if narrow { 4 } else { 10 })
        .y_labels(5)
        .y_label_formatter(&|value| axis_number(*value, top))
        .x_desc("generation")
        .y_desc(title)
        .draw()?;
    for (name, colour, points) in lines {
        let points: Vec<_> = points
            .iter()
            .copied()
            .filter(|(_, value)| value.is_finite())
            .collect();
        let end = points.last().copied();
        chart.draw_series(LineSeries::new(points, colour.stroke_width(2)))?;
        if let Some(end) = end {
            let style = text(*colour).pos(Pos::new(HPos::Left, VPos::Center));
            let label = EmptyElement::at(end) + Text::new((*name).to_owned(), (8, 0), style);
            chart.plotting_area().draw(&label)?;
        }
    }
    let ends = [(0, 0.0), (last, top)].map(|end| chart.plotting_area().map_coordinate(&end));
    let (width, height) = area.dim_in_pixel();
    Ok(Frame {
        across: ends.map(|(x, _)| f64::from(x) / f64::from(width)),
        down: ends.map(|(_, y)| f64::from(y) / f64::from(height)),
        last,
        top,
    })
}

fn behaviour_space(area: &Area<'_>, report: &Report) -> Result<(), Failed> {
    area.fill(&WHITE)?;
    let points = &report.map.points;
    let (across, up) = equal_bounds(points);
    let text = |colour: RGBColor, size: u32| ("sans-serif", size).into_font().color(&colour);
    let mut chart = ChartBuilder::on(area)
        .margin(MAP_MARGIN)
        .x_label_area_size(MAP_LABELS.1)
        .y_label_area_size(MAP_LABELS.0)
        .build_cartesian_2d(across.clone(), up.clone())?;
    chart
        .configure_mesh()
        .disable_mesh()
        .axis_style(GRID)
        .label_style(text(MUTED, 16))
        .axis_desc_style(text(INK, 17))
        .x_label_formatter(&|value| axis_number(*value, across.end - across.start))
        .y_label_formatter(&|value| axis_number(*value, up.end - up.start))
        .x_desc(report.map.axis_titles[0].as_str())
        .y_desc(report.map.axis_titles[1].as_str())
        .draw()?;
    let stride = points.len().div_ceil(MOST_POINTS).max(1);
    chart.draw_series(
        points
            .iter()
            .zip(&report.clusters)
            .step_by(stride)
            .map(|(&[x, y], &cluster)| {
                Circle::new(
                    (x, y),
                    2,
                    rgb(colours::cluster(cluster as usize)).mix(0.6).filled(),
                )
            }),
    )?;
    for (place, medoid) in report.medoids.iter().enumerate() {
        let [x, y] = points[medoid.index as usize];
        let centred = text(WHITE, 14).pos(Pos::new(HPos::Center, VPos::Center));
        let mark = EmptyElement::at((x, y))
            + Circle::new((0, 0), 11, WHITE.filled())
            + Circle::new((0, 0), 10, INK.filled())
            + Text::new((place + 1).to_string(), (0, 0), centred);
        chart.plotting_area().draw(&mark)?;
    }
    Ok(())
}

/// What the axes of the map span, across and up: all points with some room, and a unit as long across as it is up.
fn equal_bounds(points: &[[f64; 2]]) -> (Range<f64>, Range<f64>) {
    let around = 2 * MAP_MARGIN;
    let pixels = [MAP.0 - around - MAP_LABELS.0, MAP.1 - around - MAP_LABELS.1].map(f64::from);
    let values = |axis: usize| points.iter().map(move |point| point[axis]);
    let spans = [0, 1].map(|axis| span(values(axis)));
    let a_pixel = (spans[0] / pixels[0]).max(spans[1] / pixels[1]);
    let a_pixel = if a_pixel > 0.0 {
        1.1 * a_pixel
    } else {
        1.0 / pixels[1]
    };
    let bounds = |axis: usize| {
        let low = values(axis).fold(f64::INFINITY, f64::min);
        let (middle, half) = (low + spans[axis] / 2.0, a_pixel * pixels[axis] / 2.0);
        middle - half..middle + half
    };
    (bounds(0), bounds(1))
}

const fn rgb([red, green, blue]: Rgb) -> RGBColor {
    RGBColor(red, green, blue)
}

/// The generations that a curve is drawn from, at most 1,500: neighbours become one, with the highest best, the mean of the
/// means and the sum of what was filtered.
#[must_use]
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
            let svg = map(&report).unwrap();
            // The marks of the medoids are numbers too, and whole ones.
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
            let svg = map(&report).unwrap();
            let place = |circle: &str, axis: &str| -> f64 {
                let text = circle.split_once(axis).unwrap().1;
                text.split('"').nth(1).unwrap().parse().unwrap()
            };
            // Those of the individuals come first.
            let circles: Vec<&str> = svg
                .split("<circle")
                .skip(1)
                .take(report.map.points.len())
                .collect();
            let spans = ["cx", "cy"]
                .map(|axis| (place(circles[0], axis) - place(circles.last().unwrap(), axis)).abs());
            let (across, up) = (spans[0] * height, spans[1] * width);
            // To the pixel.
            assert!(
                (across - up).abs() <= 2.0 * width.max(height),
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
            let svg = novelty(&run(count), WIDE).unwrap().svg;
            let ticks = numbers(&svg);
            let once: std::collections::BTreeSet<_> = ticks.iter().collect();
            // Both axes begin at 0, and both may have a 1.
            assert!(ticks.len() <= once.len() + 2, "{count} generations: {ticks:?}");
        }
    }

    #[test]
    fn the_frame_says_where_the_lines_are() {
        for size in [WIDE, NARROW] {
            let Curves { svg, lines, frame } = novelty(&run(20), size).unwrap();
            let line = svg
                .split("<polyline")
                .find(|line| line.contains("#1F5F8B"))
                .unwrap();
            let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            let points: Vec<&str> = points.split_whitespace().collect();
            let at = |part: f64, [from, to]: [f64; 2]| from + part * (to - from);
            for (point, (generation, value)) in points.iter().zip(&lines[0].2) {
                let (x, y) = point.split_once(',').unwrap();
                let across = at(f64::from(*generation) / f64::from(frame.last), frame.across);
                let down = at(value / frame.top, frame.down);
                let off = |place: &str, part: f64, size: u32| {
                    (place.parse::<f64>().unwrap() - part * f64::from(size)).abs()
                };
                assert!(
                    off(x, across, size.0) <= 1.0 && off(y, down, size.1) <= 1.0,
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
                assert!(
                    novelty(generations, size)
                        .unwrap()
                        .svg
                        .trim_end()
                        .ends_with("</svg>")
                );
                assert!(filtered(generations, size).unwrap().svg.contains("rejected"));
            }
        }
    }
}
