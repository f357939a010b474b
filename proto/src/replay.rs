//! The motion of a swarm, to be watched.

use crate::{Invalid, v1};

/// Where an agent is: x, y (world units, y points down the screen) and heading (radians).
pub type Pose = [f32; 3];

/// The motion of one swarm: its poses at ascending steps, the start (step 0) first.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    steps: Vec<u32>,
    agents: usize,
    poses: Vec<Pose>,
}

impl Replay {
    /// A replay of `agents` agents with one block of `agents` poses for each of `steps`.
    ///
    /// # Errors
    /// Names what is missing: no frame, no agent, steps out of order, poses too few, too many or not finite.
    pub fn new(steps: Vec<u32>, agents: usize, poses: Vec<Pose>) -> Result<Self, Invalid> {
        if steps.first() != Some(&0) || !steps.is_sorted_by(|a, b| a < b) {
            return Err(Invalid::new(
                "steps",
                format!("{} values", steps.len()),
                "ascending from 0",
            ));
        }
        if agents == 0 || poses.len() != steps.len() * agents {
            let allowed = format!("one a frame and agent ({} x {agents}), at least one", steps.len());
            return Err(Invalid::new("poses", format!("{} poses", poses.len()), allowed));
        }
        if !poses.iter().flatten().all(|value| value.is_finite()) {
            return Err(Invalid::new("poses", "not finite", "finite numbers"));
        }
        Ok(Self { steps, agents, poses })
    }

    /// Steps done at each frame, ascending from 0.
    #[must_use]
    pub fn steps(&self) -> &[u32] {
        &self.steps
    }

    /// Number of agents, at least 1.
    #[must_use]
    pub const fn agents(&self) -> usize {
        self.agents
    }

    /// The frames, each one pose an agent, in index order.
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
                format!("{} values", message.poses.len()),
                "three a pose",
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
