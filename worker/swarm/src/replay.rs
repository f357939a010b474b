//! The recorded motion of a swarm.

use crate::{Invalid, World, counted};
use murmuration_proto::v1;
use std::num::NonZeroU32;

/// Position and heading of an agent: x, y (world units, y points down the screen) and heading (radians).
pub type Pose = [f32; 3];

/// The motion of one swarm: its poses at ascending steps, the start (step 0) first.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    steps: Vec<u32>,
    agents: usize,
    poses: Vec<Pose>,
}

/// The frames of a motion to record: the start, a frame every `stride` steps from step `first` on, and the end. All frames
/// together have at most [`Frames::MAX_POSES`] poses.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frames {
    first: u32,
    stride: NonZeroU32,
}

impl Frames {
    /// Maximum number of poses of a motion (48 MB): number of frames times number of agents.
    pub const MAX_POSES: u64 = 4_000_000;
    /// Number of frames that is enough to watch a motion; a screen shows no more frames.
    pub const WATCHED: u32 = 400;

    /// Frames of a motion in `world`: every `stride` steps from step `first` on.
    ///
    /// # Errors
    /// If the stride is 0, or there would be more than [`Frames::MAX_POSES`] poses.
    pub fn new(first: u32, stride: u32, world: &World) -> Result<Self, Invalid> {
        let Some(stride) = NonZeroU32::new(stride) else {
            return Err(Invalid::new("stride", 0, "1 or more"));
        };
        let frames = Self { first, stride };
        let poses = frames.poses(world);
        if poses <= Self::MAX_POSES {
            return Ok(frames);
        }
        let allowed = format!(
            "larger: {} frames of {} agents are {poses} poses, and a motion may have {}",
            poses / u64::from(world.agents()),
            world.agents(),
            Self::MAX_POSES
        );
        Err(Invalid::new("stride", stride, allowed))
    }

    /// Frames that show a whole motion in `world`: about [`Frames::WATCHED`], fewer if there are too many agents.
    #[must_use]
    pub fn to_watch(world: &World) -> Self {
        let stride = NonZeroU32::new(world.horizon().div_ceil(Self::WATCHED)).unwrap_or(NonZeroU32::MIN);
        Self {
            first: 0,
            stride: stride.max(Self::least_stride(world.horizon(), world)),
        }
    }

    /// Frames of the last `steps` steps of a motion in `world`, every `stride` steps, or further apart if there are too many
    /// agents.
    #[must_use]
    pub fn of_end(steps: u32, stride: NonZeroU32, world: &World) -> Self {
        Self {
            first: world.horizon().saturating_sub(steps),
            stride: stride.max(Self::least_stride(steps, world)),
        }
    }

    /// The smallest stride at which this many steps have at most [`Frames::MAX_POSES`] poses.
    fn least_stride(steps: u32, world: &World) -> NonZeroU32 {
        // Start and end take one frame each.
        let frames = Self::MAX_POSES / u64::from(world.agents()) - 2;
        let stride = u64::from(steps).div_ceil(frames);
        u32::try_from(stride)
            .ok()
            .and_then(NonZeroU32::new)
            .unwrap_or(NonZeroU32::MIN)
    }

    /// The first step with a frame, apart from the start.
    #[must_use]
    pub const fn first(&self) -> u32 {
        self.first
    }

    /// Number of steps between two frames.
    #[must_use]
    pub const fn stride(&self) -> NonZeroU32 {
        self.stride
    }

    /// The steps that have a frame, ascending from 0 to the horizon.
    pub fn steps(&self, world: &World) -> impl Iterator<Item = u32> + use<> {
        let horizon = world.horizon();
        let first = if self.first == 0 {
            self.stride.get()
        } else {
            self.first
        };
        let between = (first..horizon).step_by(self.stride.get() as usize);
        std::iter::once(0).chain(between).chain([horizon])
    }

    /// Number of poses of these frames in `world`.
    #[must_use]
    pub fn poses(&self, world: &World) -> u64 {
        let recorded = world.horizon().saturating_sub(self.first);
        let between = u64::from(recorded.div_ceil(self.stride.get()));
        let start_and_end = if self.first == 0 { 1 } else { 2 };
        (between + start_and_end) * u64::from(world.agents())
    }
}

impl Replay {
    /// A replay of `agents` agents with one block of `agents` poses for each of `steps`.
    ///
    /// # Errors
    /// The error names the fault: no frame, no agent, steps out of order, too few or too many poses, or a pose that is not
    /// finite.
    pub fn new(steps: Vec<u32>, agents: usize, poses: Vec<Pose>) -> Result<Self, Invalid> {
        if steps.first() != Some(&0) || !steps.is_sorted_by(|a, b| a < b) {
            return Err(Invalid::new(
                "steps",
                counted(steps.len() as u64, "value"),
                "ascending from 0",
            ));
        }
        if agents == 0 || poses.len() != steps.len() * agents {
            let allowed = format!(
                "one pose for each frame and agent ({} x {agents}), at least one",
                steps.len()
            );
            return Err(Invalid::new(
                "poses",
                counted(poses.len() as u64, "pose"),
                allowed,
            ));
        }
        if !poses.iter().flatten().all(|value| value.is_finite()) {
            return Err(Invalid::new("poses", "not finite", "finite numbers"));
        }
        Ok(Self { steps, agents, poses })
    }

    /// Number of steps done at each frame, ascending from 0.
    #[must_use]
    pub fn steps(&self) -> &[u32] {
        &self.steps
    }

    /// Number of agents, at least 1.
    #[must_use]
    pub const fn agents(&self) -> usize {
        self.agents
    }

    /// The messages of the replay, part by part, in order.
    pub fn into_parts(self) -> impl Iterator<Item = v1::Replay> + Send {
        let bytes = self.agents * size_of::<Pose>();
        let frames = (murmuration_proto::PART_BYTES / bytes).max(1);
        let mut begin = 0;
        std::iter::from_fn(move || {
            let end = self.steps.len().min(begin + frames);
            let part = (begin < end).then(|| v1::Replay {
                agents: self.agents as u32,
                steps: self.steps[begin..end].to_vec(),
                poses: self.poses[begin * self.agents..end * self.agents]
                    .as_flattened()
                    .to_vec(),
            });
            begin = end;
            part
        })
    }

    /// The frames, each with one pose per agent, in index order.
    pub fn frames(&self) -> impl ExactSizeIterator<Item = &[Pose]> {
        self.poses.chunks_exact(self.agents)
    }
}

impl TryFrom<v1::Replay> for Replay {
    type Error = Invalid;

    fn try_from(message: v1::Replay) -> Result<Self, Invalid> {
        let (poses, rest) = message.poses.as_chunks::<3>();
        if !rest.is_empty() {
            return Err(Invalid::new(
                "poses",
                counted(message.poses.len() as u64, "value"),
                "three values for each pose",
            ));
        }
        Self::new(message.steps, message.agents as usize, poses.to_vec())
    }
}

impl From<Replay> for v1::Replay {
    fn from(replay: Replay) -> Self {
        Self {
            agents: replay.agents as u32,
            steps: replay.steps,
            poses: replay.poses.into_iter().flatten().collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn world(horizon: u32, agents: u32) -> World {
        let message = v1::World {
            horizon: Some(horizon),
            agents: Some(agents),
            ..World::default().into()
        };
        World::try_from(message).unwrap()
    }

    #[test]
    fn frames_are_of_the_start_of_every_stride_and_of_the_end() {
        let check = |horizon, first, stride, expected: &[u32]| {
            let world = world(horizon, 3);
            let frames = Frames::new(first, stride, &world).unwrap();
            let steps: Vec<_> = frames.steps(&world).collect();
            assert_eq!(steps, expected);
            assert_eq!(frames.poses(&world), 3 * steps.len() as u64);
        };
        check(10, 0, 4, &[0, 4, 8, 10]);
        check(8, 0, 4, &[0, 4, 8]);
        check(3, 0, u32::MAX, &[0, 3]);
        check(1200, 1195, 2, &[0, 1195, 1197, 1199, 1200]);
        check(1200, 1196, 2, &[0, 1196, 1198, 1200]);
        check(10, 50, 2, &[0, 10]);
    }

    #[test]
    fn what_cannot_be_sent_is_refused_with_the_numbers() {
        let crowd = world(1200, 10_000);
        let message = Frames::new(0, 1, &crowd).unwrap_err().to_string();
        assert_eq!(
            message,
            "stride = 1: must be larger: 1201 frames of 10000 agents are 12010000 poses, and a motion may have 4000000"
        );
        assert!(Frames::new(0, 4, &world(10_000_000, 24)).is_err());
        assert_eq!(
            Frames::new(0, 0, &crowd).unwrap_err().to_string(),
            "stride = 0: must be 1 or more"
        );
    }

    #[test]
    fn every_world_can_be_watched_and_its_end_looked_at() {
        for (horizon, agents) in [
            (1, 1),
            (1200, 24),
            (1200, 10_000),
            (10_000_000, 10_000),
            (10_000_000, 1),
        ] {
            let world = world(horizon, agents);
            let watched = Frames::to_watch(&world);
            assert!(watched.poses(&world) <= Frames::MAX_POSES, "{world:?}");
            let end = Frames::of_end(160, NonZeroU32::new(4).unwrap(), &world);
            assert_eq!(end.stride().get(), 4);
            assert!(end.poses(&world) <= Frames::MAX_POSES, "{world:?}");
        }
        let crowd = world(10_000_000, 10_000);
        let long = Frames::of_end(100_000, NonZeroU32::MIN, &crowd);
        assert!(long.poses(&crowd) <= Frames::MAX_POSES, "{long:?}");
        let paper = Frames::to_watch(&World::default());
        assert_eq!((paper.first(), paper.stride().get()), (0, 3));
    }

    #[tokio::test]
    async fn a_motion_in_parts_is_the_same_motion() {
        let (frames, agents) = (300, 1000);
        let poses = (0..frames * agents).map(|n| [n as f32, 0.0, 1.0]).collect();
        let motion = Replay::new((0..frames as u32).collect(), agents, poses).unwrap();
        let parts: Vec<_> = motion.clone().into_parts().map(Ok).collect();
        assert!(parts.len() > 2);
        let whole = murmuration_proto::parts::whole(tokio_stream::iter(parts))
            .await
            .unwrap();
        assert_eq!(Replay::try_from(whole).unwrap(), motion);
    }
}
