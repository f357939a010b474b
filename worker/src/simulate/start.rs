//! Where a swarm starts.

use murmuration_proto::{Invalid, Purpose, RandomStream, World, counted};
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
    /// A random start: for each agent x in \[0, width), y in \[0, height) and heading in \[0, 2 pi), uniform, in
    /// that order (paper, "Simulation and Data").
    #[must_use]
    pub const fn seeded(seed: u64) -> Self {
        Self(Kind::Seed(seed))
    }

    /// A given start: (x, y, theta) for each agent, world units and radians. Its jitter has the seed 0.
    ///
    /// # Errors
    /// Names the first number that is not finite.
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

    /// Seed of what else is random in the simulation.
    pub(super) const fn seed(&self) -> u64 {
        match &self.0 {
            Kind::Seed(seed) => *seed,
            Kind::Poses(_) => 0,
        }
    }

    /// One pose for each agent of `world`.
    pub(super) fn poses_for(&self, world: &World) -> Result<Cow<'_, [[f64; 3]]>, Invalid> {
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

fn drawn(seed: u64, world: &World) -> Vec<[f64; 3]> {
    let mut stream = RandomStream::derive(seed, Purpose::Start, 0);
    let mut pose = || [world.width(), world.height(), TAU].map(|end| stream.between(0.0, end));
    (0..world.agents()).map(|_| pose()).collect()
}
