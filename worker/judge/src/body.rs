//! The swarm as one body: its outline, its empty middle, and its rotation.

use super::{
    arrangement::linked,
    geometry::{Outline, angle_between, cross, length, minus},
    motion::SharedPaths,
    window::{Point, Window, quantile, ratio, share},
};
use std::f64::consts::TAU;

/// Minimum share of agents in a connected group that is the main body; all other agents are strays.
const MAIN_BODY: f64 = 0.6;
/// If no connected group is a main body, agents further from the median position than this number of median distances are strays.
const STRAY: f64 = 2.5;
/// Depth in the outline of all paths above which an agent is inside, not on the rim.
const INSIDE: f64 = 0.2;

/// Measures of the main body: the largest group of agents that touching paths connect, if most of the swarm is in this group.
///
/// A depth is the distance from the convex outline, divided by the radius of a circle of the same area. The depth is 0 on a
/// convex ring, and up to 1 in the ring's middle.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Median over agents of their mean depth in the outline of all paths.
    pub depth: f64,
    /// Share of agents whose mean depth is over 0.2.
    pub inside: f64,
    /// Greatest depth of an agent in the outline of the swarm at the end.
    pub deepest: f64,
    /// How hollow the body is: the fifth percentile of the distances from the centre, divided by the outline's radius.
    pub hollow: f64,
    /// Widest angle at the centre without an agent at the end, in radians.
    pub gap: f64,
    /// Mean signed angle that an agent goes round the centre, as an absolute value, in radians.
    pub round: f64,
    /// Angle that at least three agents in four go round the centre in the swarm's direction, in radians.
    pub round_by_most: f64,
    /// 1 if all agents go round the centre the same way, 0 if half of the agents go the other way.
    pub one_way: f64,
    /// Share of the motion that goes around the centre, rather than towards or away from the centre.
    pub tangential: f64,
}

impl Body {
    pub(super) fn of(window: &Window, shared: &SharedPaths) -> Self {
        let members = members(window, shared);
        let paths: Vec<&[Point]> = members.iter().map(|&i| window.paths()[i].as_slice()).collect();
        let Some(outline) = Outline::around(paths.concat()) else {
            return Self::flat();
        };
        let end: Vec<Point> = paths.iter().map(|path| path[path.len() - 1]).collect();
        let depths: Vec<f64> = paths
            .iter()
            .map(|path| path.iter().map(|&point| outline.depth(point)).sum::<f64>() / path.len() as f64)
            .collect();
        let centre = outline.centre();
        let from_centre = paths.iter().flat_map(|path| path.iter());
        let from_centre = from_centre.map(|&point| length(minus(point, centre)) / outline.radius());
        let turns: Vec<f64> = paths.iter().map(|path| around(path, centre)).collect();
        let agents = turns.len() as f64;
        let way = turns.iter().sum::<f64>().signum();
        let senses = turns
            .iter()
            .map(|&turn| if turn == 0.0 { 0.0 } else { turn.signum() });
        Self {
            inside: share(depths.iter().map(|&depth| depth > INSIDE)),
            depth: quantile(depths.into_iter(), 0.5),
            deepest: deepest(end.clone()),
            hollow: quantile(from_centre, 0.05),
            gap: widest_gap(&end, centre),
            one_way: senses.sum::<f64>().abs() / agents,
            round: turns.iter().sum::<f64>().abs() / agents,
            round_by_most: quantile(turns.iter().map(|turn| turn * way), 0.25).max(0.0),
            tangential: tangential(&paths, centre),
        }
    }

    /// Measures of a swarm whose paths all lie on one line.
    const fn flat() -> Self {
        Self {
            depth: 1.0,
            inside: 1.0,
            deepest: 1.0,
            hollow: 0.0,
            gap: TAU,
            round: 0.0,
            round_by_most: 0.0,
            one_way: 0.0,
            tangential: 0.0,
        }
    }
}

/// The agents of the main body.
fn members(window: &Window, shared: &SharedPaths) -> Vec<usize> {
    let paths = window.paths();
    let everyone = 0..paths.len();
    let end = window.end();
    let mut groups = linked(paths.len(), |i, j| shared.touch(i, j)).into_iter();
    let largest = groups.next().unwrap_or_default();
    let outline = Outline::around(largest.iter().flat_map(|&i| paths[i].iter().copied()).collect());
    let within = |i: usize| outline.as_ref().is_some_and(|outline| outline.contains(end[i]));
    let body: Vec<usize> = everyone
        .clone()
        .filter(|&i| largest.binary_search(&i).is_ok() || within(i))
        .collect();
    if body.len() as f64 >= MAIN_BODY * paths.len() as f64 {
        return body;
    }
    let middle = [0, 1].map(|axis| quantile(end.iter().map(|point| point[axis]), 0.5));
    let distance = |i: usize| length(minus(end[i], middle));
    let reach = STRAY * quantile(everyone.clone().map(distance), 0.5);
    everyone.filter(|&i| distance(i) <= reach).collect()
}

fn deepest(end: Vec<Point>) -> f64 {
    Outline::around(end.clone()).map_or(1.0, |outline| {
        end.iter().map(|&point| outline.depth(point)).fold(0.0, f64::max)
    })
}

/// Signed angle that a path goes round `centre`, in radians.
fn around(path: &[Point], centre: Point) -> f64 {
    path.windows(2)
        .map(|pair| angle_between(minus(pair[0], centre), minus(pair[1], centre)))
        .sum()
}

fn widest_gap(points: &[Point], centre: Point) -> f64 {
    let mut angles: Vec<f64> = points
        .iter()
        .map(|&point| angle_between([1.0, 0.0], minus(point, centre)))
        .collect();
    angles.sort_by(f64::total_cmp);
    let across = angles
        .first()
        .zip(angles.last())
        .map_or(TAU, |(first, last)| first + TAU - last);
    angles
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(across, f64::max)
}

fn tangential(paths: &[&[Point]], centre: Point) -> f64 {
    let (mut round, mut all) = (0.0, 0.0);
    for pair in paths.iter().flat_map(|path| path.windows(2)) {
        let (arm, step) = (minus(pair[0], centre), minus(pair[1], pair[0]));
        round += ratio(cross(arm, step).abs(), length(arm));
        all += length(step);
    }
    ratio(round, all)
}
