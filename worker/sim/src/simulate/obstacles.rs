//! Obstacles: how robots are pushed out of them, and how sensors see them.

use super::{
    collide::{GAP, PASSES},
    gaze::Gaze,
    torus::Torus,
};
use murmuration_proto::{Boundary, Obstacle, World};

/// The obstacles of a world.
#[derive(Debug, Clone)]
pub(super) struct Obstacles {
    all: Vec<Obstacle>,
    torus: Option<Torus>,
}

impl Obstacles {
    /// The obstacles of a world.
    pub(super) fn new(world: &World) -> Self {
        Self {
            all: world.obstacles().to_vec(),
            torus: (world.boundary() == Boundary::Torus).then(|| Torus::new(world)),
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Whether any of them, or on a torus any image near `at`, is `wanted`.
    fn any(&self, at: [f64; 2], wanted: impl FnMut(&Obstacle) -> bool) -> bool {
        self.find(at, wanted).is_some()
    }

    /// As [`Obstacles::any`], the first.
    fn find(&self, at: [f64; 2], mut wanted: impl FnMut(&Obstacle) -> bool) -> Option<Obstacle> {
        match &self.torus {
            None => self.all.iter().find(|obstacle| wanted(obstacle)).copied(),
            Some(torus) => {
                let mut images = self.all.iter().flat_map(|obstacle| torus.images(obstacle, at));
                images.find(wanted)
            }
        }
    }

    /// Where a robot of this radius ends that was at `before` and is now at `at`, which is inside the edges; `home` takes a place
    /// back inside them.
    ///
    /// It ends inside no obstacle (on a torus that obstacles do not fill), in the first of these ways that leads there:
    ///
    /// 1. It is pushed out of one obstacle after the other, in their order, each time to the nearest place a little way from it;
    ///    then it is taken back inside the edges; and so again, in [`PASSES`] passes at most.
    /// 2. It stays where it was before.
    /// 3. It leaves along an axis, the shortest way that ends inside the edges, or else the shortest.
    #[inline(never)]
    pub(super) fn push_out(
        &self,
        radius: f64,
        before: [f64; 2],
        mut at: [f64; 2],
        home: impl Fn([f64; 2]) -> [f64; 2],
    ) -> [f64; 2] {
        // A robot whose place is not finite is nowhere near.
        if !at.iter().all(|value| value.is_finite()) {
            return at;
        }
        for _ in 0..PASSES {
            if self.is_free(radius, at) {
                return at;
            }
            let here = at;
            self.any(here, |obstacle| {
                at = pushed(obstacle, radius, at);
                false
            });
            at = home(at);
        }
        if self.is_free(radius, at) {
            return at;
        }
        if home(before) == before && self.is_free(radius, before) {
            return before;
        }
        let ways = [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0)].map(|way| self.way_out(radius, at, way));
        let length = |end: &[f64; 2]| (end[0] - at[0]).abs() + (end[1] - at[1]).abs();
        let rank = |&end: &[f64; 2]| (!self.is_free(radius, end), home(end) != end);
        let better = |a: &[f64; 2], b: &[f64; 2]| rank(a).cmp(&rank(b)).then(length(a).total_cmp(&length(b)));
        ways.into_iter().min_by(better).unwrap_or(at)
    }

    /// Whether a robot of this radius at `at` is inside no obstacle.
    fn is_free(&self, radius: f64, at: [f64; 2]) -> bool {
        !self.any(at, |obstacle| obstacle.distance(at) < radius)
    }

    /// Where a robot gets out of all obstacles that moves along an axis in this direction. It passes each of them once; on a
    /// torus there may be no end of them.
    fn way_out(&self, radius: f64, mut at: [f64; 2], (axis, sign): (usize, f64)) -> [f64; 2] {
        for _ in 0..self.all.len() {
            let Some(inside) = self.find(at, |obstacle| obstacle.distance(at) < radius) else {
                break;
            };
            at[axis] = inside.centre()[axis] + sign * (inside.half_size()[axis] + radius + GAP);
        }
        at
    }

    /// Whether a sensor sees any of them from `at`.
    pub(super) fn seen(&self, gaze: &Gaze, at: [f64; 2]) -> bool {
        self.any(at, |obstacle| match *obstacle {
            Obstacle::Disc { centre, radius } => gaze.sees_disc(centre, radius, at),
            Obstacle::Box { centre, .. } => gaze.sees_box(centre, obstacle.half_size(), at),
        })
    }
}

/// Where a robot ends that is pushed out of one obstacle, if it is inside: to the nearest place.
fn pushed(obstacle: &Obstacle, radius: f64, at: [f64; 2]) -> [f64; 2] {
    if obstacle.distance(at) >= radius {
        return at;
    }
    let centre = obstacle.centre();
    let off = [at[0] - centre[0], at[1] - centre[1]];
    // A disc is the room about its centre, a box that about the rectangle: the point of either that is nearest, and the distance
    // from it that is enough.
    let (core, enough) = match *obstacle {
        Obstacle::Disc { radius: own, .. } => ([0.0; 2], own + radius + GAP),
        Obstacle::Box { .. } => {
            let half = obstacle.half_size();
            let nearest = [0, 1].map(|axis| off[axis].clamp(-half[axis], half[axis]));
            if nearest == off {
                return out_of_side(centre, half, off, radius);
            }
            (nearest, radius + GAP)
        }
    };
    let away = [off[0] - core[0], off[1] - core[1]];
    let distance = (away[0] * away[0] + away[1] * away[1]).sqrt();
    let direction = match distance > 0.0 {
        true => away.map(|value| value / distance),
        // In the very centre of a disc all ways are as near.
        false => [1.0, 0.0],
    };
    [0, 1].map(|axis| centre[axis] + core[axis] + enough * direction[axis])
}

/// Where a robot ends whose centre is in a box, at `off` from the box's own: out of the nearest side.
fn out_of_side(centre: [f64; 2], half: [f64; 2], off: [f64; 2], radius: f64) -> [f64; 2] {
    let depth = |axis: usize| half[axis] - off[axis].abs();
    let axis = usize::from(depth(1) < depth(0));
    let sign = if off[axis] < 0.0 { -1.0 } else { 1.0 };
    let mut at = [centre[0] + off[0], centre[1] + off[1]];
    at[axis] = centre[axis] + sign * (half[axis] + radius + GAP);
    at
}
