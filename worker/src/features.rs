//! The five hand-crafted features of Brown et al. (paper, Table 1), averaged over the last steps.

mod bounds;

pub use bounds::{FeatureBounds, check_positions};

use crate::simulate::{Agent, Swarm};
use murmuration_proto::{Features, World};

/// Steps that a feature is averaged over (fewer where the simulation is shorter).
pub const FEATURE_STEPS: u32 = 100;

/// Radial variance is multiplied by this in the authors' simulator, though not in the paper.
const RADIAL_VARIANCE_SCALE: f64 = 20.0;

/// The mean of the features over the steps observed.
#[derive(Debug, Clone)]
pub struct FeatureMeans {
    half_diagonal: f64,
    sums: Features,
    steps: u32,
}

impl FeatureMeans {
    /// No step observed yet, for swarms in `world`.
    #[must_use]
    pub fn new(world: &World) -> Self {
        Self {
            half_diagonal: world.half_diagonal(),
            sums: [0.0; 5],
            steps: 0,
        }
    }

    /// Adds the swarm as it is now, displacements taken as velocities.
    pub fn observe(&mut self, swarm: &Swarm) {
        let step = features(swarm.agents(), self.half_diagonal);
        for (sum, value) in self.sums.iter_mut().zip(step) {
            *sum += value;
        }
        self.steps += 1;
    }

    /// The means, in the order of [`murmuration_proto::FEATURE_NAMES`]; NaN before the first step.
    #[must_use]
    pub fn means(&self) -> Features {
        self.sums.map(|sum| sum / f64::from(self.steps))
    }
}

/// The features of one step.
fn features(agents: impl ExactSizeIterator<Item = Agent> + Clone, half_diagonal: f64) -> Features {
    let count = agents.len() as f64;
    let mut centroid = [0.0; 2];
    for agent in agents.clone() {
        centroid[0] += agent.position[0];
        centroid[1] += agent.position[1];
    }
    let centroid = centroid.map(|sum| sum / count);

    let (mut speed, mut momentum, mut rotation) = (0.0, 0.0, 0.0);
    let (mut distances, mut squares) = (0.0, 0.0);
    for agent in agents.clone() {
        let [x, y] = offset(&agent, centroid);
        let [vx, vy] = agent.displacement;
        let distance = (x * x + y * y).sqrt();
        let cross = vx * y - vy * x;
        speed += (vx * vx + vy * vy).sqrt();
        momentum += cross;
        // An agent in the very centre turns about nothing.
        rotation += if distance > 0.0 { cross / distance } else { 0.0 };
        distances += distance;
        squares += distance * distance;
    }
    let mean_distance = distances / count;
    let mut deviations = 0.0;
    for agent in agents {
        let [x, y] = offset(&agent, centroid);
        let deviation = (x * x + y * y).sqrt() - mean_distance;
        deviations += deviation * deviation;
    }
    let area = half_diagonal * half_diagonal * count;
    [
        speed / count,
        momentum / (half_diagonal * count),
        RADIAL_VARIANCE_SCALE * deviations / area,
        squares / area,
        rotation / count,
    ]
}

fn offset(agent: &Agent, from: [f64; 2]) -> [f64; 2] {
    [agent.position[0] - from[0], agent.position[1] - from[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(agents: &[([f64; 2], [f64; 2])], expected: Features) {
        let agents = agents.iter().map(|&(position, displacement)| Agent {
            position,
            displacement,
            heading: [1.0, 0.0],
            theta: 0.0,
            sensed: 0,
        });
        let computed = features(agents, 10.0);
        for (value, expected) in computed.into_iter().zip(expected) {
            assert!((value - expected).abs() < 1e-15, "{computed:?}");
        }
    }

    #[test]
    fn two_agents_that_circle_each_other() {
        let agents = [([4.0, 5.0], [0.0, -1.0]), ([8.0, 5.0], [0.0, 1.0])];
        check(&agents, [1.0, -0.2, 0.0, 0.04, -1.0]);
    }

    #[test]
    fn the_spread_of_the_distances_to_the_centre() {
        let still = [0.0; 2];
        let agents = [([0.0, 0.0], still), ([3.0, 0.0], still), ([6.0, 0.0], still)];
        check(&agents, [0.0, 0.0, 20.0 * 6.0 / 300.0, 18.0 / 300.0, 0.0]);
    }

    #[test]
    fn an_agent_alone_has_no_radius() {
        check(&[([3.0, 4.0], [3.0, 4.0])], [5.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
