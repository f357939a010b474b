//! Records what the judge looks at of motions, and lets it judge them.

use murmuration_judge as judge;
use murmuration_proto::{Invalid, Pose, Replay, Verdict, World};

/// The frames that the judge looks at, of swarms that are simulated together.
pub(super) struct Recorder {
    /// The steps with a frame, ascending from 0.
    steps: Vec<u32>,
    /// Frames so far, and the poses of all agents in them, by swarm.
    frames: usize,
    poses: Vec<Vec<Pose>>,
}

impl Recorder {
    /// For so many swarms in `world`.
    pub(super) fn new(world: &World, swarms: usize) -> Self {
        let steps: Vec<u32> = judge::frames(world).steps(world).collect();
        let poses = steps.len() * world.agents() as usize;
        Self {
            steps,
            frames: 0,
            poses: (0..swarms).map(|_| Vec::with_capacity(poses)).collect(),
        }
    }

    /// The next step with a frame.
    pub(super) fn next_step(&self) -> Option<u32> {
        self.steps.get(self.frames).copied()
    }

    /// Records the frame of `step`, if it has one: `position` says where each agent of each swarm is.
    #[inline(always)]
    pub(super) fn observe<Agents: Iterator<Item = [f64; 2]>>(
        &mut self,
        step: u32,
        positions: impl Fn(usize) -> Agents,
    ) {
        if self.next_step() != Some(step) {
            return;
        }
        self.frames += 1;
        for (swarm, poses) in self.poses.iter_mut().enumerate() {
            // The judge looks at no heading.
            poses.extend(positions(swarm).map(|[x, y]| [x as f32, y as f32, 0.0]));
        }
    }

    /// The judge's verdict on each swarm.
    ///
    /// # Errors
    /// If a position is not finite.
    pub(super) fn verdicts(self, world: &World) -> Result<Vec<Verdict>, Invalid> {
        let agents = world.agents() as usize;
        let verdict = |poses| {
            Ok(judge::judge(
                &Replay::new(self.steps.clone(), agents, poses)?,
                world,
            ))
        };
        self.poses.into_iter().map(verdict).collect()
    }
}

/// Steps from `step` on after which neither features, picture nor recorder, if there is one, observe anything, one of
/// which at least is before the next that does; `observed_after` is the last step before features and picture begin.
pub(super) fn quiet(step: u32, observed_after: u32, recorder: Option<&Recorder>) -> u32 {
    let recorded = recorder
        .and_then(Recorder::next_step)
        .map_or(u32::MAX, |next| next.saturating_sub(1));
    observed_after.min(recorded).saturating_sub(step)
}
