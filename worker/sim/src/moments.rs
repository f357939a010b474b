//! A swarm at each moment of its motion: the features and the judge's verdict that an evaluation would find if it ended there.

use crate::{features::RecentFeatures, simulate::Swarm};
use murmuration_judge as judge;
use murmuration_swarm::{Controller, Features, Pose, Replay, Verdict, World};
use std::collections::VecDeque;

pub use murmuration_judge::FEWEST_ROBOTS;

/// The recent past of a swarm, which is observed at its start and after every step.
#[derive(Debug, Clone)]
pub struct Moments {
    world: World,
    /// The place of each robot's species.
    species: Vec<usize>,
    features: RecentFeatures,
    /// The positions at the judge's frames, oldest first: as many frames as its window has.
    frames: VecDeque<Vec<Pose>>,
}

impl Moments {
    /// The moments of a swarm of `controller` in `world` that has not been observed yet.
    #[must_use]
    pub fn new(controller: &Controller, world: &World) -> Self {
        Self {
            world: world.clone(),
            species: controller.species_of_robots(world.agents()),
            features: RecentFeatures::new(world),
            frames: VecDeque::new(),
        }
    }

    /// Observes the swarm at its start or after a step. Takes less time than a step.
    pub fn observe(&mut self, swarm: &Swarm) {
        if swarm.steps() > 0 {
            self.features.observe(swarm);
        }
        if !swarm.steps().is_multiple_of(judge::STRIDE.get()) {
            return;
        }
        // The oldest frame leaves, and its memory is used again.
        let full = self.frames.len() == judge::WINDOW_FRAMES;
        let mut frame = full
            .then(|| self.frames.pop_front())
            .flatten()
            .unwrap_or_default();
        frame.clear();
        // The judge ignores headings.
        let poses = swarm.agents().map(|agent| agent.position);
        frame.extend(poses.map(|[x, y]| [x as f32, y as f32, 0.0]));
        self.frames.push_back(frame);
    }

    /// The mean features of the last 100 steps, or of all steps if there are fewer; NaN before the first step.
    #[must_use]
    pub fn features(&self) -> Features {
        self.features.means()
    }

    /// The judge's verdict on the last 160 steps, up to the last step that is a multiple of the judge's stride. `None` if the
    /// motion is shorter, or the swarm has fewer than [`FEWEST_ROBOTS`] robots.
    ///
    /// Judging takes longer than observing: see [`judge::judge_species`].
    #[must_use]
    pub fn verdict(&self) -> Option<Verdict> {
        if self.frames.len() < judge::WINDOW_FRAMES || self.world.agents() < FEWEST_ROBOTS {
            return None;
        }
        let stride = judge::STRIDE.get();
        let steps = (0..self.frames.len() as u32)
            .map(|frame| frame * stride)
            .collect();
        let poses = self.frames.iter().flatten().copied().collect();
        // A motion with a position that is not finite has no verdict.
        let replay = Replay::new(steps, self.world.agents() as usize, poses).ok()?;
        Some(judge::judge_species(&replay, &self.species, &self.world))
    }
}
