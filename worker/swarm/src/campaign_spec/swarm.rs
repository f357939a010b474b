//! The robots of a campaign, and their world.

use crate::{CapabilityModel, Drive, Invalid, World, robot, world};
use murmuration_proto::v1;
use std::f64::consts::PI;

/// The default name of a campaign.
pub(super) fn default_name(model: &CapabilityModel) -> &'static str {
    match (model.preset(), model.ratios()) {
        (Some(preset), _) => preset.name(),
        (None, []) => "robot",
        (None, _) => "swarm",
    }
}

/// The robots of a campaign and their world. The world gets the number of robots and the radius of the largest robot.
pub(super) fn swarm(message: &v1::CampaignSpec) -> Result<(CapabilityModel, World), Invalid> {
    let mut world_message = message.world.clone().unwrap_or_default();
    let angles = message
        .controllers
        .as_ref()
        .map_or(&[][..], |space| &space.angles);
    let model = capability_model(message, &world::defaults(&world_message), angles)?;
    world_message.radius = Some(model.largest_radius());
    if let Some(robots) = model.robots() {
        match world_message.agents {
            Some(agents) if agents != robots => {
                let allowed = format!("{robots}, the number of robots of all species, or absent");
                return Err(Invalid::new("world.agents", agents, allowed));
            }
            _ => world_message.agents = Some(robots),
        }
    }
    let world = World::try_from(world_message).map_err(|error| error.within("world"))?;
    check_step(&model, &world)?;
    Ok((model, world))
}

/// Checks that no robot drives farther in a step than the maximum side of a world.
fn check_step(model: &CapabilityModel, world: &World) -> Result<(), Invalid> {
    let drives = model.species().iter().map(|species| species.robot().drive());
    let fastest = drives.map(Drive::top_speed).fold(0.0, f64::max) * world.noise().largest_factor();
    if fastest * world.dt() <= World::MAX_SIDE {
        return Ok(());
    }
    let allowed = format!(
        "at most {:e}: robots drive up to {fastest:e} world units a unit of time, and may drive {} in a step",
        World::MAX_SIDE / fastest,
        World::MAX_SIDE
    );
    Err(Invalid::new("world.dt", world.dt(), allowed))
}

fn capability_model(
    message: &v1::CampaignSpec,
    default: &robot::Defaults,
    angles: &[f64],
) -> Result<CapabilityModel, Invalid> {
    let mut species = message.species.clone();
    for species in &mut species {
        species.robot = species.robot.take().map(|robot| with_range(robot, angles));
    }
    let written = robot::Written {
        model: message.model.clone(),
        robot: message.robot.clone().map(|robot| with_range(robot, angles)),
        ratios: message.ratios.clone(),
        species,
    };
    // An error that names only a radius is about the size that a preset takes from the world.
    written.read(default).map_err(|error| match error.field.as_str() {
        "radius" | "wheel_radius" => error.within("world"),
        _ => error,
    })
}

/// Returns the robot with the range of a whole turn for each free angle without a range or list, if the controller space has a
/// list of angles.
fn with_range(mut robot: v1::Robot, angles: &[f64]) -> v1::Robot {
    for sensor in &mut robot.sensors {
        let is_free = sensor.angle.is_some_and(|angle| angle.fixed.is_none());
        if is_free && !angles.is_empty() && sensor.angle_range.is_empty() && sensor.angles.is_empty() {
            sensor.angle_range = vec![-PI, PI];
        }
    }
    robot
}
