//! Bounds of the features of a swarm in a given world. A result outside the bounds does not come from a simulation.
//!
//! The bounds hold for every controller and start, and follow from what a step does to an agent (`simulate`):
//!
//! - The agent drives at most the top speed of its drive, times `dt`, times the largest factor of the noise. If the world has
//!   walls, the agent is clamped to the walls. Clamping is a projection: it moves the agent no further than the drive did, plus
//!   the agent's distance outside the walls before the step.
//! - After its drive, the agent is pushed out of other agents, in a few passes. A pass pushes the agent out of agents within a
//!   diameter of its position at the beginning of the pass. Each push leaves the agent a diameter and a gap from one of these
//!   agents, plus or minus the jitter. So a pass moves the agent at most two diameters plus gap and jitter. By the same argument,
//!   all passes together move the agent at most this distance for each other agent. If two agents nearly coincide, the direction
//!   of a push has a length of up to 1.42 instead of 1; [`push`] allows for this length.
//!
//! Between drive and collisions, obstacles push the agent:
//!
//! - With walls, the agent ends within the walls or at the end of a way out of the obstacles. A way out ends within the rectangle
//!   about the obstacles and a body around each obstacle. Without walls, the agent ends where it was or within the rectangle
//!   about the obstacles.
//! - On a torus, obstacles and other agents push the agent the shorter way around, so at most half a diagonal.
//!
//! So after a step, an agent is at most a push outside of the walls or of the rectangle about the obstacles. Without walls, an
//! agent is at most a drive and a push per step away from the world or from that rectangle. On a torus, an agent is in the world.
//! The mean square of the distances from the centroid is at most a quarter of the squared diagonal of the region that agents can
//! reach (Popoviciu). The other bounds follow from this bound and the speed. On a torus, features use plain coordinates, not
//! nearest images, for distances and centroid.

use super::{FEATURE_STEPS, RADIAL_VARIANCE_SCALE};
use crate::simulate::{GAP, JITTER, PASSES};
use murmuration_proto::v1;
use murmuration_swarm::{
    Boundary, CapabilityModel, CompressedImage, Evaluation, Extras, FEATURE_NAMES, Features, ImageFormat,
    Invalid, Obstacle, World,
};
use std::f64::consts::SQRT_2;

/// Room for rounding errors: relative, and absolute.
const ROUNDING: (f64, f64) = (1e-6, 1e-9);

/// Minimum and maximum of each feature of a swarm in one world.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureBounds {
    least: Features,
    most: Features,
}

impl FeatureBounds {
    /// Bounds for swarms of this model in `world`.
    #[must_use]
    pub fn of(model: &CapabilityModel, world: &World) -> Self {
        let speed = speed(model, world);
        let diagonal = size(region(model, world));
        let spread = if world.agents() > 1 { diagonal / 2.0 } else { 0.0 };
        let spread = spread / world.half_diagonal();
        let most = [
            speed,
            speed * spread,
            RADIAL_VARIANCE_SCALE * spread * spread,
            spread * spread,
            speed,
        ];
        let most = most.map(|most| most * (1.0 + ROUNDING.0) + ROUNDING.1);
        // Only momentum and rotation can be negative.
        let least = [0.0, -most[1], 0.0, 0.0, -most[4]];
        Self { least, most }
    }

    /// Validates a worker's evaluations, which must have pictures in `format` and the given `extras`.
    ///
    /// # Errors
    /// As [`Evaluation::received`] and [`FeatureBounds::check`].
    pub fn received(
        &self,
        message: &v1::Evaluations,
        trials: usize,
        format: &ImageFormat,
        extras: Extras,
    ) -> Result<Vec<Evaluation<CompressedImage>>, Invalid> {
        let evaluations = Evaluation::received(message, trials, format, extras)?;
        for (place, evaluation) in evaluations.iter().enumerate() {
            let checked = self.check(evaluation.features());
            checked.map_err(|error| error.within(&format!("evaluations[{place}]")))?;
        }
        Ok(evaluations)
    }

    /// Checks that a swarm can have these features.
    ///
    /// # Errors
    /// The error names the first feature that is out of bounds.
    pub fn check(&self, features: &Features) -> Result<(), Invalid> {
        let allowed = self.least.iter().zip(self.most);
        for ((name, &value), (&least, most)) in FEATURE_NAMES.iter().zip(features).zip(allowed) {
            if !(least..=most).contains(&value) {
                let allowed = format!("from {least:.3} to {most:.3}, which swarms in this world can have");
                return Err(Invalid::new(
                    format!("features.{name}"),
                    format!("{value:e}"),
                    allowed,
                ));
            }
        }
        Ok(())
    }
}

/// Checks that agents of a swarm of this model in `world` can reach these positions, at the start or after any step.
///
/// # Errors
/// The error names the first coordinate that is out of bounds.
pub fn check_positions(
    model: &CapabilityModel,
    world: &World,
    positions: impl IntoIterator<Item = [f64; 2]>,
) -> Result<(), Invalid> {
    let reached = hull(region(model, world), whole(world));
    for position in positions {
        for ((axis, value), [low, high]) in ["x", "y"].into_iter().zip(position).zip(reached) {
            // Poses can have single precision.
            let room = (high - low) * ROUNDING.0 + ROUNDING.1;
            let (low, high) = (low - room, high + room);
            if !(low..=high).contains(&value) {
                let allowed = format!("from {low:.3} to {high:.3}, which agents of this world reach");
                return Err(Invalid::new(
                    format!("replay.{axis}"),
                    format!("{value:e}"),
                    allowed,
                ));
            }
        }
    }
    Ok(())
}

/// Maximum distance that a step moves an agent.
fn speed(model: &CapabilityModel, world: &World) -> f64 {
    let (push, drive) = (push(world), drive(model, world));
    let region = region(model, world);
    match world.boundary() {
        Boundary::Torus => {
            let around = world.half_diagonal();
            let obstacles = if world.obstacles().is_empty() { 0.0 } else { around };
            drive + obstacles + push.min(around)
        }
        Boundary::Open => (drive + push + around_obstacles(world).map_or(0.0, size)).min(size(region)),
        Boundary::Walls => {
            // An agent can start anywhere in the world.
            let (outside, crossed) = match world.horizon() <= FEATURE_STEPS {
                true => (
                    push.max(SQRT_2 * world.margin()),
                    size(hull(region, whole(world))),
                ),
                false => (push, size(region)),
            };
            match world.obstacles() {
                [] => (drive + outside + push).min(crossed),
                _ => crossed,
            }
        }
    }
}

/// A rectangle: lowest and highest coordinate by axis.
type Rectangle = [[f64; 2]; 2];

/// Region that contains all agents after any step.
fn region(model: &CapabilityModel, world: &World) -> Rectangle {
    let sides = [world.width(), world.height()];
    let (room, beyond) = match world.boundary() {
        Boundary::Torus => return sides.map(|side| [0.0, side]),
        Boundary::Walls => {
            // The smallest robots can get nearest to the walls.
            let radii = model.species().iter().map(|species| species.robot().radius());
            let margin = world.padding() + radii.fold(world.radius(), f64::min);
            (
                sides.map(|side| [margin, (side - margin).max(margin)]),
                push(world),
            )
        }
        Boundary::Open => (sides.map(|side| [0.0, side]), roam(model, world)),
    };
    let room = around_obstacles(world).map_or(room, |obstacles| hull(room, obstacles));
    room.map(|[low, high]| [low - beyond, high + beyond])
}

/// The whole world as a rectangle.
fn whole(world: &World) -> Rectangle {
    [[0.0, world.width()], [0.0, world.height()]]
}

/// The rectangle about all obstacles, with a body and a gap around each obstacle.
fn around_obstacles(world: &World) -> Option<Rectangle> {
    let around = |obstacle: &Obstacle| {
        let (centre, half) = (obstacle.centre(), obstacle.half_size());
        [0, 1].map(|axis| {
            let reach = half[axis] + world.radius() + GAP;
            [centre[axis] - reach, centre[axis] + reach]
        })
    };
    world.obstacles().iter().map(around).reduce(hull)
}

/// The smallest rectangle that contains both `a` and `b`.
fn hull(a: Rectangle, b: Rectangle) -> Rectangle {
    [0, 1].map(|axis| [a[axis][0].min(b[axis][0]), a[axis][1].max(b[axis][1])])
}

/// Length of a rectangle's diagonal.
fn size(rectangle: Rectangle) -> f64 {
    let [x, y] = rectangle.map(|[low, high]| high - low);
    x.hypot(y)
}

/// Maximum distance of an agent from its start in a simulation without walls or obstacles.
fn roam(model: &CapabilityModel, world: &World) -> f64 {
    f64::from(world.horizon()) * (drive(model, world) + push(world))
}

/// Maximum distance that an agent drives in a step.
fn drive(model: &CapabilityModel, world: &World) -> f64 {
    model.top_speed() * world.noise().largest_factor() * world.dt()
}

/// Maximum distance that collisions push an agent in a step.
fn push(world: &World) -> f64 {
    let once = 5.0 * world.radius() + 2.0 * (GAP + JITTER);
    let passes = (world.agents() as usize - 1).min(PASSES);
    passes as f64 * once
}
