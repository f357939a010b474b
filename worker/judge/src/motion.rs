//! Measures of the agents' motion, and of how their paths relate.

use super::{
    Scale,
    geometry::{angle_between, cross, distance_to_segment, dot, length, minus, segments_cross},
    nearby::Pieces,
    window::{Point, Window, mean, quantile, ratio, share},
};

/// An agent follows another agent's path if it is within this distance, in radii, of the path and goes the same way.
const FOLLOWED: f64 = 1.5;
/// Two paths touch if they come within this distance of each other, in radii.
const SHARED: f64 = 2.0;
/// Minimum cosine of the angle between two directions that count as the same direction.
const SAME_WAY: f64 = 0.85;
/// Minimum sine of the angle between two paths that cross rather than merge.
const ACROSS: f64 = 0.35;
/// An agent that moves less than this in a fortieth of the window has no direction; in radii.
const STANDS: f64 = 0.08;
/// The turns of an agent that moves less than this in a twentieth of the window are not measured; in radii.
const TURNS_ON_THE_SPOT: f64 = 0.2;

/// Measures of the agents' paths.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Mean distance between an agent's first and last position, in spacings.
    pub net: f64,
    /// Median of an agent's largest distance from the centre of its own path, in spacings.
    pub reach: f64,
    /// Upper quartile of an agent's largest distance from the centre of its own path, in spacings.
    pub far_reach: f64,
    /// Median angle that an agent's direction of motion turns through, in radians.
    pub turning: f64,
    /// 1 if all agents turn the same way, 0 if half of the turning goes the other way.
    pub one_sense: f64,
    /// Share of path points where another agent's path passes in the same direction within 1.5 radii.
    pub following: f64,
    /// Mean number of agents whose paths an agent's path crosses.
    pub crossed: f64,
}

/// Which paths touch each other.
#[derive(Debug, Clone)]
pub(super) struct SharedPaths {
    /// For each agent, the other agents whose paths come near the midpoints of the pieces of its own path, ascending.
    near: Vec<Vec<usize>>,
}

impl SharedPaths {
    /// Whether two agents' paths touch.
    pub(super) fn touch(&self, i: usize, j: usize) -> bool {
        self.near[i].binary_search(&j).is_ok() || self.near[j].binary_search(&i).is_ok()
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
        let pieces = Pieces::of(paths, SHARED * scale.radius);
        let (following, shared) = following(paths, &pieces, scale);
        let motion = Self {
            net: net.sum::<f64>() / paths.len() as f64 / scale.spacing,
            reach: quantile(reach(), 0.5),
            far_reach: quantile(reach(), 0.75),
            turning: quantile(turned.iter().map(|turn| turn[0].abs()), 0.5),
            one_sense: ratio(signed.abs(), absolute),
            following,
            crossed: crossed(paths, &pieces, scale),
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

/// Sum of the turns of the direction of motion: signed, and absolute.
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

/// Share of path points where another agent's path passes in the same direction; and the paths that touch.
fn following(paths: &[Vec<Point>], pieces: &Pieces, scale: &Scale) -> (f64, SharedPaths) {
    let reach = SHARED * scale.radius;
    let mut near = Vec::with_capacity(paths.len());
    let mut followed = Vec::new();
    // For each agent, the last agent `i` whose path was found to be near this agent's path.
    let mut found = vec![None; paths.len()];
    for (i, path) in paths.iter().enumerate() {
        let mut touched = Vec::new();
        for [from, to] in segments(path) {
            let own = minus(to, from);
            let moves = length(own) > STANDS * scale.radius;
            let here = mean(&[from, to]);
            let mut nearest = (f64::INFINITY, usize::MAX, [0.0; 2]);
            for piece in pieces.near(here, reach).filter(|piece| piece.agent != i) {
                // A standing agent follows nobody: it matters only whether the paths touch.
                if !moves && found[piece.agent] == Some(i) {
                    continue;
                }
                let [a, b] = piece.ends;
                let distance = distance_to_segment(here, a, b);
                if (distance, piece.place) < (nearest.0, nearest.1) {
                    nearest = (distance, piece.place, minus(b, a));
                }
                if distance < reach && found[piece.agent] != Some(i) {
                    found[piece.agent] = Some(i);
                    touched.push(piece.agent);
                }
            }
            let (distance, _, theirs) = nearest;
            let along = dot(own, theirs) > SAME_WAY * length(own) * length(theirs);
            followed.push(moves && along && distance < FOLLOWED * scale.radius);
        }
        touched.sort_unstable();
        near.push(touched);
    }
    (share(followed.into_iter()), SharedPaths { near })
}

/// Mean number of agents whose paths cross an agent's path.
fn crossed(paths: &[Vec<Point>], pieces: &Pieces, scale: &Scale) -> f64 {
    let moves = |[a, b]: [Point; 2]| length(minus(b, a)) > STANDS * scale.radius;
    let across = |[a, b]: [Point; 2], [c, d]: [Point; 2]| {
        let (own, theirs) = (minus(b, a), minus(d, c));
        moves([c, d])
            && cross(own, theirs).abs() > ACROSS * length(own) * length(theirs)
            && segments_cross([a, b], [c, d])
    };
    let mut pairs = 0_usize;
    // For each agent, the last agent `i` whose path was found to cross this agent's path.
    let mut found = vec![None; paths.len()];
    for (i, path) in paths.iter().enumerate() {
        for own in segments(path).filter(|&own| moves(own)) {
            for piece in pieces.across(own).filter(|piece| piece.agent < i) {
                if found[piece.agent] != Some(i) && across(own, piece.ends) {
                    found[piece.agent] = Some(i);
                    pairs += 1;
                }
            }
        }
    }
    2.0 * pairs as f64 / paths.len() as f64
}

#[cfg(test)]
mod tests;
