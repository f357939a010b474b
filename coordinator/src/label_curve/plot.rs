//! The curves as a picture.

use super::{Point, Questions};
use murmuration_accuracy::Summary;
use murmuration_proto::Strategy;
use murmuration_report::picture::axis::axis_number;
use plotters::prelude::*;
use std::collections::BTreeMap;

/// Pixels.
const SIZE: (u32, u32) = (900, 520);
const INK: RGBColor = RGBColor(0x1d, 0x1d, 0x1b);
const GRID: RGBColor = RGBColor(0xe4, 0xe1, 0xd8);

/// Accuracy (anchor not random) against the number of answers as SVG: for each kind of question the mean over the seeds, a bar of
/// one standard deviation either way, and the figure of every seed as a dot.
///
/// # Errors
/// Says why it cannot be drawn.
pub fn plot(points: &[Point], title: &str) -> Result<String, String> {
    let mut svg = String::new();
    let area = SVGBackend::with_string(&mut svg, SIZE).into_drawing_area();
    let drawn = draw(&area, points, title).and_then(|()| area.present());
    drop(area);
    drawn.map_err(|error| error.to_string())?;
    Ok(svg)
}

fn draw(
    area: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    points: &[Point],
    title: &str,
) -> Result<(), DrawingAreaErrorKind<std::io::Error>> {
    area.fill(&WHITE)?;
    let figures = || points.iter().filter_map(|point| point.not_random);
    let lowest = figures().fold(100.0, f64::min);
    let lowest = (lowest - 2.0).max(0.0);
    let most = points.iter().map(|point| point.answers).max().unwrap_or(1).max(1) as f64;
    let text = |size: u32| ("sans-serif", size).into_font().color(&INK);
    let mut chart = ChartBuilder::on(area)
        .margin(16)
        .caption(title, text(20))
        .x_label_area_size(44)
        .y_label_area_size(60)
        .build_cartesian_2d(0.0..most * 1.03, lowest..100.0)?;
    chart
        .configure_mesh()
        .bold_line_style(GRID)
        .light_line_style(TRANSPARENT)
        .axis_style(GRID)
        .label_style(text(15))
        .x_label_formatter(&|answers| axis_number(*answers, most))
        .y_label_formatter(&|percent| format!("{} %", axis_number(*percent, 100.0 - lowest)))
        .x_desc("answers")
        .y_desc("triplets told apart, anchor not random")
        .draw()?;
    for questions in Questions::ALL {
        let of_questions = || points.iter().filter(|point| point.questions == questions);
        if of_questions().next().is_none() {
            continue;
        }
        let mut by_answers: BTreeMap<usize, Vec<f64>> = BTreeMap::new();
        for point in of_questions() {
            by_answers
                .entry(point.answers)
                .or_default()
                .extend(point.not_random);
        }
        let summaries: Vec<(f64, Summary)> = by_answers
            .iter()
            .filter_map(|(&answers, figures)| Some((answers as f64, Summary::of(figures)?)))
            .collect();
        let colour = colour(questions);
        let means = summaries
            .iter()
            .map(|(answers, summary)| (*answers, summary.mean));
        chart
            .draw_series(LineSeries::new(means, colour.stroke_width(2)))?
            .label(questions.to_string())
            .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(2)));
        chart.draw_series(summaries.iter().map(|(answers, summary)| {
            let deviation = summary.deviation.unwrap_or(0.0);
            let ends = [summary.mean - deviation, summary.mean + deviation];
            PathElement::new(ends.map(|end| (*answers, end)), colour.mix(0.6))
        }))?;
        chart.draw_series(of_questions().filter_map(|point| {
            let at = (point.answers as f64, point.not_random?);
            Some(Circle::new(at, 3, colour.mix(0.6).filled()))
        }))?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerRight)
        .background_style(WHITE)
        .border_style(GRID)
        .label_font(text(15))
        .draw()
}

const fn colour(questions: Questions) -> RGBColor {
    match questions {
        Questions::Names(Strategy::Random) => RGBColor(0x5f, 0x5e, 0x58),
        Questions::Names(Strategy::Medoids) => RGBColor(0x1f, 0x5f, 0x8b),
        Questions::Comparisons => RGBColor(0xb0, 0x4a, 0x1e),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn every_strategy_that_was_measured_is_in_the_legend() {
        let point = |questions, answers, percent| Point {
            questions,
            answers,
            told: answers,
            seed: 1,
            not_random: Some(percent),
            every: Some(percent),
            took: Duration::ZERO,
        };
        let points = [
            point(Questions::Names(Strategy::Random), 0, 80.0),
            point(Questions::Names(Strategy::Random), 100, 90.0),
            point(Questions::Names(Strategy::Medoids), 100, 92.0),
            point(Questions::Comparisons, 100, 91.0),
        ];
        let svg = plot(&points, "two sensors").unwrap();
        assert!(svg.contains("random") && svg.contains("medoids") && svg.contains("comparisons"));
        assert_eq!(svg.matches("<circle").count(), 4);
    }
}
