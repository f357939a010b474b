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

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::{CapabilityModel, v1};

    fn record(horizon: u32, stride: u32) -> Result<Replay, Invalid> {
        let message = v1::World {
            horizon: Some(horizon),
            ..World::default().into()
        };
        let controller = Controller::new(CapabilityModel::SingleSensor, &[0.6, 1.0, 0.4, 0.5])?;
        let world = World::try_from(message)?;
        replay(
            &controller,
            &world,
            &Start::seeded(4),
            NonZeroU32::new(stride).unwrap(),
        )
    }

    #[test]
    fn there_is_a_frame_of_the_start_of_every_stride_and_of_the_end() {
        let check = |horizon, stride, expected: &[u32]| {
            assert_eq!(record(horizon, stride).unwrap().steps(), expected);
        };
        check(10, 4, &[0, 4, 8, 10]);
        check(8, 4, &[0, 4, 8]);
        check(3, 1, &[0, 1, 2, 3]);
        check(3, u32::MAX, &[0, 3]);
    }

    #[test]
    fn the_frames_are_the_same_whatever_the_stride() {
        let (coarse, fine) = (record(300, 100).unwrap(), record(300, 1).unwrap());
        let fine: Vec<_> = fine.frames().step_by(100).collect();
        assert!(coarse.frames().eq(fine));
    }

    #[test]
    fn what_would_not_fit_in_memory_is_refused() {
        let error = record(10_000_000, 1).unwrap_err();
        assert_eq!(error.field, "stride");
    }
}
