//! The paths that the second judge sees, and operations on points.

use murmuration_swarm::{Boundary, Pose, Replay, World};
use std::f64::consts::TAU;

/// Steps of the paths, as in the annotators' pictures; fewer if the motion is shorter.
const STEPS: u32 = 160;
/// Parts into which the steps are divided.
const PARTS: u32 = 40;

/// A point or a vector, world units.
pub(super) type Point = [f64; 2];

/// The paths of a swarm at the end of its motion; lengths are in world units.
#[derive(Debug)]
pub(super) struct Paths {
    /// 41 points for each robot.
    pub(super) paths: Vec<Vec<Point>>,
    /// Radius of a robot.
    pub(super) radius: f64,
    /// Side of a square with the area of the arena.
    pub(super) side: f64,
    /// Side of a square with a robot's share of the area of the arena.
    pub(super) spacing: f64,
    /// Middle of the smallest upright rectangle around the paths.
    pub(super) middle: Point,
    /// The lowest and highest coordinates that walls allow for a robot's centre; `None` without walls.
    pub(super) walls: Option<[Point; 2]>,
}

impl Paths {
    /// The paths at the end of a replay. On a torus, the paths continue across the edges, and lie near the middle of the swarm.
    pub(super) fn of(replay: &Replay, world: &World) -> Self {
        let frames: Vec<&[Pose]> = replay.frames().collect();
        let end = replay.steps().last().copied().unwrap_or(0);
        let begin = end.saturating_sub(STEPS);
        let frame = |part: u32| {
            let step = begin + (end - begin) * part / PARTS;
            replay.steps().partition_point(|&of| of <= step).max(1) - 1
        };
        let chosen: Vec<&[Pose]> = (0..=PARTS).map(|part| frames[frame(part)]).collect();
        let path = |robot: usize| -> Vec<Point> {
            let poses = chosen.iter().map(|frame| frame[robot]);
            poses.map(|[x, y, _]| [x.into(), y.into()]).collect()
        };
        let mut paths: Vec<Vec<Point>> = (0..replay.agents()).map(path).collect();
        if world.boundary() == Boundary::Torus {
            join(&mut paths, world);
        }
        let (margin, side) = (world.margin(), (world.width() * world.height()).sqrt());
        let walls = [[margin; 2], [world.width() - margin, world.height() - margin]];
        Self {
            radius: world.radius(),
            side,
            spacing: side / f64::from(world.agents()).sqrt(),
            middle: middle(&paths),
            walls: (world.boundary() == Boundary::Walls).then_some(walls),
            paths,
        }
    }

    /// Number of points of a path.
    pub(super) fn times(&self) -> usize {
        self.paths.first().map_or(0, Vec::len)
    }

    pub(super) fn at(&self, time: usize) -> Vec<Point> {
        self.paths.iter().map(|path| path[time]).collect()
    }

    pub(super) fn end(&self) -> Vec<Point> {
        self.at(self.times() - 1)
    }

    /// The mean position of each robot.
    pub(super) fn homes(&self) -> Vec<Point> {
        self.paths.iter().map(|path| centre(path)).collect()
    }
}

/// Joins paths on a torus that were cut at its edges, and brings them near the middle of the swarm.
fn join(paths: &mut [Vec<Point>], torus: &World) {
    let sides = [torus.width(), torus.height()];
    let ends = paths.iter().map(|path| path[path.len() - 1]);
    // The mean is circular, because the edges of a torus are not special.
    let sums = ends.fold([[0.0; 2]; 2], |sums, end| {
        [0, 1].map(|axis| {
            let (sine, cosine) = libm::sincos(end[axis] / sides[axis] * TAU);
            [sums[axis][0] + sine, sums[axis][1] + cosine]
        })
    });
    let middle = [0, 1].map(|axis| libm::atan2(sums[axis][0], sums[axis][1]) / TAU * sides[axis]);
    for path in paths {
        let mut near = middle;
        for point in path.iter_mut().rev() {
            let way = torus.way(near, *point);
            near = [0, 1].map(|axis| near[axis] + way[axis]);
            *point = near;
        }
    }
}

fn middle(paths: &[Vec<Point>]) -> Point {
    let all = paths.iter().flatten();
    let (low, high) = all.fold(
        ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]),
        |(low, high), point| {
            (
                [0, 1].map(|axis| point[axis].min(low[axis])),
                [0, 1].map(|axis| point[axis].max(high[axis])),
            )
        },
    );
    [0, 1].map(|axis| (low[axis] + high[axis]) / 2.0)
}

/// The mean of one or more points.
pub(super) fn centre(points: &[Point]) -> Point {
    let count = points.len() as f64;
    [0, 1].map(|axis| points.iter().map(|point| point[axis]).sum::<f64>() / count)
}

pub(super) fn minus(a: Point, b: Point) -> Point {
    [a[0] - b[0], a[1] - b[1]]
}

pub(super) fn dot(a: Point, b: Point) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

pub(super) fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}

pub(super) fn length(a: Point) -> f64 {
    dot(a, a).sqrt()
}

pub(super) fn distance(a: Point, b: Point) -> f64 {
    length(minus(a, b))
}
