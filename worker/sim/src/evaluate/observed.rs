//! The evaluation of a swarm that was tracked, not simulated.

use super::Ending;
use crate::{
    rasterise::Rasteriser,
    simulate::{Start, Swarm},
};
use murmuration_proto::v1;
use murmuration_swarm::{Controller, Evaluation, ImageFormat, Invalid, World, counted};

/// Features and picture of a recorded motion. `frames` has the pose (x, y, heading; world units and radians) of each robot before
/// the first step and after every step, for at least one step. The number of frames, not `world`, determines the horizon.
///
/// For a simulated swarm, the result equals the swarm's evaluation, except for rounding in two cases. This function computes
/// headings from angles, but a simulation rotates headings. The difference can move the last pixel of a line. On a torus,
/// displacements differ by rounding.
///
/// Uses only the parts of the controller that the picture shows: the directions of sensors, and the number of robots of each
/// species.
///
/// # Errors
/// Fails if the swarm does not fit the world or the picture, or if the picture's channels are for another number of species.
/// Fails if a frame has a wrong number of poses, or if a pose is not finite or is over [`World::MAX_SIDE`] away from the world.
pub fn observe(
    controller: &Controller,
    world: &World,
    format: &ImageFormat,
    frames: &[Vec<[f64; 3]>],
) -> Result<Evaluation, Invalid> {
    let (Some(first), steps @ 1..) = (frames.first(), frames.len().saturating_sub(1)) else {
        let value = counted(frames.len() as u64, "frame");
        return Err(Invalid::new("frames", value, "two frames or more"));
    };
    format
        .check_species(controller.model())
        .map_err(|error| error.within("image"))?;
    let world = World::try_from(v1::World {
        horizon: Some(u32::try_from(steps).unwrap_or(u32::MAX)),
        ..world.clone().into()
    })?;
    frames.iter().try_for_each(|poses| check(poses, &world))?;
    let mut swarm = Swarm::new(controller, &world, &Start::at(first.clone())?)?;
    let mut rasteriser = Rasteriser::new(&world, format)?;
    let mut ending = Ending::new(&world, format, &mut rasteriser);
    for poses in &frames[1..] {
        swarm.place(poses);
        ending.observe(&swarm);
    }
    Evaluation::new(ending.features.means(), ending.rasteriser.image(), format)
}

fn check(poses: &[[f64; 3]], world: &World) -> Result<(), Invalid> {
    if poses.len() != world.agents() as usize {
        let allowed = format!("{}, one a robot", counted(world.agents().into(), "pose"));
        return Err(Invalid::new(
            "frames",
            counted(poses.len() as u64, "pose"),
            allowed,
        ));
    }
    for [x, y, heading] in poses {
        for (field, value, side) in [("x", x, world.width()), ("y", y, world.height())] {
            let [low, high] = [-World::MAX_SIDE, side + World::MAX_SIDE];
            if !(low..=high).contains(value) {
                let allowed = format!("a number from {low} to {high}, world units");
                return Err(Invalid::new(field, format!("{value:e}"), allowed));
            }
        }
        if !heading.is_finite() {
            return Err(Invalid::new("heading", heading, "a finite number"));
        }
    }
    Ok(())
}
