//! The last steps of a swarm's motion at evenly spaced times, and functions for statistics.

use murmuration_swarm::{Boundary, Pose, Replay, World};
use std::{f64::consts::TAU, num::NonZeroU32};

/// Number of steps in the window, as in the pictures that annotators judge; fewer if the motion is shorter.
pub(super) const WINDOW_STEPS: u32 = 160;
/// Steps between two times of the window, if the motion is long enough.
pub(super) const STRIDE: NonZeroU32 = NonZeroU32::MIN.saturating_add(3);
/// Number of intervals of the window: one for every four steps.
pub(super) const STRETCHES: u32 = WINDOW_STEPS / STRIDE.get();

/// A point or a vector, in world units; y points down the screen.
pub(super) type Point = [f64; 2];

/// The position of each agent at 41 evenly spaced times of the window.
#[derive(Debug, Clone)]
pub(super) struct Window {
    paths: Vec<Vec<Point>>,
}

impl Window {
    /// The window at the end of a replay; positions between two frames are interpolated. On a torus, paths continue across the
    /// edges and are shifted to lie around the swarm's centre, so that a group across an edge is one group.
    pub(super) fn of(replay: &Replay, world: &World) -> Self {
        let frames: Vec<&[Pose]> = replay.frames().collect();
        let end = replay.steps().last().copied().unwrap_or(0);
        let begin = end.saturating_sub(WINDOW_STEPS);
        let mut paths = vec![Vec::with_capacity(STRETCHES as usize + 1); replay.agents()];
        for stretch in 0..=STRETCHES {
            let time = f64::from(begin) + f64::from(end - begin) * f64::from(stretch) / f64::from(STRETCHES);
            let after = replay
                .steps()
                .partition_point(|&step| f64::from(step) < time)
                .min(frames.len() - 1);
            let before = after.saturating_sub(1);
            let [from, to] = [before, after].map(|frame| f64::from(replay.steps()[frame]));
            let part = if to > from {
                (time - from) / (to - from)
            } else {
                0.0
            };
            for (path, (a, b)) in paths.iter_mut().zip(frames[before].iter().zip(frames[after])) {
                let [a, b] = [a, b].map(|&[x, y, _]| [x, y].map(f64::from));
                let way = world.way(a, b);
                path.push([0, 1].map(|axis| a[axis] + way[axis] * part));
            }
        }
        if world.boundary() == Boundary::Torus {
            unroll(&mut paths, world);
        }
        Self { paths }
    }

    /// The paths of some agents: those whose number `chosen` holds for, in index order.
    pub(super) fn only(&self, chosen: impl Fn(usize) -> bool) -> Self {
        let paths = self.paths.iter().enumerate();
        let paths = paths.filter(|&(agent, _)| chosen(agent));
        Self {
            paths: paths.map(|(_, path)| path.clone()).collect(),
        }
    }

    /// One path per agent, in index order, each of 41 points.
    pub(super) fn paths(&self) -> &[Vec<Point>] {
        &self.paths
    }

    /// Number of sampled times.
    pub(super) fn times(&self) -> usize {
        self.paths.first().map_or(0, Vec::len)
    }

    /// Positions of the agents at one of the times.
    pub(super) fn at(&self, time: usize) -> impl Iterator<Item = Point> + Clone {
        self.paths.iter().map(move |path| path[time])
    }

    /// Positions of the agents at the end.
    pub(super) fn end(&self) -> Vec<Point> {
        self.at(self.times() - 1).collect()
    }

    /// The mean position of each agent.
    pub(super) fn homes(&self) -> Vec<Point> {
        self.paths.iter().map(|path| mean(path)).collect()
    }
}

/// Makes paths on a torus continuous, and moves each path by whole sides of the torus, so that its mean is near the swarm's
/// centre.
fn unroll(paths: &mut [Vec<Point>], torus: &World) {
    for path in &mut *paths {
        for place in 1..path.len() {
            let (before, way) = (path[place - 1], torus.way(path[place - 1], path[place]));
            path[place] = [0, 1].map(|axis| before[axis] + way[axis]);
        }
    }
    let homes: Vec<Point> = paths.iter().map(|path| mean(path)).collect();
    let sides = [torus.width(), torus.height()];
    let middle = [0, 1].map(|axis| circular_mean(homes.iter().map(|home| home[axis]), sides[axis]));
    for (path, home) in paths.iter_mut().zip(homes) {
        let way = torus.way(middle, home);
        let to = [0, 1].map(|axis| middle[axis] + way[axis]);
        for point in path {
            *point = [0, 1].map(|axis| point[axis] + to[axis] - home[axis]);
        }
    }
}

/// Circular mean of places on a circle of length `side`.
fn circular_mean(places: impl Iterator<Item = f64>, side: f64) -> f64 {
    let (sine, cosine) = places.fold((0.0, 0.0), |(sine, cosine), place| {
        let (s, c) = libm::sincos(place / side * TAU);
        (sine + s, cosine + c)
    });
    libm::atan2(sine, cosine) / TAU * side
}

/// The mean of at least one point.
pub(super) fn mean(points: &[Point]) -> Point {
    let count = points.len() as f64;
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count)
}

/// The `part` quantile (0 to 1) of at least one value.
pub(super) fn quantile(values: impl Iterator<Item = f64>, part: f64) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    let place = (part * sorted.len().saturating_sub(1) as f64).round() as usize;
    sorted.get(place).copied().unwrap_or(0.0)
}

/// Share of true values; 0 if there are no values.
pub(super) fn share(values: impl Iterator<Item = bool>) -> f64 {
    let (mut held, mut all) = (0.0, 0.0);
    for value in values {
        held += if value { 1.0 } else { 0.0 };
        all += 1.0;
    }
    ratio(held, all)
}

/// `part / whole`; 0 if `whole` is 0.
pub(super) fn ratio(part: f64, whole: f64) -> f64 {
    if whole > 0.0 { part / whole } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_is_the_same_whatever_the_stride_of_a_straight_motion() {
        let replay = |stride: usize| {
            let steps: Vec<u32> = (0..=1200).step_by(stride).collect();
            let poses = steps.iter().map(|&step| [step as f32, 7.0, 0.0]).collect();
            Window::of(&Replay::new(steps, 1, poses).unwrap(), &World::default())
        };
        for stride in [1, 3, 16, 1200] {
            let window = replay(stride);
            assert_eq!(window.times(), 41);
            for (k, [x, y]) in window.paths()[0].iter().enumerate() {
                assert!(
                    (x - (1040 + 4 * k) as f64).abs() < 1e-9 && *y == 7.0,
                    "{stride}: {x}"
                );
            }
        }
    }

    #[test]
    fn a_start_alone_is_a_motion_too() {
        let replay = Replay::new(vec![0], 1, vec![[3.0, 4.0, 0.0]]).unwrap();
        let window = Window::of(&replay, &World::default());
        assert!(window.paths()[0].iter().all(|&point| point == [3.0, 4.0]));
    }
}
