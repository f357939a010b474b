//! Tests that no swarm exceeds the bounds of features.

use crate::simulate::sized;
use murmuration_proto::v1;
use murmuration_sim::{
    features::{FEATURE_STEPS, FeatureBounds, FeatureMeans, check_positions},
    simulate::{Start, Swarm},
};
use murmuration_swarm::{Boundary, Controller, FEATURE_NAMES, Features, Preset, Robot, World};
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
    // Oversample the fastest controllers, and controllers that stand or turn.
    let speed = || prop_oneof![Just(1.0), Just(-1.0), Just(0.0), -1.0..=1.0];
    let single = prop::collection::vec(speed(), 4)
        .prop_map(|genes| Controller::new(Preset::SingleSensor, &genes).unwrap());
    let two = (prop::collection::vec(speed(), 8), -3.0..3.0).prop_map(|(mut genes, angle)| {
        genes.push(angle);
        Controller::new(Preset::TwoSensor, &genes).unwrap()
    });
    prop_oneof![single, two]
}

/// Ten to the power of a number in this range.
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
fn surroundings() -> impl Strategy<Value = (Boundary, Vec<v1::Obstacle>, Option<f64>, Option<v1::Noise>)> {
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

/// All valid worlds, from tiny robots to robots that fill the world.
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
            // Round to single precision, in which motions are sent.
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
    // Speed, variance and scatter cannot be negative.
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
