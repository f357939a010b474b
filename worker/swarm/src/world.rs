//! The arena and the agents in it.

mod noise;
mod obstacle;
mod start_shape;
#[cfg(test)]
mod tests;

pub use noise::Noise;
pub use obstacle::Obstacle;
pub use start_shape::StartShape;

use crate::{
    Boundary, CapabilityModel, Invalid, Preset, Robot, counted, invalid, record::record, robot::Defaults,
};
use murmuration_proto::v1;
use std::sync::Arc;

record! {
    /// The arena of a swarm, and the length of a simulation (paper, "Simulation and Data").
    ///
    /// Lengths are in world units; the defaults are the paper's.
    #[derive(Debug, Clone, PartialEq)]
    pub struct World {
        /// Width, 1 to 10,000.
        width: f64,
        /// Height, 1 to 10,000.
        height: f64,
        /// Distance of the walls from the edges, 0 or more.
        padding: f64,
        /// Number of agents, 1 to 10,000.
        agents: u32,
        /// Radius of the largest agent's body, 0.001 to 1,000.
        radius: f64,
        /// Wheel radius of agents whose robots give none, over 0.
        wheel_radius: f64,
        /// Duration of one step, over 0.
        dt: f64,
        /// Number of steps, 1 to 10,000,000.
        horizon: u32,
        /// Whether collisions add the seeded jitter of the paper's authors.
        jitter: bool,
        boundary: Boundary,
        noise: Noise,
    }
    by reference {
        /// Obstacles in the arena; at most [`Obstacle::MAX_COUNT`].
        obstacles: Arc<[Obstacle]> as [Obstacle],
        /// Starts of the agents.
        start: StartShape as StartShape,
    }
}

impl World {
    /// Longest side of a world, in units.
    pub const MAX_SIDE: f64 = 10_000.0;
    /// Maximum number of agents in a world.
    pub(crate) const MAX_AGENTS: u32 = CapabilityModel::MAX_ROBOTS;

    /// The paper's world, for robots of this model.
    ///
    /// # Errors
    /// If the robots do not fit into the world.
    pub fn for_model(model: &CapabilityModel) -> Result<Self, Invalid> {
        Self::try_from(v1::World {
            agents: model.robots(),
            radius: Some(model.largest_radius()),
            ..v1::World::default()
        })
    }

    /// The model of a swarm of this preset in this world. The paper's presets have the body and wheels of the world.
    ///
    /// # Errors
    /// If the radii of the world are not allowed for a robot.
    pub fn robots_of(&self, preset: Preset) -> Result<CapabilityModel, Invalid> {
        CapabilityModel::of_one(preset.sized(self.radius, self.wheel_radius)?)
    }

    /// Reads a line of [`CapabilityModel::to_line`]. Absent radii of bodies and wheels default to this world's.
    ///
    /// # Errors
    /// The error names `field` if the line is not a TOML table of robots, otherwise the field of the table that is not allowed.
    pub fn robots_of_line(&self, field: &str, line: &str) -> Result<CapabilityModel, Invalid> {
        CapabilityModel::of_line(field, line, &defaults(&self.clone().into()))
    }

    /// Half the world's diagonal: the R of the paper's Table 1.
    #[must_use]
    pub fn half_diagonal(&self) -> f64 {
        (self.width * self.width + self.height * self.height).sqrt() / 2.0
    }

    /// Displacement from one point of the world to another, world units; on a torus, the shorter way around on each axis.
    #[must_use]
    pub fn way(&self, from: [f64; 2], to: [f64; 2]) -> [f64; 2] {
        let sides = [self.width, self.height];
        [0, 1].map(|axis| {
            let way = to[axis] - from[axis];
            match self.boundary {
                Boundary::Torus => way - sides[axis] * (way / sides[axis]).round(),
                Boundary::Walls | Boundary::Open => way,
            }
        })
    }

    /// Distance of the largest agent's centre from an edge of the world when the agent touches a wall.
    #[must_use]
    pub fn margin(&self) -> f64 {
        self.radius + self.padding
    }
}

/// Defaults for robots in the message of a world.
pub(crate) fn defaults(message: &v1::World) -> Defaults {
    let default = World::default();
    Defaults {
        radius: message.radius.unwrap_or(default.radius),
        wheel_radius: message.wheel_radius.unwrap_or(default.wheel_radius),
        agents: message.agents.unwrap_or(default.agents),
    }
}

impl Default for World {
    fn default() -> Self {
        Self {
            width: 500.0,
            height: 500.0,
            padding: 15.0,
            agents: 24,
            radius: Preset::PAPER_RADIUS,
            wheel_radius: Preset::PAPER_WHEEL_RADIUS,
            dt: 1.0,
            horizon: 1200,
            jitter: false,
            boundary: Boundary::Walls,
            noise: Noise::default(),
            obstacles: Arc::default(),
            start: StartShape::default(),
        }
    }
}

impl TryFrom<v1::World> for World {
    type Error = Invalid;

    fn try_from(message: v1::World) -> Result<Self, Invalid> {
        let default = Self::default();
        let side = |field, value: Option<f64>, otherwise| {
            invalid::real(field, value.unwrap_or(otherwise), 1.0..=Self::MAX_SIDE)
        };
        let width = side("width", message.width, default.width)?;
        let height = side("height", message.height, default.height)?;
        let agents = invalid::whole(
            "agents",
            message.agents.unwrap_or(default.agents),
            1..=Self::MAX_AGENTS,
        )?;
        let start = StartShape::in_world(message.start.unwrap_or_default(), agents, [width, height]);
        let world = Self {
            width,
            height,
            padding: invalid::real(
                "padding",
                message.padding.unwrap_or(default.padding),
                0.0..=Self::MAX_SIDE,
            )?,
            agents,
            radius: invalid::real(
                "radius",
                message.radius.unwrap_or(default.radius),
                Robot::MIN_RADIUS..=Robot::MAX_RADIUS,
            )?,
            wheel_radius: invalid::positive(
                "wheel_radius",
                message.wheel_radius.unwrap_or(default.wheel_radius),
                1000.0,
            )?,
            dt: invalid::positive("dt", message.dt.unwrap_or(default.dt), 1000.0)?,
            horizon: invalid::whole(
                "horizon",
                message.horizon.unwrap_or(default.horizon),
                1..=10_000_000,
            )?,
            jitter: message.jitter.unwrap_or(default.jitter),
            boundary: match message.boundary {
                Some(name) => name.parse()?,
                None => default.boundary,
            },
            noise: Noise::try_from(message.noise.unwrap_or_default())
                .map_err(|error| error.within("noise"))?,
            obstacles: obstacle::obstacles(message.obstacles, [width, height])?.into(),
            start: start.map_err(|error| error.within("start"))?,
        };
        let needed = 2.0 * world.margin();
        if needed > width.min(height) {
            let allowed =
                format!("at least 2 (radius + padding) = {needed}, or no agent fits between the walls");
            let field = if width < height { "width" } else { "height" };
            return Err(Invalid::new(field, width.min(height), allowed));
        }
        let margin = match world.boundary {
            Boundary::Walls => world.margin(),
            Boundary::Open | Boundary::Torus => 0.0,
        };
        if !obstacle::leave_room(&world.obstacles, [width, height], world.radius, margin) {
            let allowed = "such that a robot fits somewhere between them";
            let count = counted(world.obstacles.len() as u64, "obstacle");
            return Err(Invalid::new("obstacles", count, allowed));
        }
        Ok(world)
    }
}

impl From<World> for v1::World {
    fn from(world: World) -> Self {
        Self {
            width: Some(world.width),
            height: Some(world.height),
            padding: Some(world.padding),
            agents: Some(world.agents),
            radius: Some(world.radius),
            wheel_radius: Some(world.wheel_radius),
            dt: Some(world.dt),
            horizon: Some(world.horizon),
            jitter: Some(world.jitter),
            boundary: Some(world.boundary.name().to_owned()),
            noise: (!world.noise.is_off()).then(|| world.noise.into()),
            obstacles: world.obstacles.iter().map(Into::into).collect(),
            start: (world.start != StartShape::Uniform).then(|| (&world.start).into()),
        }
    }
}
