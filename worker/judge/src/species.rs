//! Two species against each other: which species surrounds the other or turns with it.

use super::{
    Measures, Scale,
    geometry::{Outline, angle_between, length, minus},
    window::{Point, Window, mean, quantile, ratio, share},
};
use murmuration_swarm::World;
use std::f64::consts::TAU;

/// A robot is enclosed if it is at least this deep in the outline of the other species, in radii of the outline. Robots of a ring
/// of both species are less deep in each other's outlines.
const ENCLOSED: f64 = 0.05;
/// The times of the window at which an outline is taken: every tenth.
const OUTLINE_STRIDE: usize = 10;

/// Measures of the two species of a swarm.
#[derive(Debug, Clone, PartialEq)]
pub struct Pair {
    /// Each species alone, as if it were the whole swarm.
    pub alone: [Alone; 2],
    /// Each species against the other.
    pub against: [Against; 2],
    /// Distance between the middles of the two species' paths, in units of the larger [`Alone::radius`].
    pub offset: f64,
}

/// Measures of one species, without the robots of the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Alone {
    pub robots: usize,
    /// The measures of the species as a swarm of its own.
    pub measures: Measures,
    /// Median distance from the middle of the species' paths, in body radii.
    pub radius: f64,
}

/// Measures of one species against the other.
#[derive(Debug, Clone, PartialEq)]
pub struct Against {
    /// Share of the other species' robots that are inside this species' outline, as a mean over time.
    pub encloses: f64,
    /// Widest angle without a robot of this species, as seen from the middle of the other species, in radians: mean over time.
    pub gap: f64,
    /// Depth in this species' own outline that three quarters of its robots do not exceed, in radii of the outline: mean over
    /// time. 0 on a ring, about 0.5 in an even disc.
    pub rim: f64,
}

impl Pair {
    /// The measures of a swarm of two species. `species` has the place of each robot's species, in index order. `None` if there are
    /// not exactly two species: patterns are those of two.
    pub(super) fn of(window: &Window, species: &[usize], world: &World) -> Option<Self> {
        let first = *species.first()?;
        let second = *species.iter().find(|&&place| place != first)?;
        let is_of_two = species.iter().all(|place| [first, second].contains(place));
        if !is_of_two || species.len() != window.paths().len() {
            return None;
        }
        let windows = [first, second].map(|place| window.only(|robot| species[robot] == place));
        let alone = [0, 1].map(|place| Alone::of(&windows[place], world));
        let middles = [0, 1].map(|place| middle(&windows[place]));
        let widest = alone[0].radius.max(alone[1].radius) * world.radius();
        Some(Self {
            against: [[0, 1], [1, 0]].map(|[own, other]| Against::of(&windows[own], &windows[other])),
            offset: ratio(length(minus(middles[0], middles[1])), widest),
            alone,
        })
    }
}

/// The middle of a swarm's paths.
fn middle(window: &Window) -> Point {
    let points = window.paths().concat();
    Outline::around(points.clone()).map_or_else(|| mean(&points), |outline| outline.centre())
}

impl Alone {
    fn of(window: &Window, world: &World) -> Self {
        let middle = middle(window);
        let distances = window.paths().iter().flatten();
        let distances = distances.map(|&point| length(minus(point, middle)));
        let robots = window.paths().len();
        Self {
            robots,
            measures: Measures::of_window(window, world, &Scale::of_robots(world, robots)),
            radius: quantile(distances, 0.5) / world.radius(),
        }
    }
}

impl Against {
    fn of(own: &Window, other: &Window) -> Self {
        let times = (0..own.times()).step_by(OUTLINE_STRIDE);
        let (mut encloses, mut gap, mut rim) = (0.0, 0.0, 0.0);
        for time in times.clone() {
            let robots: Vec<Point> = own.at(time).collect();
            let others: Vec<Point> = other.at(time).collect();
            gap += widest_gap(&robots, mean(&others));
            let Some(outline) = Outline::around(robots.clone()) else {
                continue;
            };
            let inside = |&point: &Point| outline.contains(point) && outline.depth(point) >= ENCLOSED;
            encloses += share(others.iter().map(inside));
            rim += quantile(robots.iter().map(|&point| outline.depth(point)), 0.75);
        }
        let count = times.count() as f64;
        Self {
            encloses: encloses / count,
            gap: gap / count,
            rim: rim / count,
        }
    }
}

/// Widest angle at `centre` without a point, in radians.
fn widest_gap(points: &[Point], centre: Point) -> f64 {
    let angles = points
        .iter()
        .map(|&point| angle_between([1.0, 0.0], minus(point, centre)));
    let mut angles: Vec<f64> = angles.collect();
    angles.sort_by(f64::total_cmp);
    let across = angles
        .first()
        .zip(angles.last())
        .map_or(TAU, |(first, last)| first + TAU - last);
    let between = angles.windows(2).map(|pair| pair[1] - pair[0]);
    between.fold(across, f64::max)
}
