//! Pushes robots out of obstacles, and tests whether sensors see obstacles.

use super::{
    collide::{GAP, PASSES},
    gaze::Gaze,
    torus::Torus,
};
use murmuration_swarm::{Boundary, Obstacle, World};

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

    /// Whether `wanted` accepts any obstacle, or on a torus any image of an obstacle near `at`.
    fn any(&self, at: [f64; 2], wanted: impl FnMut(&Obstacle) -> bool) -> bool {
        self.find(at, wanted).is_some()
    }

    /// The first obstacle or image that `wanted` accepts, as in [`Obstacles::any`].
    fn find(&self, at: [f64; 2], mut wanted: impl FnMut(&Obstacle) -> bool) -> Option<Obstacle> {
        match &self.torus {
            None => self.all.iter().find(|obstacle| wanted(obstacle)).copied(),
            Some(torus) => {
                let mut images = self.all.iter().flat_map(|obstacle| torus.images(obstacle, at));
                images.find(wanted)
            }
        }
    }

    /// Pushes a robot of this radius, which moved from `before` to `at`, out of all obstacles, and returns its new position. `at`
    /// is inside the edges; `home` moves a position back inside the edges.
    ///
    /// The result is outside of all obstacles, unless obstacles fill a torus. The first of these ways that succeeds gives the
    /// result:
    ///
    /// 1. Push the robot out of one obstacle after the other, in their order, each time to the nearest place plus a small gap.
    ///    Then move the robot back inside the edges. Repeat for at most [`PASSES`] passes.
    /// 2. Leave the robot at `before`.
    /// 3. Move the robot out along an axis: by the shortest way that ends inside the edges, or else by the shortest way.
    #[inline(never)]
    pub(super) fn push_out(
        &self,
        radius: f64,
        before: [f64; 2],
        mut at: [f64; 2],
        home: impl Fn([f64; 2]) -> [f64; 2],
    ) -> [f64; 2] {
        // A robot at a position that is not finite is near no obstacle.
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

    /// The position where a robot that moves along an axis in this direction gets out of all obstacles. The robot passes at most
    /// as many obstacles as the world has, because obstacles on a torus can have no end.
    fn way_out(&self, radius: f64, mut at: [f64; 2], (axis, sign): (usize, f64)) -> [f64; 2] {
        for _ in 0..self.all.len() {
            let Some(inside) = self.find(at, |obstacle| obstacle.distance(at) < radius) else {
                break;
            };
            at[axis] = inside.centre()[axis] + sign * (inside.half_size()[axis] + radius + GAP);
        }
        at
    }

    /// Whether a sensor sees any obstacle from `at`.
    pub(super) fn seen(&self, gaze: &Gaze, at: [f64; 2]) -> bool {
        self.any(at, |obstacle| match *obstacle {
            Obstacle::Disc { centre, radius } => gaze.sees_disc(centre, radius, at),
            Obstacle::Box { centre, .. } => gaze.sees_box(centre, obstacle.half_size(), at),
        })
    }
}

/// Pushes a robot out of one obstacle, if it is inside, to the nearest place outside.
fn pushed(obstacle: &Obstacle, radius: f64, at: [f64; 2]) -> [f64; 2] {
    if obstacle.distance(at) >= radius {
        return at;
    }
    let centre = obstacle.centre();
    let off = [at[0] - centre[0], at[1] - centre[1]];
    // The robot must keep a distance from the disc's centre, or from the box's rectangle. `core` is the nearest point of this
    // centre or rectangle, and `enough` is the distance from `core`.
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
        // From the exact centre of a disc, the way out is equally long in all directions.
        false => [1.0, 0.0],
    };
    [0, 1].map(|axis| centre[axis] + core[axis] + enough * direction[axis])
}

/// Pushes a robot whose centre is in a box, at `off` from the box's centre, out of the nearest side.
fn out_of_side(centre: [f64; 2], half: [f64; 2], off: [f64; 2], radius: f64) -> [f64; 2] {
    let depth = |axis: usize| half[axis] - off[axis].abs();
    let axis = usize::from(depth(1) < depth(0));
    let sign = if off[axis] < 0.0 { -1.0 } else { 1.0 };
    let mut at = [centre[0] + off[0], centre[1] + off[1]];
    at[axis] = centre[axis] + sign * (half[axis] + radius + GAP);
    at
}
