//! Tests the effects of noise, and that the bits of noise depend on the seed alone.

use super::*;
use murmuration_sim::evaluate::Evaluator;
use murmuration_swarm::{CapabilityModel, Drive, ImageFormat, Noise, Robot, Seen, Sensor, SensorDescription};

fn noisy(world: &World, noise: v1::Noise) -> World {
    let message = v1::World {
        noise: Some(noise),
        ..world.clone().into()
    };
    World::try_from(message).unwrap()
}

/// Random noise of some kinds.
fn noises() -> impl Strategy<Value = v1::Noise> {
    let part = || prop::option::of(0.0..0.3);
    let parts = (part(), part(), part(), part(), prop::option::of(0..9_u32));
    parts.prop_map(|(slip, gain, missed, false_detection, delay)| v1::Noise {
        slip,
        gain,
        missed,
        false_detection,
        delay,
    })
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(48))]

    #[test]
    fn the_bits_of_noise_depend_neither_on_the_cpu_nor_on_a_grid_nor_on_the_grouping_of_steps(
        controller in controllers(),
        world in worlds(1..=40u32),
        noise in noises(),
        seed: u64,
    ) {
        let world = noisy(&world, noise);
        let controller = sized(&controller, &world);
        let start = Start::seeded(seed);
        let run = |arch, grid, group: usize| {
            let mut swarm = Swarm::pairwise(arch, &controller, &world, &start).unwrap();
            if grid {
                swarm = swarm.with_grid(&world);
            }
            for _ in (0..60).step_by(group) {
                swarm.advance(group as u32);
            }
            bits(&swarm)
        };
        let scalar = run(Arch::Scalar, false, 60);
        for arch in arches() {
            prop_assert_eq!(&run(arch, false, 10), &scalar, "{:?}", arch);
        }
        prop_assert_eq!(&run(Arch::new(), true, 1), &scalar);
    }

    #[test]
    fn swarms_in_any_world_have_the_same_bits_at_once_and_alone(
        controller in controllers(),
        noise in prop::option::of(noises()),
        boundary in prop_oneof![Just(Boundary::Walls), Just(Boundary::Open), Just(Boundary::Torus)],
        radius in prop::option::of(1.0..100.0),
        seed: u64,
    ) {
        let obstacle = |radius| v1::Obstacle { x: Some(200.0), y: Some(300.0), radius: Some(radius), ..v1::Obstacle::default() };
        let short = v1::World {
            horizon: Some(150),
            noise,
            boundary: Some(boundary.name().to_owned()),
            obstacles: radius.map(obstacle).into_iter().collect(),
            ..v1::World::default()
        };
        let (world, format) = (super::world(short), ImageFormat::default());
        let tasks: Vec<_> = (0..8).map(|i| (controller.clone(), Start::seeded(seed ^ i))).collect();
        for arch in arches() {
            let mut evaluator = Evaluator::on(arch, &world, &format).unwrap();
            let together = evaluator.evaluate_all(&tasks).unwrap();
            for ((controller, start), one) in tasks.iter().zip(together) {
                prop_assert!(one.same_bits(&evaluator.evaluate(controller, start).unwrap()), "{:?}", arch);
            }
        }
    }

    /// If noise changes nothing, the code path for noise has the same bits as the code path without noise.
    #[test]
    fn slip_too_small_to_matter_changes_no_bit(controller in controllers(), seed: u64) {
        let start = Start::seeded(seed);
        let (world, never) = (square(150.0, 20), v1::Noise { slip: Some(f64::MIN_POSITIVE), ..v1::Noise::default() });
        let mut calm = Swarm::new(&controller, &world, &start).unwrap();
        let mut noisy = Swarm::new(&controller, &noisy(&world, never), &start).unwrap();
        for swarm in [&mut calm, &mut noisy] {
            swarm.advance(60);
        }
        prop_assert_eq!(bits(&noisy), bits(&calm));
    }
}

/// A model of one robot, a unicycle with a ray that sees walls 20 units ahead.
fn before_walls() -> CapabilityModel {
    let sensor = Sensor::try_from(SensorDescription {
        range: Some(20.0),
        sees: vec![Seen::Walls],
        ..SensorDescription::default()
    });
    let robot = Robot::new(vec![sensor.unwrap()], 5.0, Drive::unicycle(1.0, 1.0).unwrap());
    CapabilityModel::of_one(robot.unwrap()).unwrap()
}

fn one_robot(noise: v1::Noise) -> World {
    noisy(&square(10_000.0, 1), noise)
}

/// Speed and turn of a lone robot of [`before_walls`] in each of `steps` steps, in a world without walls.
fn motions(noise: v1::Noise, pair: [f64; 2], seed: u64, steps: usize) -> Vec<[f64; 2]> {
    let open = v1::World {
        boundary: Some("open".to_owned()),
        ..one_robot(noise).into()
    };
    let world = &world(open);
    let [speed, turn] = pair;
    let controller = Controller::new(before_walls(), &[speed, turn, speed, turn]).unwrap();
    let mut swarm = Swarm::new(&controller, world, &Start::seeded(seed)).unwrap();
    let mut theta = swarm.agents().next().unwrap().theta;
    let motion = |_| {
        swarm.step();
        let agent = swarm.agents().next().unwrap();
        let [dx, dy] = agent.displacement;
        let turn = agent.theta - std::mem::replace(&mut theta, agent.theta);
        [dx.hypot(dy), turn]
    };
    (0..steps).map(motion).collect()
}

fn mean_and_deviation(values: impl Iterator<Item = f64> + Clone) -> [f64; 2] {
    let count = values.clone().count() as f64;
    let mean = values.clone().sum::<f64>() / count;
    let square = values.map(|value| (value - mean).powi(2)).sum::<f64>() / count;
    [mean, square.sqrt()]
}

#[test]
fn slip_has_the_deviation_that_was_asked_for() {
    let noise = v1::Noise {
        slip: Some(0.2),
        ..v1::Noise::default()
    };
    let motions = motions(noise, [0.5, 0.3], 1, 20_000);
    for (axis, asked) in [0.5, 0.3].into_iter().enumerate() {
        let [mean, deviation] = mean_and_deviation(motions.iter().map(|motion| motion[axis] / asked));
        assert!((mean - 1.0).abs() < 4.0 * 0.2 / 20_000_f64.sqrt(), "{mean}");
        assert!((deviation - 0.2).abs() < 0.005, "{deviation}");
        let most = motions
            .iter()
            .map(|motion| motion[axis] / asked)
            .fold(0.0, f64::max);
        assert!(most <= 1.0 + 4.0 * 0.2 + 1e-9, "{most}");
    }
}

#[test]
fn gains_are_a_robots_own_and_never_change() {
    let noise = v1::Noise {
        gain: Some(0.1),
        ..v1::Noise::default()
    };
    let mut gains = Vec::new();
    for seed in 0..2_000 {
        let motions = motions(noise, [0.5, 0.3], seed, 3);
        let [speed, turn] = motions[0];
        assert!(
            motions
                .iter()
                .all(|&[s, t]| (s - speed).abs() < 1e-9 && (t - turn).abs() < 1e-9)
        );
        gains.push([speed / 0.5, turn / 0.3]);
    }
    for axis in [0, 1] {
        let [mean, deviation] = mean_and_deviation(gains.iter().map(|gain| gain[axis]));
        assert!((mean - 1.0).abs() < 4.0 * 0.1 / 2_000_f64.sqrt(), "{mean}");
        assert!((deviation - 0.1).abs() < 0.007, "{deviation}");
    }
}

/// Readings of two robots that stand still; one sees the other.
fn readings(noise: v1::Noise, steps: u32) -> [Vec<u8>; 2] {
    let world = noisy(&square(300.0, 2), noise);
    let start = Start::at(vec![[100.0, 100.0, 0.0], [200.0, 100.0, 0.0]]).unwrap();
    let mut swarm = Swarm::new(&single([0.0; 4]), &world, &start).unwrap();
    let mut read = [Vec::new(), Vec::new()];
    for _ in 0..steps {
        swarm.step();
        for (read, agent) in read.iter_mut().zip(swarm.agents()) {
            read.push(agent.sensed);
        }
        assert_eq!(swarm.readings(), [1, 0], "what is seen is not noisy");
    }
    read
}

#[test]
fn readings_are_missed_and_false_as_often_as_asked() {
    let only = |missed, false_detection| v1::Noise {
        missed: Some(missed),
        false_detection: Some(false_detection),
        ..v1::Noise::default()
    };
    assert_eq!(readings(only(1.0, 0.0), 50), [vec![0; 50], vec![0; 50]]);
    assert_eq!(readings(only(0.0, 1.0), 50), [vec![1; 50], vec![1; 50]]);
    let shares =
        readings(only(0.3, 0.1), 20_000).map(|read| read.into_iter().map(f64::from).sum::<f64>() / 20_000.0);
    assert!((shares[0] - 0.7).abs() < 0.013, "{shares:?}");
    assert!((shares[1] - 0.1).abs() < 0.009, "{shares:?}");
}

/// A robot drives to a wall and stops once it senses the wall, at a known step.
#[test]
fn a_delayed_robot_moves_by_what_it_read_so_many_steps_ago() {
    // The padding is 1, so the sensor is on from x = 9979 on. A robot that starts at 9970 reaches 9979 with its 9th step.
    let controller = Controller::new(before_walls(), &[1.0, 0.0, 0.0, 0.0]).unwrap();
    let start = Start::at(vec![[9970.0, 5000.0, 0.0]]).unwrap();
    for delay in [0, 1, 2, 5] {
        let world = one_robot(v1::Noise {
            delay: Some(delay),
            ..v1::Noise::default()
        });
        let mut swarm = Swarm::new(&controller, &world, &start).unwrap();
        swarm.advance(100);
        let [x, _] = swarm.agents().next().unwrap().position;
        assert_eq!(x, 9979.0 + f64::from(delay));
    }
}

#[test]
fn noise_is_none_by_default() {
    assert!(Noise::default().is_off() && World::default().noise().is_off());
    let delayed = one_robot(v1::Noise {
        delay: Some(0),
        ..v1::Noise::default()
    });
    assert!(delayed.noise().is_off());
}
