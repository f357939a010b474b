//! A world without edges: what leaves at one side comes in at the other.
//!
//! Of the nine images of a robot, in the world and around it, the one nearest along each axis is the one that touches and is
//! seen.

use super::{
    gaze::{Gaze, Group},
    others::{Everyone, Others},
    sight::{Observer, Reach},
};
use murmuration_proto::{Obstacle, World};
use pulp::Simd;

/// The sides of the world.
#[derive(Debug, Clone, Copy)]
pub(super) struct Torus([f64; 2]);

/// The other robots as one of them finds them on a torus, each by its nearest image.
///
/// It asks one after the other: a grid whose cells wrap is not worth its code, and neither is a vector.
pub(super) struct Images<'a, O> {
    pub(super) torus: Torus,
    pub(super) others: &'a O,
}

impl Torus {
    pub(super) fn new(world: &World) -> Self {
        Self([world.width(), world.height()])
    }

    /// The same place in the world: each coordinate from 0 to below the side.
    pub(super) fn wrap(&self, at: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|axis| {
            let side = self.0[axis];
            let wrapped = at[axis].rem_euclid(side);
            // A little below 0, the remainder rounds to the whole side.
            if wrapped == side { 0.0 } else { wrapped }
        })
    }

    /// The image of `other` that is nearest to `at` along each axis; both are at most some pushes out of the world.
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

    /// The image of an obstacle whose centre is nearest to `at`, and the eight around that: one alone may be wider than half the
    /// world.
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

/// Sides of the world from an image to those around it, itself first.
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
    /// The images of the robots of `group` other than `me` that are nearest to `at`, with their numbers.
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
