//! The motion of a swarm at the walls.

use super::{
    Scale,
    geometry::{cross, length, minus},
    window::{Point, Window, mean, ratio, share},
};
use murmuration_swarm::{Boundary, World};

/// An agent is near a wall if it is at most this far from touching the wall, in radii.
const NEAR: f64 = 4.0;
/// An agent moves along a wall if it is at most this far from touching the wall, in radii.
const ALONG: f64 = 3.0;

/// Measures of motion at the walls.
#[derive(Debug, Clone, PartialEq)]
pub struct Walls {
    /// Share of time that agents spend within four radii of touching a wall.
    pub near: f64,
    /// Share of all motion that is within three radii of touching a wall.
    pub along: f64,
    /// Share of the motion along walls that goes one way around the arena. The share is 0 if half of this motion goes each way,
    /// or if all goes straight at the walls.
    pub circulation: f64,
    /// Mean length of an agent's path along walls, in spacings.
    pub way: f64,
}

impl Walls {
    /// Measures in a world without walls.
    const NONE: Self = Self {
        near: 0.0,
        along: 0.0,
        circulation: 0.0,
        way: 0.0,
    };

    pub(super) fn of(window: &Window, world: &World, scale: &Scale) -> Self {
        if world.boundary() != Boundary::Walls {
            return Self::NONE;
        }
        let room = |point: Point| room(point, world) / scale.radius;
        let centre = [world.width() / 2.0, world.height() / 2.0];
        let (mut all, mut along, mut around) = (0.0, 0.0, 0.0);
        for pair in window.paths().iter().flat_map(|path| path.windows(2)) {
            let step = minus(pair[1], pair[0]);
            let middle = mean(pair);
            all += length(step);
            if room(middle) < ALONG {
                let arm = minus(middle, centre);
                along += length(step);
                around += ratio(cross(arm, step), length(arm));
            }
        }
        let points = window.paths().iter().flatten();
        Self {
            near: share(points.map(|&point| room(point) < NEAR)),
            along: ratio(along, all),
            circulation: ratio(around.abs(), along),
            way: along / window.paths().len() as f64 / scale.spacing,
        }
    }
}

/// Distance of an agent's centre from the place where its body would touch the nearest wall.
fn room([x, y]: Point, world: &World) -> f64 {
    let room = |value: f64, side: f64| value.min(side - value) - world.margin();
    room(x, world.width()).min(room(y, world.height()))
}
