//! Records the frames that the judge needs, and has the judge name the motions.

use murmuration_judge as judge;
use murmuration_swarm::{Invalid, Pose, Replay, Verdict, World};

/// Frames of swarms that are simulated together, for the judge.
pub(super) struct Recorder {
    /// The steps with a frame, ascending from 0.
    steps: Vec<u32>,
    /// Number of frames so far, and the poses in these frames, by swarm.
    frames: usize,
    poses: Vec<Vec<Pose>>,
}

impl Recorder {
    /// A recorder for this number of swarms in `world`.
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

    /// Records a frame if the judge needs a frame of `step`. `positions` returns the positions of the agents of a swarm.
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
            // The judge ignores headings.
            poses.extend(positions(swarm).map(|[x, y]| [x as f32, y as f32, 0.0]));
        }
    }

    /// The judge's verdict on each swarm. `species` has the place of each robot's species; empty if all robots are of one species.
    ///
    /// # Errors
    /// Fails if a position is not finite.
    pub(super) fn verdicts(self, species: &[usize], world: &World) -> Result<Vec<Verdict>, Invalid> {
        let agents = world.agents() as usize;
        let verdict = |poses| {
            Ok(judge::judge_species(
                &Replay::new(self.steps.clone(), agents, poses)?,
                species,
                world,
            ))
        };
        self.poses.into_iter().map(verdict).collect()
    }
}

/// Number of steps after `step` that nothing observes. Features and picture observe all steps after `observed_after`; the
/// recorder observes the steps with a frame.
pub(super) fn quiet(step: u32, observed_after: u32, recorder: Option<&Recorder>) -> u32 {
    let recorded = recorder
        .and_then(Recorder::next_step)
        .map_or(u32::MAX, |next| next.saturating_sub(1));
    observed_after.min(recorded).saturating_sub(step)
}
