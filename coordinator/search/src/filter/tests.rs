//! Compares the filter with the paper's numbers, with exact arithmetic, and with labelled controllers.

use super::*;
use murmuration_swarm::Preset;
use proptest::prelude::*;

fn score(speeds: [f64; 4]) -> Score {
    Score::of(&Controller::new(Preset::SingleSensor, &speeds).unwrap())
}

/// Every quadruple of tenths from -10 to 10.
fn grid() -> impl Iterator<Item = [i32; 4]> {
    let side = || -10..=10;
    side().flat_map(move |a| {
        side().flat_map(move |b| side().flat_map(move |c| side().map(move |d| [a, b, c, d])))
    })
}

/// Whether a controller in tenths passes in exact arithmetic: thresholds are compared as integers, in hundredths of squares.
///
/// The total is irrational or far from the cutoff, except for eight controllers whose total is exactly 4.
fn passes_exactly([a, b, c, d]: [i32; 4]) -> bool {
    let magnitude = [a, b, c, d].map(i32::abs).into_iter().max().unwrap();
    let displacement = (a + b).abs() + (c + d).abs();
    let norm = a * a + b * b + c * c + d * d;
    let mirror = (c + a).pow(2) + (d + b).pow(2);
    let neglect = (c - a).pow(2) + (d - b).pow(2);
    let part = |under: bool, value: f64| if under { PENALTY } else { value / 10.0 };
    let total = part(magnitude < 4, f64::from(magnitude))
        + part(4 * norm < 13 * 13, f64::from(norm).sqrt())
        + part(displacement < 5, f64::from(displacement))
        + part(mirror < 2 * 2, f64::from(mirror).sqrt())
        + part(neglect < 3 * 3, f64::from(neglect).sqrt());
    total >= CUTOFF - 1e-9
}

#[test]
fn doubles_discard_43_065_of_the_papers_grid_and_exact_arithmetic_42_057() {
    let (mut total, mut discarded, mut discarded_exactly, mut kept_by_rounding) = (0, 0, 0, 0);
    for tenths in grid() {
        let passes = score(tenths.map(|i| f64::from(i) / 10.0)).passes();
        let exactly = passes_exactly(tenths);
        total += 1;
        discarded += u32::from(!passes);
        discarded_exactly += u32::from(!exactly);
        kept_by_rounding += u32::from(passes && !exactly);
    }
    assert_eq!((total, discarded, discarded_exactly), (194_481, 43_065, 42_057));
    assert_eq!(
        kept_by_rounding, 0,
        "rounding only ever puts a tie under its threshold"
    );
}

#[track_caller]
fn check(speeds: [f64; 4], contributions: [f64; 5], passes: bool) {
    let score = score(speeds);
    for (got, expected) in score.contributions().into_iter().zip(contributions) {
        assert!((got - expected).abs() < 1e-12, "{got} is not {expected}");
    }
    assert_eq!(score.passes(), passes);
}

#[test]
fn each_metric_is_the_papers() {
    // Standing still is penalised by every metric.
    check([0.0; 4], [PENALTY; 5], false);
    // The paper's slow and fast examples.
    let far = |x: f64, y: f64| (x * x + y * y).sqrt();
    check(
        [0.1, 0.12, 0.25, 0.2],
        [PENALTY, PENALTY, 0.67, far(0.35, 0.32), PENALTY],
        false,
    );
    check(
        [0.9, 0.98, 0.7, 0.6],
        [0.98, 2.6204_f64.sqrt(), 3.18, far(1.6, 1.58), far(0.2, 0.38)],
        true,
    );
    // Three faults: a robot spins in place, undoes its own motion, or ignores other robots.
    check(
        [1.0, -1.0, -0.5, 0.5],
        [1.0, 2.5_f64.sqrt(), PENALTY, far(0.5, 0.5), far(1.5, 1.5)],
        false,
    );
    check(
        [1.0, 0.5, -1.0, -0.5],
        [1.0, 2.5_f64.sqrt(), 3.0, PENALTY, far(2.0, 1.0)],
        false,
    );
    check(
        [1.0, 0.5, 1.0, 0.5],
        [1.0, 2.5_f64.sqrt(), 3.0, far(2.0, 1.0), PENALTY],
        false,
    );
}

#[test]
fn a_total_at_the_cutoff_passes() {
    let lowest = grid()
        .map(|tenths| score(tenths.map(|i| f64::from(i) / 10.0)))
        .filter(Score::passes)
        .map(|score| score.total())
        .fold(f64::INFINITY, f64::min);
    assert_eq!(lowest, CUTOFF);
}

/// The first four wheel speeds of the labelled two-sensor behaviours nearest to the cutoff. Some behaviours were drawn through
/// the filter; the other behaviours are uniform samples.
#[test]
fn labelled_behaviours_drawn_through_the_filter_pass() {
    let drawn_through_it = [
        [-0.2, -0.2, 0.7, -0.5],
        [0.2, 0.2, 0.0, -0.7],
        [-0.6, -0.1, -0.2, 0.5],
        [0.1, -0.5, -0.2, -0.6],
        [0.6, 0.2, -0.5, 0.0],
        [0.8, -0.1, 0.2, -0.1],
    ];
    let uniform = [
        [-0.7, 0.5, -0.1, 0.4],
        [-0.2, -0.2, -0.7, 0.4],
        [-0.8, 0.1, 0.0, 0.0],
    ];
    assert!(drawn_through_it.into_iter().all(|speeds| score(speeds).passes()));
    assert!(!uniform.into_iter().any(|speeds| score(speeds).passes()));
}

/// The labelled behaviours for which floating point and exact arithmetic differ in a tie: |0.7 - 0.2| is 0.5 on paper.
#[test]
fn a_tie_that_rounds_under_its_threshold_is_penalised() {
    for tenths in [[7, -2, 8, -8], [3, -7, -8, 9], [-2, 7, 10, -10]] {
        let score = score(tenths.map(|i| f64::from(i) / 10.0));
        assert_eq!(score.contributions()[2], PENALTY);
        assert!(!score.passes() && passes_exactly(tenths));
    }
}

proptest! {
    #[test]
    fn a_second_sensor_does_not_matter(
        seen in prop::array::uniform4(-1.0..=1.0f64),
        rest in prop::array::uniform4(-1.0..=1.0f64),
        angle in -3.0..=3.0f64,
    ) {
        let genes: Vec<f64> = seen.into_iter().chain(rest).chain([angle]).collect();
        let two = Controller::new(Preset::TwoSensor, &genes).unwrap();
        prop_assert_eq!(Score::of(&two), score(seen));
    }

    #[test]
    fn a_mirrored_robot_scores_the_same(speeds in prop::array::uniform4(-1.0..=1.0f64)) {
        let [a, b, c, d] = speeds;
        let (one, other) = (score(speeds), score([b, a, d, c]));
        for (x, y) in one.metrics().iter().zip(other.metrics()) {
            prop_assert!((x - y).abs() < 1e-12);
        }
    }
}
