//! Initial poses of a swarm.

use super::drive::direction;
use murmuration_swarm::{Invalid, Purpose, RandomStream, StartShape, World, counted};
use rand::RngExt as _;
use std::{borrow::Cow, f64::consts::TAU};

/// The poses of a swarm before its first step.
#[derive(Debug, Clone, PartialEq)]
pub struct Start(Kind);

#[derive(Debug, Clone, PartialEq)]
enum Kind {
    Seed(u64),
    Poses(Vec<[f64; 3]>),
}

impl Start {
    /// A random start of the world's shape. By default, each agent draws x from \[0, width), y from \[0, height) and its heading
    /// from \[0, 2 pi), uniformly and in this order (paper, "Simulation and Data").
    #[must_use]
    pub const fn seeded(seed: u64) -> Self {
        Self(Kind::Seed(seed))
    }

    /// A given start, regardless of the world's shape: (x, y, theta) for each agent, in world units and radians. Jitter and noise
    /// have the seed 0.
    ///
    /// # Errors
    /// The error names the first number that is not finite.
    pub fn at(poses: Vec<[f64; 3]>) -> Result<Self, Invalid> {
        for (i, pose) in poses.iter().enumerate() {
            if let Some(value) = pose.iter().find(|value| !value.is_finite()) {
                return Err(Invalid::new(
                    format!("initial[{i}]"),
                    value,
                    "three finite numbers",
                ));
            }
        }
        Ok(Self(Kind::Poses(poses)))
    }

    /// Seed of jitter and noise.
    pub(super) const fn seed(&self) -> u64 {
        match &self.0 {
            Kind::Seed(seed) => *seed,
            Kind::Poses(_) => 0,
        }
    }

    /// The pose (x, y, heading in radians) of each agent of `world`.
    ///
    /// # Errors
    /// Fails if the start has given poses for another number of agents.
    pub fn poses_for(&self, world: &World) -> Result<Cow<'_, [[f64; 3]]>, Invalid> {
        let agents = world.agents() as usize;
        match &self.0 {
            Kind::Seed(seed) => Ok(Cow::Owned(drawn(*seed, world))),
            Kind::Poses(poses) if poses.len() == agents => Ok(Cow::Borrowed(poses)),
            Kind::Poses(poses) => {
                let allowed = format!("{}, one an agent", counted(agents as u64, "pose"));
                Err(Invalid::new(
                    "initial",
                    counted(poses.len() as u64, "pose"),
                    allowed,
                ))
            }
        }
    }
}

/// Random poses from `seed`, drawn in order of agents.
fn drawn(seed: u64, world: &World) -> Vec<[f64; 3]> {
    let mut stream = RandomStream::derive(seed, Purpose::Start, 0);
    let [width, height] = [world.width(), world.height()];
    let centre = [width / 2.0, height / 2.0];
    let agents = 0..world.agents();
    match world.start() {
        StartShape::Uniform => {
            let mut pose = || [width, height, TAU].map(|end| stream.between(0.0, end));
            agents.map(|_| pose()).collect()
        }
        StartShape::Disc { radius } => {
            let mut pose = || {
                // The square root makes positions uniform over the disc's area.
                let from_centre = radius * stream.random::<f64>().sqrt();
                let [x, y] = direction(stream.between(0.0, TAU));
                let heading = stream.between(0.0, TAU);
                [centre[0] + from_centre * x, centre[1] + from_centre * y, heading]
            };
            agents.map(|_| pose()).collect()
        }
        StartShape::Line { length } => {
            let gaps = f64::from(world.agents() - 1);
            let mut pose = |i: u32| {
                let part = if gaps > 0.0 { f64::from(i) / gaps } else { 0.5 };
                let x = centre[0] + length * (part - 0.5);
                [x, centre[1], stream.between(0.0, TAU)]
            };
            agents.map(&mut pose).collect()
        }
        StartShape::Poses(poses) => poses.to_vec(),
    }
}
