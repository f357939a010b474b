//! Described robots in worlds with noise, obstacles or a torus.

use super::{
    Start,
    collide::Collisions,
    drive::Gait,
    kinds::Kinds,
    mind::{Bound, Driven, Mind},
    noise::Noise,
    others::Everyone,
    torus::{Images, Torus},
};
use murmuration_swarm::{Boundary, World};
use pulp::Simd;

/// Described robots, with the noise and the torus of their world.
#[derive(Debug, Clone)]
pub(super) struct Situated {
    kinds: Kinds,
    noise: Option<Noise>,
    torus: Option<Torus>,
}

impl Situated {
    /// Robots of these kinds in their world.
    pub(super) fn new(kinds: Kinds, world: &World, start: &Start) -> Self {
        Self {
            kinds,
            noise: Noise::new(world, start),
            torus: (world.boundary() == Boundary::Torus).then(|| Torus::new(world)),
        }
    }

    pub(super) const fn kinds(&self) -> &Kinds {
        &self.kinds
    }

    /// The sides of the world, if the world is a torus.
    pub(super) const fn torus(&self) -> Option<Torus> {
        self.torus
    }

    /// Reads a robot's sensors without noise, and without moving the robot.
    pub(super) fn sense<S: Simd>(&self, simd: S, others: &impl Everyone, robot: Driven) -> u8 {
        match self.torus {
            None => self.kinds.sense(simd, others, robot),
            Some(torus) => self.kinds.sense(simd, &Images { torus, others }, robot),
        }
    }

    /// Pushes robot `i` out of obstacles; see [`Obstacles::push_out`](super::obstacles::Obstacles::push_out).
    fn out_of_obstacles(
        &self,
        i: usize,
        before: [f64; 2],
        at: [f64; 2],
        home: impl Fn([f64; 2]) -> [f64; 2],
    ) -> [f64; 2] {
        let obstacles = self.kinds.obstacles();
        match obstacles.is_empty() {
            true => at,
            false => obstacles.push_out(self.kinds.radius(i), before, at, home),
        }
    }

    /// Implements [`Mind::bound`] on a torus.
    fn bound_on(&self, torus: Torus, i: usize, before: [f64; 2], driven: [f64; 2]) -> Bound {
        let home = torus.wrap(driven);
        let at = torus.wrap(self.out_of_obstacles(i, before, home, |at| torus.wrap(at)));
        if at == before {
            return Bound { at, from: before };
        }
        // Obstacles push a robot the shorter way around the torus.
        let pushed = torus.nearest(at, home);
        let from = [0, 1].map(|axis| at[axis] - (driven[axis] - before[axis]) - (pushed[axis] - home[axis]));
        Bound { at, from }
    }
}

impl Mind for &mut Situated {
    #[inline(always)]
    fn gait(&mut self, i: usize, sensed: u8) -> Gait {
        let Some(noise) = &mut self.noise else {
            return self.kinds.gait(i, sensed);
        };
        let sensed = noise.delayed(i, sensed);
        let (drive, pair) = self.kinds.driven_by(i, sensed);
        let noisy = noise.gait(i, drive, pair);
        noisy.unwrap_or_else(|| self.kinds.gait(i, sensed))
    }

    #[inline(always)]
    fn bound(&self, i: usize, before: [f64; 2], driven: [f64; 2]) -> Bound {
        if let Some(torus) = self.torus {
            return self.bound_on(torus, i, before, driven);
        }
        let walls = self.kinds.walls(i);
        let at = self.out_of_obstacles(i, before, walls.clamp(driven), |at| walls.clamp(at));
        Bound { at, from: before }
    }

    #[inline(always)]
    fn home(&self, at: [f64; 2]) -> [f64; 2] {
        self.torus.map_or(at, |torus| torus.wrap(at))
    }

    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        simd: S,
        others: &impl Everyone,
        collisions: &mut Collisions,
        robot: Driven,
    ) -> ([f64; 2], u8) {
        let (at, sensed) = match self.torus {
            None => self.kinds.settle(simd, others, collisions, robot),
            Some(torus) => {
                let others = Images { torus, others };
                let (at, sensed) = self.kinds.settle(simd, &others, collisions, robot);
                // Other robots also push a robot the shorter way around the torus.
                (torus.nearest(at, robot.at), sensed)
            }
        };
        let sensors = self.kinds.directions(robot.index).len();
        let read = |noise: &mut Noise| noise.read(robot.index, sensors, sensed);
        (at, self.noise.as_mut().map_or(sensed, read))
    }
}
