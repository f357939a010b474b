//! Tests that described robots see by the definition, and that robots with the description of the paper's robots have the same
//! bits.

use super::*;
use murmuration_swarm::{
    CapabilityModel, Drive, Robot, Seen, SeenRobots, Sensor, SensorAngle, SensorDescription, Species,
    SpeciesName,
};
use rand::RngExt as _;
use std::f64::consts::FRAC_PI_2;

fn name(name: &str) -> SpeciesName {
    SpeciesName::parse("name", name).unwrap()
}

/// The same robots as a species with a name and a count, so that the robots are no preset.
fn described(controller: &Controller, world: &World) -> Controller {
    let robot = controller.model().species()[0].robot().clone();
    let model = CapabilityModel::new(vec![Species::new(name("a"), robot)], vec![vec![world.agents()]]);
    Controller::new(model.unwrap(), controller.genes()).unwrap()
}

/// Sensors of all kinds, in a swarm whose other species is "b".
fn sensors() -> impl Strategy<Value = Sensor> {
    let sees = prop::sample::subsequence(vec!["robots", "walls", "obstacles"], 1..=3);
    sensors_that_see(prop_oneof![sees, Just(vec!["b"]), Just(vec!["b", "walls"])])
}

fn sensors_that_see(sees: impl Strategy<Value = Vec<&'static str>>) -> impl Strategy<Value = Sensor> {
    let half_angle = prop_oneof![
        Just(0.0),
        0.0..0.02,
        0.0..0.6,
        0.0..PI,
        PI - 0.02..PI,
        Just(FRAC_PI_2),
        Just(PI)
    ];
    (
        -PI..=PI,
        half_angle,
        prop::option::of(1.0..300.0),
        sees,
        1.0..200.0,
    )
        .prop_map(|(angle, half_angle, range, sees, wall_range)| {
            let sees: Vec<Seen> = sees.iter().map(|seen| seen.parse().unwrap()).collect();
            let wall_range = sees.contains(&Seen::Walls).then_some(wall_range);
            Sensor::try_from(SensorDescription {
                angle: SensorAngle::fixed(angle).unwrap(),
                half_angle,
                range,
                sees,
                wall_range,
            })
            .unwrap()
        })
}

fn robots() -> impl Strategy<Value = Robot> {
    robots_with(sensors())
}

fn robots_with(sensor: impl Strategy<Value = Sensor>) -> impl Strategy<Value = Robot> {
    let drive = prop_oneof![
        Just(Drive::differential(2.0, 1.0).unwrap()),
        Just(Drive::unicycle(5.0, 2.0).unwrap())
    ];
    let sensors = prop::collection::vec(sensor, 1..=6);
    (sensors, 0.5..12.0, drive)
        .prop_map(|(sensors, radius, drive)| Robot::new(sensors, radius, drive).unwrap())
}

/// Models that suit a batch.
pub(crate) fn alone() -> impl Strategy<Value = CapabilityModel> {
    let rays = Just(Sensor::try_from(SensorDescription::default()).unwrap());
    let robots = prop_oneof![
        robots_with(sensors_that_see(Just(vec!["robots"]))),
        robots_with(rays)
    ];
    robots.prop_map(|robot| CapabilityModel::of_one(robot).unwrap())
}

pub(crate) fn boundaries() -> impl Strategy<Value = Boundary> {
    prop_oneof![Just(Boundary::Walls), Just(Boundary::Open)]
}

/// Controllers of swarms with two species, or with three species, two of the same size.
pub(super) fn swarms(count: u32) -> impl Strategy<Value = Controller> {
    (robots(), robots(), any::<bool>(), any::<u64>()).prop_map(move |(a, b, thrice, seed)| {
        let species = |called, robot: &Robot| Species::new(name(called), robot.clone());
        let (mut all, mut counts) = (vec![species("a", &a), species("b", &b)], vec![count, count + 3]);
        if thrice {
            all.push(species("c", &a));
            counts.push(5);
        }
        let model = CapabilityModel::new(all, vec![counts]).unwrap();
        let mut stream = RandomStream::derive(seed, Purpose::Propose, 0);
        let genes: Vec<f64> = (0..model.genes())
            .map(|_| stream.random_range(-1.0..1.0))
            .collect();
        Controller::new(model, &genes).unwrap()
    })
}

pub(super) fn world_of(model: &CapabilityModel, side: f64, boundary: Boundary) -> World {
    world(v1::World {
        width: Some(side),
        height: Some(side),
        padding: Some(1.0),
        agents: model.robots(),
        radius: Some(model.largest_radius()),
        boundary: Some(boundary.name().to_owned()),
        ..World::default().into()
    })
}

/// Sensor reading of a robot by the definition, with angles instead of rotated vectors.
fn sensed_by_angles(controller: &Controller, robots: &[Agent], i: usize, world: &World) -> u8 {
    let counts = controller.counts(world.agents()).into_iter().enumerate();
    let of: Vec<usize> = counts
        .flat_map(|(place, count)| vec![place; count as usize])
        .collect();
    let me = robots[i];
    let all = controller.model().species();
    let species = &all[of[i]];
    species.robot().sensors().iter().fold(0, |state, sensor| {
        let looks = me.theta + sensor.angle().value().unwrap();
        let off = |e: [f64; 2]| (e[1].atan2(e[0]) - looks + PI).rem_euclid(TAU) - PI;
        let seen = |(j, other): (usize, &Agent)| {
            let theirs = &all[of[j]];
            let wanted = match sensor.robots() {
                SeenRobots::None => false,
                SeenRobots::All => true,
                SeenRobots::Species(name) => name == theirs.name(),
            };
            let e = [0, 1].map(|axis| other.position[axis] - me.position[axis]);
            let distance = e[0].hypot(e[1]);
            let off = off(e);
            let edge = |by: f64| {
                let to_edge = off - by;
                to_edge.cos() >= 0.0 && (distance * to_edge.sin()).abs() <= theirs.robot().radius()
            };
            let half = sensor.half_angle();
            let within = off.abs() <= half || edge(half) || edge(-half);
            j != i && wanted && distance <= sensor.range().unwrap_or(f64::INFINITY) && within
        };
        let wall = sensor.wall_range().is_some_and(|range| {
            let points = (0..=20_000).map(|n| f64::from(n) / 10_000.0 - 1.0);
            let on_arc = points.map(|part| looks + part * sensor.half_angle());
            let high = [world.width() - world.padding(), world.height() - world.padding()];
            let is_beyond = |[x, y]: [f64; 2]| x.min(y) <= world.padding() || x >= high[0] || y >= high[1];
            let end = |angle: f64| {
                [
                    me.position[0] + range * angle.cos(),
                    me.position[1] + range * angle.sin(),
                ]
            };
            // If a collision has pushed the robot beyond a wall, the robot sees the wall in any direction.
            let is_seen = is_beyond(me.position) || on_arc.into_iter().map(end).any(is_beyond);
            world.boundary() == Boundary::Walls && is_seen
        });
        2 * state + u8::from(wall || robots.iter().enumerate().any(seen))
    })
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(96))]

    #[test]
    fn the_papers_robots_described_have_the_papers_bits(
        controller in controllers(),
        world in worlds(1..=70u32),
        seed: u64,
    ) {
        let start = Start::seeded(seed);
        let controller = sized(&controller, &world);
        let mut paper = Swarm::new(&controller, &world, &start).unwrap();
        let mut same = Swarm::new(&described(&controller, &world), &world, &start).unwrap();
        for swarm in [&mut paper, &mut same] {
            swarm.advance(60);
        }
        prop_assert_eq!(bits(&same), bits(&paper));
        prop_assert_eq!(same.readings(), paper.readings());
        prop_assert_eq!(same.jitter_events(), paper.jitter_events());
    }

    /// The paper's robots take the general code path if another robot has another size. In this test, the other robot is so far
    /// away, in a world without walls, that the paper's robots rarely see it.
    #[test]
    fn the_general_path_has_the_papers_bits_too(controller in controllers(), seed: u64) {
        let without = square(10_000.0, 39);
        let first = controller.model().species()[0].robot().clone();
        let other = Robot::new(vec![first.sensors()[0].clone()], 4.0, *first.drive()).unwrap();
        let species = vec![Species::new(name("a"), first), Species::new(name("b"), other)];
        let model = CapabilityModel::new(species, vec![vec![39, 1]]).unwrap();
        let with = world_of(&model, 10_000.0, Boundary::Open);
        let both = Controller::new(model, &[controller.genes(), &[0.0; 4]].concat()).unwrap();
        let near = |&[x, y, theta]: &[f64; 3]| [5_000.0 + 0.02 * x, 5_000.0 + 0.02 * y, theta];
        let mut poses: Vec<_> = Start::seeded(seed).poses_for(&without).unwrap().iter().map(near).collect();
        let mut paper = Swarm::new(&controller, &without, &Start::at(poses.clone()).unwrap()).unwrap();
        poses.push([1e9, 1e12, 0.0]);
        let start = Start::at(poses).unwrap();
        let mut general = Swarm::new(&both, &with, &start).unwrap();
        for swarm in [&mut paper, &mut general] {
            swarm.advance(60);
        }
        prop_assert_eq!(&bits(&general)[..39], &bits(&paper)[..]);
    }

    #[test]
    fn described_bits_are_the_same_on_every_cpu_and_with_a_grid(
        controller in swarms(20),
        boundary in boundaries(),
        seed: u64,
    ) {
        let world = world_of(controller.model(), 250.0, boundary);
        let start = Start::seeded(seed);
        let run = |arch, grid| {
            let mut swarm = Swarm::pairwise(arch, &controller, &world, &start).unwrap();
            if grid {
                swarm = swarm.with_grid(&world);
            }
            let mut states = vec![swarm.readings()];
            swarm.advance(40);
            states.push(swarm.readings());
            (bits(&swarm), states)
        };
        let scalar = run(Arch::Scalar, false);
        for arch in arches() {
            prop_assert_eq!(&run(arch, false), &scalar, "{:?}", arch);
        }
        prop_assert_eq!(&run(Arch::new(), true), &scalar);
    }

    /// Angles round differently from vectors. A reading can differ if a body is exactly at a sensor's limit, which hardly ever
    /// happens in random swarms.
    #[test]
    fn what_is_seen_is_what_the_definition_says(
        controller in swarms(6),
        boundary in boundaries(),
        seed: u64,
    ) {
        let world = world_of(controller.model(), 300.0, boundary);
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        swarm.advance(3);
        let robots: Vec<Agent> = swarm.agents().collect();
        for (i, reading) in swarm.readings().into_iter().enumerate() {
            let by_angles = sensed_by_angles(&controller, &robots, i, &world);
            prop_assert_eq!(reading, by_angles, "robot {}", i);
        }
    }

    #[test]
    fn bodies_of_two_sizes_do_not_overlap(sizes in prop::array::uniform2(0.5..12.0), seed: u64) {
        let ray = Sensor::try_from(SensorDescription::default()).unwrap();
        let species = |called, radius| {
            let robot = Robot::new(vec![ray.clone()], radius, Drive::unicycle(5.0, 1.0).unwrap()).unwrap();
            Species::new(name(called), robot)
        };
        let species = vec![species("a", sizes[0]), species("b", sizes[1])];
        let model = CapabilityModel::new(species, vec![vec![1, 1]]).unwrap();
        let genes = [3.0, 0.1, 4.0, -0.3, 2.0, 0.5, 5.0, 0.0];
        let world = world_of(&model, 60.0, Boundary::Walls);
        let controller = Controller::new(model, &genes).unwrap();
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        for _ in 0..200 {
            swarm.step();
            let at: Vec<[f64; 2]> = swarm.agents().map(|agent| agent.position).collect();
            let distance = (at[0][0] - at[1][0]).hypot(at[0][1] - at[1][1]);
            prop_assert!(distance >= sizes[0] + sizes[1] - 1e-9, "{:?}", at);
        }
        prop_assert_eq!([swarm.radius(0), swarm.radius(1)], sizes);
    }
}

#[test]
fn an_open_world_has_no_walls() {
    let controller = single([1.0; 4]);
    let start = Start::at(vec![[30.0, 30.0, 0.0]]).unwrap();
    let of = |boundary: Boundary| {
        let world = world(v1::World {
            boundary: Some(boundary.name().to_owned()),
            ..square(60.0, 1).into()
        });
        let end = |controller: &Controller| {
            let mut swarm = Swarm::new(controller, &world, &start).unwrap();
            swarm.advance(100);
            swarm.agents().next().unwrap().position[0]
        };
        [end(&controller), end(&described(&controller, &world))]
    };
    assert_eq!((of(Boundary::Walls), of(Boundary::Open)), ([54.0; 2], [230.0; 2]));
}

#[test]
fn a_world_is_for_the_robots_that_are_in_it() {
    let controller = described(&single([0.0; 4]), &square(60.0, 3));
    let error = |world: &World| {
        Swarm::new(&controller, world, &Start::seeded(1))
            .unwrap_err()
            .to_string()
    };
    assert_eq!(
        error(&square(60.0, 4)),
        "agents = 4: must be 3, the number of robots of all species"
    );
    let smaller = world(v1::World {
        radius: Some(1.0),
        ..square(60.0, 3).into()
    });
    assert_eq!(
        error(&smaller),
        "radius = 1: must be 5, the radius of the largest robot"
    );
}
