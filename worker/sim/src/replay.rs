//! Records the motion of a swarm.

use crate::simulate::{Start, Swarm};
use murmuration_swarm::{Controller, Frames, Invalid, Replay, World};
use std::{iter, num::NonZeroU32};

/// Maximum number of poses in a replay (240 MB). A longer replay is refused.
pub const MAX_POSES: u64 = 20_000_000;

/// Simulates `controller` from `start` over the world's horizon. Records the start, every `stride`-th step, and the end.
///
/// # Errors
/// Fails if `start` does not fit the world, if the replay would have more than [`MAX_POSES`] poses, or if a pose is not finite.
pub fn replay(
    controller: &Controller,
    world: &World,
    start: &Start,
    stride: NonZeroU32,
) -> Result<Replay, Invalid> {
    let swarm = Swarm::new(controller, world, start)?;
    let horizon = world.horizon();
    let frames = u64::from(horizon.div_ceil(stride.get())) + 1;
    let poses = frames * u64::from(world.agents());
    if poses > MAX_POSES {
        let allowed = format!("enough to keep {poses} poses under {MAX_POSES}");
        return Err(Invalid::new("stride", stride, allowed));
    }
    let steps = (0..horizon).step_by(stride.get() as usize).chain([horizon]);
    record(swarm, steps, poses)
}

/// Simulates `controller` from `start` over the world's horizon, and records the given frames.
///
/// # Errors
/// Fails if `start` does not fit the world, or a pose is not finite.
pub fn replay_frames(
    controller: &Controller,
    world: &World,
    start: &Start,
    frames: &Frames,
) -> Result<Replay, Invalid> {
    let swarm = Swarm::new(controller, world, start)?;
    record(swarm, frames.steps(world), frames.poses(world))
}

/// Simulates `controller` from `start` over the world's horizon. Returns the pose (x, y, heading) of each robot before the first
/// step and after every step, in full precision.
///
/// # Errors
/// Fails if `start` does not fit the world, or if the motion has more than [`MAX_POSES`] poses.
pub fn poses(controller: &Controller, world: &World, start: &Start) -> Result<Vec<Vec<[f64; 3]>>, Invalid> {
    let motion = motion(controller, world, start)?;
    let frames = u64::from(world.horizon()) + 1;
    let poses = frames * u64::from(world.agents());
    if poses > MAX_POSES {
        let allowed = format!("short enough to keep {poses} poses under {MAX_POSES}");
        return Err(Invalid::new("world.horizon", world.horizon(), allowed));
    }
    Ok(motion.take(frames as usize).collect())
}

/// Simulates `controller` from `start` without end, regardless of the world's horizon. Yields the pose (x, y, heading) of each
/// robot before the first step and after every step, in full precision.
///
/// # Errors
/// Fails if `start` does not fit the world.
pub fn motion(
    controller: &Controller,
    world: &World,
    start: &Start,
) -> Result<impl Iterator<Item = Vec<[f64; 3]>> + use<>, Invalid> {
    let mut swarm = Swarm::new(controller, world, start)?;
    let now = |swarm: &Swarm| {
        let agents = swarm.agents();
        agents
            .map(|agent| [agent.position[0], agent.position[1], agent.theta])
            .collect()
    };
    let start = now(&swarm);
    let after_each_step = iter::repeat_with(move || {
        swarm.step();
        now(&swarm)
    });
    Ok(iter::once(start).chain(after_each_step))
}

/// Records the poses of a swarm at the `wanted` steps, which ascend from 0; `count` is the total number of poses.
fn record(mut swarm: Swarm, wanted: impl Iterator<Item = u32>, count: u64) -> Result<Replay, Invalid> {
    let agents = swarm.agents().count();
    let mut steps = Vec::new();
    let mut poses = Vec::with_capacity(count as usize);
    for step in wanted {
        swarm.advance(step - swarm.steps());
        steps.push(step);
        poses.extend(swarm.agents().map(|agent| {
            let [x, y] = agent.position;
            [x as f32, y as f32, agent.theta as f32]
        }));
    }
    Replay::new(steps, agents, poses)
}
