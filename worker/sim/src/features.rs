//! The five hand-crafted features of Brown et al. (paper, Table 1), averaged over the last steps.
//!
//! On a torus, there is no unique centroid. The same formulas use the plain coordinates, so a swarm across an edge counts as
//! spread out. Speeds do not include jumps across an edge.

mod bounds;

pub use bounds::{FeatureBounds, check_positions};

use crate::{
    lanes::{Planar, dot, lanes, minus, plus, splat},
    simulate::{Agents, Swarm},
};
use murmuration_swarm::{Features, World};
use pulp::{Scalar, Simd};
use std::collections::VecDeque;

/// Number of steps that a feature is averaged over (fewer if the simulation is shorter).
pub const FEATURE_STEPS: u32 = 100;

/// Factor of the radial variance in the authors' simulator. The paper does not have this factor.
const RADIAL_VARIANCE_SCALE: f64 = 20.0;

/// Mean of the features over the observed steps.
#[derive(Debug, Clone)]
pub struct FeatureMeans(LaneMeans<Scalar>);

impl FeatureMeans {
    /// Means for swarms in `world`, before the first observed step.
    #[must_use]
    pub fn new(world: &World) -> Self {
        Self(LaneMeans::new(Scalar::new(), world))
    }

    /// Adds the current state of the swarm, with displacements as velocities.
    pub fn observe(&mut self, swarm: &Swarm) {
        self.0.observe(Scalar::new(), agents(swarm));
    }

    /// The mean features, in the order of [`murmuration_swarm::FEATURE_NAMES`]; NaN before the first observed step.
    #[must_use]
    pub fn means(&self) -> Features {
        self.0.means(0)
    }
}

/// Means over the last [`FEATURE_STEPS`] observed steps, with the bits of [`FeatureMeans`] of these steps.
#[derive(Debug, Clone)]
pub(crate) struct RecentFeatures {
    half_diagonal: f64,
    /// The features of each step, oldest first.
    steps: VecDeque<Features>,
}

impl RecentFeatures {
    pub(crate) fn new(world: &World) -> Self {
        Self {
            half_diagonal: world.half_diagonal(),
            steps: VecDeque::with_capacity(FEATURE_STEPS as usize),
        }
    }

    /// Adds the current state of the swarm, and forgets the oldest step if there are too many.
    pub(crate) fn observe(&mut self, swarm: &Swarm) {
        if self.steps.len() == FEATURE_STEPS as usize {
            self.steps.pop_front();
        }
        let simd = Scalar::new();
        self.steps
            .push_back(features(simd, agents(swarm), self.half_diagonal));
    }

    /// The mean features; NaN before the first observed step.
    pub(crate) fn means(&self) -> Features {
        let mut sums = [0.0; 5];
        for step in &self.steps {
            for (sum, value) in sums.iter_mut().zip(step) {
                *sum += value;
            }
        }
        sums.map(|sum| sum / self.steps.len() as f64)
    }
}

/// The agents of one swarm.
fn agents(swarm: &Swarm) -> impl ExactSizeIterator<Item = Agents<Scalar>> + Clone {
    swarm.agents().map(|agent| Agents {
        position: agent.position,
        heading: agent.heading,
        displacement: agent.displacement,
    })
}

/// Like [`FeatureMeans`], for several swarms at once.
#[derive(Debug, Clone)]
pub(crate) struct LaneMeans<S: Simd> {
    half_diagonal: f64,
    sums: [S::f64s; 5],
    steps: u32,
}

impl<S: Simd> LaneMeans<S> {
    pub(crate) fn new(simd: S, world: &World) -> Self {
        Self {
            half_diagonal: world.half_diagonal(),
            sums: [simd.splat_f64s(0.0); 5],
            steps: 0,
        }
    }

    /// Adds the current states of the swarms.
    #[inline(always)]
    pub(crate) fn observe(&mut self, simd: S, agents: impl ExactSizeIterator<Item = Agents<S>> + Clone) {
        let step = features(simd, agents, self.half_diagonal);
        for (sum, value) in self.sums.iter_mut().zip(step) {
            *sum = simd.add_f64s(*sum, value);
        }
        self.steps += 1;
    }

    /// The mean features of the swarm in one lane.
    pub(crate) fn means(&self, lane: usize) -> Features {
        self.sums
            .map(|sum| lanes::<S>(&sum)[lane] / f64::from(self.steps))
    }
}

/// The features of one step.
#[inline(always)]
fn features<S: Simd>(
    simd: S,
    agents: impl ExactSizeIterator<Item = Agents<S>> + Clone,
    half_diagonal: f64,
) -> [S::f64s; 5] {
    let zero = simd.splat_f64s(0.0);
    let count = agents.len() as f64;
    let counts = simd.splat_f64s(count);
    let mut centroid = splat(simd, [0.0; 2]);
    for agent in agents.clone() {
        centroid = plus(simd, centroid, agent.position);
    }
    let centroid = [
        simd.div_f64s(centroid[0], counts),
        simd.div_f64s(centroid[1], counts),
    ];

    let (mut speed, mut momentum, mut rotation) = (zero, zero, zero);
    let (mut distances, mut squares) = (zero, zero);
    for agent in agents.clone() {
        let offset = minus(simd, agent.position, centroid);
        let velocity = agent.displacement;
        let distance = simd.sqrt_f64s(dot(simd, offset, offset));
        let cross = cross(simd, velocity, offset);
        speed = simd.add_f64s(speed, simd.sqrt_f64s(dot(simd, velocity, velocity)));
        momentum = simd.add_f64s(momentum, cross);
        // An agent exactly at the centroid has no rotation about it.
        let apart = simd.greater_than_f64s(distance, zero);
        let turning = simd.select_f64s(apart, simd.div_f64s(cross, distance), zero);
        rotation = simd.add_f64s(rotation, turning);
        distances = simd.add_f64s(distances, distance);
        squares = simd.add_f64s(squares, simd.mul_f64s(distance, distance));
    }
    let mean_distance = simd.div_f64s(distances, counts);
    let mut deviations = zero;
    for agent in agents {
        let offset = minus(simd, agent.position, centroid);
        let deviation = simd.sub_f64s(simd.sqrt_f64s(dot(simd, offset, offset)), mean_distance);
        deviations = simd.add_f64s(deviations, simd.mul_f64s(deviation, deviation));
    }
    let area = simd.splat_f64s(half_diagonal * half_diagonal * count);
    let scale = simd.splat_f64s(RADIAL_VARIANCE_SCALE);
    [
        simd.div_f64s(speed, counts),
        simd.div_f64s(momentum, simd.splat_f64s(half_diagonal * count)),
        simd.div_f64s(simd.mul_f64s(scale, deviations), area),
        simd.div_f64s(squares, area),
        simd.div_f64s(rotation, counts),
    ]
}

#[inline(always)]
fn cross<S: Simd>(simd: S, a: Planar<S>, b: Planar<S>) -> S::f64s {
    simd.sub_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn check(agents: &[([f64; 2], [f64; 2])], expected: Features) {
        let agents = agents.iter().map(|&(position, displacement)| Agents {
            position,
            displacement,
            heading: [1.0, 0.0],
        });
        let computed = features(Scalar::new(), agents, 10.0);
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
