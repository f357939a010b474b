//! The histogram of the heuristic scores of random and of other behaviours, with the cutoff of the filter, as SVG.

use crate::svg::{Drawing, MUTED, WHITE, tenth};
use maud::html;
use murmuration_model::colours;
use murmuration_swarm::Class;

/// Size of the plot, and margins around the bars (left, top, right, bottom), in pixels.
const SIZE: [f64; 2] = [640.0, 340.0];
const FREE: [f64; 4] = [56.0, 44.0, 14.0, 48.0];
/// Width of a bar in units of the score; bars begin at multiples of this width.
const BAR: f64 = 1.0;
/// Colours of the bars of behaviours that are not random, and of the line of the cutoff.
const OTHER: &str = "#1f5f8b";
const CUT: &str = "#be464d";

/// Maximum distance of a score from 0 in the histogram; scores of robots are far below this limit. It bounds the number of bars,
/// because the histogram has a bar for each whole score between the lowest and the highest.
pub const MOST_SCORE: f64 = 1e4;

/// A bar: the lowest score in the bar, and the numbers of random and of other controllers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Bar {
    low: f64,
    random: usize,
    other: usize,
}

/// The histogram of controllers' scores by class. Scores farther than [`MOST_SCORE`] from 0 are moved to this limit. The filter
/// rejects scores below `cutoff`.
pub fn svg(scores: &[(f64, Class)], cutoff: f64, title: &str) -> String {
    let bars = bars(scores, cutoff);
    let most = bars
        .iter()
        .map(|bar| bar.random + bar.other)
        .max()
        .unwrap_or(0)
        .max(1);
    let [left, top, right, bottom] = FREE;
    let first = bars.first().map_or(0.0, |bar| bar.low);
    let width = (SIZE[0] - left - right) / bars.len().max(1) as f64;
    let x = |score: f64| left + (score - first) / BAR * width;
    let height = |count: usize| count as f64 / most as f64 * (SIZE[1] - top - bottom);
    let floor = SIZE[1] - bottom;
    let step = (bars.len() / 10).max(1);
    let random = colours::hex(colours::class_colour(Class::Random));
    let drawing = Drawing {
        size: SIZE,
        font_size: 13,
        title,
        label: None,
        paper: WHITE,
        shrinks: true,
    };
    let content = html! {
        text x=(left) y="24" font-size="17" font-weight="bold" { (title) }
        @for bar in &bars {
            rect x=(tenth(x(bar.low))) width=(tenth(width - 1.0)) y=(tenth(floor - height(bar.random))) height=(tenth(height(bar.random))) fill=(random) {}
            rect x=(tenth(x(bar.low))) width=(tenth(width - 1.0)) y=(tenth(floor - height(bar.random + bar.other))) height=(tenth(height(bar.other))) fill=(OTHER) {}
        }
        line x1=(left) x2=(SIZE[0] - right) y1=(floor) y2=(floor) stroke=(random) {}
        line x1=(tenth(x(cutoff))) x2=(tenth(x(cutoff))) y1=(top) y2=(floor) stroke=(CUT) stroke-width="2" {}
        @for bar in bars.iter().step_by(step) {
            text x=(tenth(x(bar.low))) y=(floor + 18.0) text-anchor="middle" fill=(MUTED) { (bar.low) }
        }
        @for share in [0.5, 1.0] {
            @let count = (share * most as f64).round() as usize;
            text x=(left - 8.0) y=(tenth(floor - height(count) + 4.0)) text-anchor="end" fill=(MUTED) { (count) }
        }
        text x=(SIZE[0] - right) y=(SIZE[1] - 8.0) text-anchor="end" { "heuristic score" }
        @for (place, (colour, words)) in [(random.as_str(), "random"), (OTHER, "other classes"), (CUT, "cutoff of the filter")].into_iter().enumerate() {
            @let y = top + 10.0 + 20.0 * place as f64;
            rect x=(left + 8.0) y=(y - 9.0) width="12" height="12" fill=(colour) {}
            text x=(left + 28.0) y=(y + 2.0) { (words) }
        }
    };
    drawing.with(&content).into_string()
}

/// The bars from the lowest score to the highest, empty bars included. The bars also cover the cutoff. Without scores, there are
/// no bars.
fn bars(scores: &[(f64, Class)], cutoff: f64) -> Vec<Bar> {
    let place = |score: f64| (score.clamp(-MOST_SCORE, MOST_SCORE) / BAR).floor();
    let places = || {
        let cutoff = (!scores.is_empty()).then_some(cutoff);
        scores.iter().map(|(score, _)| *score).chain(cutoff).map(place)
    };
    let (low, high) = (
        places().fold(f64::INFINITY, f64::min),
        places().fold(f64::NEG_INFINITY, f64::max),
    );
    let count = if low <= high { (high - low) as usize + 1 } else { 0 };
    let empty = |number: usize| Bar {
        low: (low + number as f64) * BAR,
        random: 0,
        other: 0,
    };
    let mut bars: Vec<Bar> = (0..count).map(empty).collect();
    for (score, class) in scores {
        let bar = &mut bars[(place(*score) - low) as usize];
        match class {
            Class::Random => bar.random += 1,
            _ => bar.other += 1,
        }
    }
    bars
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_score_is_in_one_bar() {
        let scores = [
            (3.9, Class::Random),
            (4.0, Class::Milling),
            (4.5, Class::Random),
            (1.0, Class::Random),
        ];
        let bar = |low: f64, random: usize, other: usize| Bar { low, random, other };
        let expected = [bar(1.0, 1, 0), bar(2.0, 0, 0), bar(3.0, 1, 0), bar(4.0, 1, 1)];
        assert_eq!(bars(&scores, 2.5), expected);
        assert!(bars(&[], 2.5).is_empty());
    }

    #[test]
    fn the_cutoff_is_in_the_plot_also_where_no_score_is_near_it() {
        let bars = bars(&[(7.5, Class::Milling)], 5.2);
        assert_eq!([bars[0].low, bars[2].low], [5.0, 7.0]);
        assert_eq!([bars[0].other, bars[2].other], [0, 1]);
    }

    #[test]
    fn scores_that_no_robot_has_end_at_the_last_bar() {
        let scores = [(1e300, Class::Milling), (f64::NAN, Class::Random)];
        let bars = bars(&scores, 0.0);
        assert_eq!(bars.last().map(|bar| bar.other), Some(1));
    }
}
