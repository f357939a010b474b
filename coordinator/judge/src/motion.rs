//! The motion of agents, and the relation of their paths.

use super::{
    geometry::{angle_between, cross, distance_to_segment, dot, length, minus, segments_cross},
    scale::Scale,
    statistics::{quantile, ratio, share},
    window::{Point, Window, mean},
};

/// An agent follows another agent's path within this distance if it goes the same way; in radii.
const FOLLOWED: f64 = 1.5;
/// Paths that come within this distance touch; in radii.
const SHARED: f64 = 2.0;
/// Cosine from which on two directions count as the same.
const SAME_WAY: f64 = 0.85;
/// Sine from which on two paths cross rather than merge.
const ACROSS: f64 = 0.35;
/// Movement in a fortieth of the window below which an agent has no direction; in radii.
const STANDS: f64 = 0.08;
/// The same for a twentieth of the window, for measuring turns.
const TURNS_ON_THE_SPOT: f64 = 0.2;

/// Measures of the agents' paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Mean distance between an agent's first and last position; in spacings.
    pub net: f64,
    /// Median of an agent's largest distance from the centre of its own path; in spacings.
    pub reach: f64,
    /// Upper quartile of the same.
    pub far_reach: f64,
    /// Median angle that an agent's direction of motion turns through, radians.
    pub turning: f64,
    /// 1 if all turning goes one way round, 0 if half of it goes the other way.
    pub one_sense: f64,
    /// Share of path points where another agent's path passes in the same direction within 1.5 radii.
    pub following: f64,
    /// Mean number of agents whose paths an agent's path crosses.
    pub crossed: f64,
}

/// Which paths touch each other.
#[derive(Debug, Clone)]
pub(super) struct SharedPaths {
    agents: usize,
    shared: Vec<bool>,
}

impl SharedPaths {
    /// Whether two agents' paths touch.
    pub(super) fn touch(&self, i: usize, j: usize) -> bool {
        self.shared[i * self.agents + j] || self.shared[j * self.agents + i]
    }
}

impl Motion {
    pub(super) fn of(window: &Window, scale: &Scale) -> (Self, SharedPaths) {
        let paths = window.paths();
        let turned: Vec<[f64; 2]> = paths.iter().map(|path| turned(path, scale)).collect();
        let [signed, absolute] = [0, 1].map(|i| turned.iter().map(|turn| turn[i]).sum::<f64>());
        let reach = || paths.iter().map(|path| reach(path) / scale.spacing);
        let net = paths
            .iter()
            .map(|path| length(minus(path[path.len() - 1], path[0])));
        let (following, shared) = following(paths, scale);
        let motion = Self {
            net: net.sum::<f64>() / paths.len() as f64 / scale.spacing,
            reach: quantile(reach(), 0.5),
            far_reach: quantile(reach(), 0.75),
            turning: quantile(turned.iter().map(|turn| turn[0].abs()), 0.5),
            one_sense: ratio(signed.abs(), absolute),
            following,
            crossed: crossed(paths, scale),
        };
        (motion, shared)
    }
}

fn reach(path: &[Point]) -> f64 {
    let home = mean(path);
    path.iter()
        .map(|&point| length(minus(point, home)))
        .fold(0.0, f64::max)
}

/// Angle that the direction of motion turns through, signed, and with every turn counted as positive.
fn turned(path: &[Point], scale: &Scale) -> [f64; 2] {
    let coarse: Vec<Point> = path.iter().copied().step_by(2).collect();
    let moves: Vec<Point> = coarse.windows(2).map(|pair| minus(pair[1], pair[0])).collect();
    let moving = |step: Point| length(step) > TURNS_ON_THE_SPOT * scale.radius;
    let turns = moves.windows(2).filter(|pair| moving(pair[0]) && moving(pair[1]));
    turns.fold([0.0; 2], |[signed, absolute], pair| {
        let turn = angle_between(pair[0], pair[1]);
        [signed + turn, absolute + turn.abs()]
    })
}

fn segments(path: &[Point]) -> impl Iterator<Item = [Point; 2]> {
    path.windows(2).map(|pair| [pair[0], pair[1]])
}

/// Share of path points on another agent's path in its direction; and which paths touch.
fn following(paths: &[Vec<Point>], scale: &Scale) -> (f64, SharedPaths) {
    let agents = paths.len();
    let mut shared = vec![false; agents * agents];
    let mut followed = Vec::new();
    for (i, path) in paths.iter().enumerate() {
        for [from, to] in segments(path) {
            let here = mean(&[from, to]);
            let mut nearest = (f64::INFINITY, [0.0; 2]);
            for (j, other) in paths.iter().enumerate().filter(|&(j, _)| j != i) {
                for [a, b] in segments(other) {
                    let distance = distance_to_segment(here, a, b);
                    if distance < nearest.0 {
                        nearest = (distance, minus(b, a));
                    }
                    shared[i * agents + j] |= distance < SHARED * scale.radius;
                }
            }
            let (distance, theirs) = nearest;
            let own = minus(to, from);
            let moves = length(own) > STANDS * scale.radius;
            let along = dot(own, theirs) > SAME_WAY * length(own) * length(theirs);
            followed.push(moves && along && distance < FOLLOWED * scale.radius);
        }
    }
    (share(followed.into_iter()), SharedPaths { agents, shared })
}

/// Mean number of agents whose paths cross an agent's path.
fn crossed(paths: &[Vec<Point>], scale: &Scale) -> f64 {
    let moves = |[a, b]: [Point; 2]| length(minus(b, a)) > STANDS * scale.radius;
    let across = |[a, b]: [Point; 2], [c, d]: [Point; 2]| {
        let (own, theirs) = (minus(b, a), minus(d, c));
        moves([c, d])
            && cross(own, theirs).abs() > ACROSS * length(own) * length(theirs)
            && segments_cross([a, b], [c, d])
    };
    let pair = |i: usize, j: usize| {
        segments(&paths[i])
            .filter(|&own| moves(own))
            .any(|own| segments(&paths[j]).any(|theirs| across(own, theirs)))
    };
    let pairs = (0..paths.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    2.0 * pairs.filter(|&(i, j)| pair(i, j)).count() as f64 / paths.len() as f64
}
