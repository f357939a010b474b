//! The motion of a swarm, recorded to be watched.

use crate::simulate::{Start, Swarm};
use murmuration_proto::{Controller, Invalid, Replay, World};
use std::num::NonZeroU32;

/// Most poses in a replay (240 MB): more is refused rather than held in memory.
pub const MAX_POSES: u64 = 20_000_000;

/// Simulates `controller` from `start` over the world's horizon, with a frame of the start, one every `stride`
/// steps, and one of the end.
///
/// # Errors
/// Where `start` does not fit the world, the replay would hold more than [`MAX_POSES`], or a pose is not finite.
pub fn replay(
    controller: &Controller,
    world: &World,
    start: &Start,
    stride: NonZeroU32,
) -> Result<Replay, Invalid> {
    let horizon = world.horizon();
    let frames = u64::from(horizon.div_ceil(stride.get())) + 1;
    let poses = frames * u64::from(world.agents());
    if poses > MAX_POSES {
        let allowed = format!("enough to keep {poses} poses under {MAX_POSES}");
        return Err(Invalid::new("stride", stride, allowed));
    }
    let mut swarm = Swarm::new(controller, world, start)?;
    let mut steps = Vec::new();
    let mut poses = Vec::with_capacity(poses as usize);
    loop {
        steps.push(swarm.steps());
        poses.extend(swarm.agents().map(|agent| {
            let [x, y] = agent.position;
            [x as f32, y as f32, agent.theta as f32]
        }));
        if swarm.steps() == horizon {
            return Replay::new(steps, world.agents() as usize, poses);
        }
        swarm.advance(stride.get().min(horizon - swarm.steps()));
    }
}
