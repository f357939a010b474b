//! A world without edges: a robot that leaves at one side enters at the other.
//!
//! A robot has nine images, in the world and around the world. Only the image that is nearest along each axis touches other
//! robots and is seen.

use super::{
    gaze::{Gaze, Group},
    others::{Everyone, Others},
    sight::{Observer, Reach},
};
use murmuration_swarm::{Obstacle, World};
use pulp::Simd;

/// The sides of the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torus([f64; 2]);

/// The other robots as one robot perceives them on a torus: the nearest image of each robot.
///
/// Checks robots one by one: neither a grid with wrapping cells nor vectors are worth their code.
pub(super) struct Images<'a, O> {
    pub(super) torus: Torus,
    pub(super) others: &'a O,
}

impl Torus {
    pub(super) fn new(world: &World) -> Self {
        Self([world.width(), world.height()])
    }

    /// Wraps a position into the world: each coordinate is then at least 0 and below the world's side.
    pub(super) fn wrap(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let side = self.0[axis];
            let wrapped = at[axis].rem_euclid(side);
            // For values slightly below 0, the remainder rounds to the whole side.
            if wrapped == side { 0.0 } else { wrapped }
        })
    }

    /// The image of `other` that is nearest to `at` along each axis. The two positions can be a few pushes outside of the world.
    pub(super) fn nearest(&self, mut other: [f64; 2], at: [f64; 2]) -> [f64; 2] {
        for axis in [0, 1] {
            let side = self.0[axis];
            while other[axis] - at[axis] > side / 2.0 {
                other[axis] -= side;
            }
            while at[axis] - other[axis] > side / 2.0 {
                other[axis] += side;
            }
        }
        other
    }

    /// The image of an obstacle whose centre is nearest to `at`, and the eight images around it, because an obstacle can be wider
    /// than half the world.
    pub(super) fn images(&self, obstacle: &Obstacle, at: [f64; 2]) -> impl Iterator<Item = Obstacle> {
        let nearest = self.nearest(obstacle.centre(), at);
        let obstacle = *obstacle;
        SHIFTS.into_iter().map(move |by| {
            let centre = [0, 1].map(|axis| nearest[axis] + by[axis] * self.0[axis]);
            match obstacle {
                Obstacle::Disc { radius, .. } => Obstacle::Disc { centre, radius },
                Obstacle::Box { size, .. } => Obstacle::Box { centre, size },
            }
        })
    }
}

/// Offsets from an image to itself and to the images around it, in sides of the world.
const SHIFTS: [[f64; 2]; 9] = [
    [0.0, 0.0],
    [-1.0, 0.0],
    [1.0, 0.0],
    [0.0, -1.0],
    [0.0, 1.0],
    [-1.0, -1.0],
    [-1.0, 1.0],
    [1.0, -1.0],
    [1.0, 1.0],
];

impl<O: Everyone> Images<'_, O> {
    /// For each robot of `group` other than `me`: its index, and its image nearest to `at`.
    fn of(&self, group: &Group, me: usize, at: [f64; 2]) -> impl Iterator<Item = (usize, [f64; 2])> {
        let others = (group.first..group.end).filter(move |&i| i != me);
        others.map(move |i| (i, self.near(i, at)))
    }

    fn all(&self, me: usize, at: [f64; 2]) -> impl Iterator<Item = [f64; 2]> {
        let others = (0..self.others.count()).filter(move |&i| i != me);
        others.map(move |i| self.near(i, at))
    }
}

impl<O: Everyone> Others for Images<'_, O> {
    fn near(&self, i: usize, at: [f64; 2]) -> [f64; 2] {
        self.torus.nearest(self.others.get(i), at)
    }

    fn sense<S: Simd, const SENSORS: usize>(&self, _: S, observer: Observer<SENSORS>, reach: Reach) -> u8 {
        let Observer { index, at, rays } = observer;
        let hit = |ray: &[f64; 2]| self.all(index, at).any(|other| reach.meets(other, at, *ray));
        rays.iter().fold(0, |state, ray| 2 * state + u8::from(hit(ray)))
    }

    fn sense_unless_touched<S: Simd, const SENSORS: usize>(
        &self,
        simd: S,
        observer: Observer<SENSORS>,
        reach: Reach,
    ) -> Option<u8> {
        let Observer { index, at, .. } = observer;
        let touched = self.all(index, at).any(|other| reach.touches(other, at));
        (!touched).then(|| self.sense(simd, observer, reach))
    }

    fn list_touched<S: Simd>(
        &self,
        _: S,
        list: &mut Vec<usize>,
        group: &Group,
        me: usize,
        at: [f64; 2],
        touch: f64,
    ) {
        let reach = Reach::touching(touch);
        let touched = self
            .of(group, me, at)
            .filter(|&(_, other)| reach.touches(other, at));
        list.extend(touched.map(|(i, _)| i));
    }

    fn sees<S: Simd>(&self, _: S, gaze: &Gaze, group: &Group, me: usize, at: [f64; 2]) -> bool {
        let body = group.radius * group.radius;
        self.of(group, me, at)
            .any(|(_, other)| gaze.sees(other, at, body))
    }
}
