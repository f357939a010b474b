//! Described robots where there is more than themselves and walls: noise.

use super::{
    Walls,
    collide::Collisions,
    drive::Gait,
    kinds::Kinds,
    mind::{Driven, Mind},
    noise::Noise,
    others::Others,
};
use pulp::Simd;

/// A swarm of described robots, and what its world does to them.
#[derive(Debug, Clone)]
pub(super) struct Situated {
    pub(super) kinds: Kinds,
    pub(super) noise: Noise,
}

impl Mind for &mut Situated {
    #[inline(always)]
    fn gait(&mut self, i: usize, sensed: u8) -> Gait {
        let sensed = self.noise.delayed(i, sensed);
        let (drive, pair) = self.kinds.driven_by(i, sensed);
        let noisy = self.noise.gait(i, drive, pair);
        noisy.unwrap_or_else(|| self.kinds.gait(i, sensed))
    }

    #[inline(always)]
    fn walls(&self, i: usize) -> &Walls {
        self.kinds.walls(i)
    }

    #[inline(always)]
    fn settle<S: Simd>(
        &mut self,
        simd: S,
        others: &impl Others,
        collisions: &mut Collisions,
        robot: Driven,
    ) -> ([f64; 2], u8) {
        let (at, sensed) = self.kinds.settle(simd, others, collisions, robot);
        let sensors = self.kinds.directions(robot.index).len();
        (at, self.noise.read(robot.index, sensors, sensed))
    }
}
