//! What the features of a swarm in a given world can be at most: results beyond that were not simulated.
//!
//! The bounds hold for every controller and start, and follow from what a step does to an agent (`simulate`):
//!
//! - It drives at most as far as its drive's top speed takes it in `dt`, times the largest factor of the noise, and is clamped to
//!   the walls, if there are any: a projection, which takes it no further from where it was than the drive did, and besides as far
//!   as it was outside the walls before.
//! - Then it is pushed out of others, in a few passes. All that a pass pushes it out of are within a diameter of where it
//!   was when the pass began, and each push leaves it a diameter and a gap from one of them, give or take the jitter. So no
//!   pass takes it further than two diameters and that; nor do all of them together, by the same argument, for each other
//!   agent there is. Where two agents nearly coincide, the direction of a push is a unit vector up to a factor of 1.42, for
//!   which there is room in [`push`].
//!
//! Between the two, obstacles push it:
//!
//! - Where there are walls, they leave it within the walls or where a way out ends, which is within the rectangle about the
//!   obstacles and a body around them; without walls, they leave it where it was or within that rectangle.
//! - On a torus they push it the shorter way around, so at most half a diagonal; and so do the others.
//!
//! So after its step every agent is within a push of the walls or that rectangle; without walls, within as many drives and pushes
//! of the world or that rectangle as there are steps; on a torus, in the world. Distances from the centroid have a mean square of
//! at most a quarter of the squared diagonal of where agents can be (Popoviciu), and all else follows from that and the speed. On a
//! torus they are distances of coordinates, and the centroid is a mean of coordinates: features know nothing of images.

use super::{FEATURE_STEPS, RADIAL_VARIANCE_SCALE};
use crate::simulate::{GAP, JITTER, PASSES};
use murmuration_proto::{Boundary, CapabilityModel, FEATURE_NAMES, Features, Invalid, Obstacle, World};
use std::f64::consts::SQRT_2;

/// Room for what is rounded: in proportion, and absolutely.
const ROUNDING: (f64, f64) = (1e-6, 1e-9);

/// The least and most that each feature of a swarm in one world can be.
#[derive(Debug, Clone, PartialEq)]
pub struct FeatureBounds {
    least: Features,
    most: Features,
}

impl FeatureBounds {
    /// Those of swarms of this model in `world`.
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
        // Only momentum and rotation have a direction.
        let least = [0.0, -most[1], 0.0, 0.0, -most[4]];
        Self { least, most }
    }

    /// Whether a swarm can have these.
    ///
    /// # Errors
    /// Names the first feature that none has.
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

/// Whether agents of a swarm of this model in `world` can be there, at its start or after any step.
///
/// # Errors
/// Names the first coordinate that none has.
pub fn check_positions(
    model: &CapabilityModel,
    world: &World,
    positions: impl IntoIterator<Item = [f64; 2]>,
) -> Result<(), Invalid> {
    let reached = hull(region(model, world), whole(world));
    for position in positions {
        for ((axis, value), [low, high]) in ["x", "y"].into_iter().zip(position).zip(reached) {
            // Poses may come in single precision.
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

/// Furthest that a step moves an agent.
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
            // A start may be anywhere in the world.
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

/// Where agents can be after any step.
fn region(model: &CapabilityModel, world: &World) -> Rectangle {
    let sides = [world.width(), world.height()];
    let (room, beyond) = match world.boundary() {
        Boundary::Torus => return sides.map(|side| [0.0, side]),
        Boundary::Walls => {
            // The smallest robots get nearest to the walls.
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

/// The world.
fn whole(world: &World) -> Rectangle {
    [[0.0, world.width()], [0.0, world.height()]]
}

/// The rectangle about all obstacles, a body and a gap around each.
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

/// The smallest rectangle that holds both.
fn hull(a: Rectangle, b: Rectangle) -> Rectangle {
    [0, 1].map(|axis| [a[axis][0].min(b[axis][0]), a[axis][1].max(b[axis][1])])
}

/// Length of a rectangle's diagonal.
fn size(rectangle: Rectangle) -> f64 {
    let [x, y] = rectangle.map(|[low, high]| high - low);
    x.hypot(y)
}

/// Furthest that an agent gets by itself in a whole simulation without walls.
fn roam(model: &CapabilityModel, world: &World) -> f64 {
    f64::from(world.horizon()) * (drive(model, world) + push(world))
}

/// Furthest that an agent drives in a step.
fn drive(model: &CapabilityModel, world: &World) -> f64 {
    model.top_speed() * world.noise().largest_factor() * world.dt()
}

/// Furthest that an agent is pushed out of others in a step.
fn push(world: &World) -> f64 {
    let once = 5.0 * world.radius() + 2.0 * (GAP + JITTER);
    let passes = (world.agents() as usize - 1).min(PASSES);
    passes as f64 * once
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        features::FeatureMeans,
        simulate::{Start, Swarm, tests::sized},
    };
    use murmuration_proto::{Controller, Preset, Robot, v1};
    use proptest::prelude::*;

    fn features(controller: &Controller, world: &World, seed: u64) -> Features {
        let mut swarm = Swarm::new(controller, world, &Start::seeded(seed)).unwrap();
        swarm.advance(world.horizon().saturating_sub(FEATURE_STEPS));
        let mut means = FeatureMeans::new(world);
        while swarm.steps() < world.horizon() {
            swarm.step();
            means.observe(&swarm);
        }
        means.means()
    }

    fn controllers() -> impl Strategy<Value = Controller> {
        // The fastest, and those that stand or turn, more often than chance has them.
        let speed = || prop_oneof![Just(1.0), Just(-1.0), Just(0.0), -1.0..=1.0];
        let single = prop::collection::vec(speed(), 4)
            .prop_map(|genes| Controller::new(Preset::SingleSensor, &genes).unwrap());
        let two = (prop::collection::vec(speed(), 8), -3.0..3.0).prop_map(|(mut genes, angle)| {
            genes.push(angle);
            Controller::new(Preset::TwoSensor, &genes).unwrap()
        });
        prop_oneof![single, two]
    }

    /// Ten to the power of what is in this range.
    fn decades(from: f64, to: f64) -> impl Strategy<Value = f64> {
        (from..to).prop_map(|power| 10_f64.powf(power))
    }

    fn noise() -> impl Strategy<Value = Option<v1::Noise>> {
        let part = || prop_oneof![Just(None), Just(Some(1.0)), (0.0..1.0).prop_map(Some)];
        let noise = (part(), part(), part(), part(), prop::option::of(0..200_u32));
        prop::option::of(
            noise.prop_map(|(slip, gain, missed, false_detection, delay)| v1::Noise {
                slip,
                gain,
                missed,
                false_detection,
                delay,
            }),
        )
    }

    /// Boundary, obstacles (in a world of side 1), the length of a line to start on, noise.
    fn surroundings() -> impl Strategy<Value = (Boundary, Vec<v1::Obstacle>, Option<f64>, Option<v1::Noise>)>
    {
        let boundary = prop_oneof![Just(Boundary::Walls), Just(Boundary::Open), Just(Boundary::Torus)];
        let part = || prop_oneof![0.01..0.1_f64, 0.1..0.7];
        let obstacle = (0.0..1.0_f64, 0.0..1.0_f64, part(), part(), any::<bool>());
        let obstacle = obstacle.prop_map(|(x, y, width, height, disc)| v1::Obstacle {
            x: Some(x),
            y: Some(y),
            radius: disc.then_some(width / 2.0),
            width: (!disc).then_some(width),
            height: (!disc).then_some(height),
        });
        let obstacles = prop_oneof![Just(Vec::new()), prop::collection::vec(obstacle, 1..6)];
        (boundary, obstacles, prop::option::of(0.0..1.0), noise())
    }

    fn stretched(obstacle: v1::Obstacle, width: f64, height: f64) -> v1::Obstacle {
        v1::Obstacle {
            x: obstacle.x.map(|x| x * width),
            y: obstacle.y.map(|y| y * height),
            radius: obstacle.radius.map(|radius| radius * width.min(height)),
            width: obstacle.width.map(|part| part * width),
            height: obstacle.height.map(|part| part * height),
        }
    }

    /// Everything that a specification may say, from specks of dust to a world that its robots fill.
    fn worlds() -> impl Strategy<Value = World> {
        let sides = (decades(0.0, 4.0), decades(0.0, 4.0));
        let bodies = (
            prop_oneof![0.001..0.1_f64, 0.1..0.999],
            prop_oneof![Just(0.0_f64), 0.0..0.999],
        );
        let motion = (
            decades(-3.0, 3.0),
            prop_oneof![Just(1.0), decades(-3.0, 3.0)],
            any::<bool>(),
        );
        let size = (
            prop_oneof![1..4_u32, 4..60_u32],
            prop_oneof![1..4_u32, 95..140_u32],
        );
        let parts = (sides, bodies, motion, size, surroundings());
        parts.prop_filter_map(
            "obstacles leave no room",
            |(
                (width, height),
                (filled, padded),
                (wheel_radius, dt, jitter),
                (agents, horizon),
                (boundary, obstacles, line, noise),
            )| {
                let half = f64::min(width, height) / 2.0;
                let radius = (half * filled).clamp(Robot::MIN_RADIUS, Robot::MAX_RADIUS);
                World::try_from(v1::World {
                    width: Some(width),
                    height: Some(height),
                    padding: Some((half - radius).max(0.0) * padded),
                    agents: Some(agents),
                    radius: Some(radius),
                    wheel_radius: Some(wheel_radius),
                    dt: Some(dt),
                    horizon: Some(horizon),
                    jitter: Some(jitter),
                    boundary: Some(boundary.name().to_owned()),
                    noise,
                    obstacles: obstacles
                        .into_iter()
                        .map(|obstacle| stretched(obstacle, width, height))
                        .collect(),
                    start: line.map(|part| v1::StartShape {
                        shape: Some("line".to_owned()),
                        length: Some(part * width),
                        ..v1::StartShape::default()
                    }),
                })
                .ok()
            },
        )
    }

    proptest! {
        #![proptest_config(crate::proptest_cases::at_most(400))]

        #[test]
        fn every_swarm_is_within_them(controller in controllers(), world in worlds(), seed: u64) {
            let controller = sized(&controller, &world);
            let features = features(&controller, &world, seed);
            let checked = FeatureBounds::of(controller.model(), &world).check(&features);
            prop_assert!(checked.is_ok(), "{checked:?} {features:?} {world:?}");
        }

        #[test]
        fn every_agent_is_where_agents_can_be(controller in controllers(), world in worlds(), seed: u64) {
            let controller = sized(&controller, &world);
            let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
            for _ in 0..=world.horizon() {
                // As motions are sent.
                let positions = swarm.agents().map(|agent| agent.position.map(|value| f64::from(value as f32)));
                let checked = check_positions(controller.model(), &world, positions);
                prop_assert!(checked.is_ok(), "{checked:?} {world:?}");
                swarm.step();
            }
        }
    }

    #[test]
    fn where_no_agent_can_be_is_named() {
        let model = Preset::SingleSensor.into();
        let check = |position| check_positions(&model, &World::default(), [[0.0, 0.0], position]);
        assert!(check([500.0, 500.0]).is_ok());
        for (position, axis) in [([3.4e38, 0.0], "x"), ([0.0, -1e4], "y"), ([f64::NAN, 0.0], "x")] {
            assert_eq!(check(position).unwrap_err().field, format!("replay.{axis}"));
        }
    }

    #[test]
    fn what_no_swarm_has_is_named() {
        let paper = FeatureBounds::of(&Preset::SingleSensor.into(), &World::default());
        for (place, name) in FEATURE_NAMES.iter().enumerate() {
            for value in [1e4, -1e4, f64::NAN, f64::INFINITY] {
                let mut features = [0.0; 5];
                features[place] = value;
                let refused = paper.check(&features).unwrap_err();
                assert_eq!(refused.field, format!("features.{name}"));
            }
        }
        assert!(paper.check(&[2.0, -0.5, 0.1, 0.9, -1.0]).is_ok());
        // Nothing has less than no speed, variance or scatter.
        for place in [0, 2, 3] {
            let mut features = [0.0; 5];
            features[place] = -1e-3;
            assert!(paper.check(&features).is_err(), "{place}");
        }
    }

    #[test]
    fn one_robot_alone_is_as_fast_as_its_wheels() {
        let alone = v1::World {
            agents: Some(1),
            ..World::default().into()
        };
        let bounds = FeatureBounds::of(&Preset::SingleSensor.into(), &World::try_from(alone).unwrap());
        assert!(bounds.check(&[2.0, 0.0, 0.0, 0.0, 0.0]).is_ok());
        assert!(bounds.check(&[2.1, 0.0, 0.0, 0.0, 0.0]).is_err());
        assert!(bounds.check(&[2.0, 0.1, 0.0, 0.0, 0.0]).is_err());
    }
}
