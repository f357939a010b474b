//! Properties of the simulator: its bits, its collisions, and a comparison with a simple oracle.

pub(crate) mod described;
mod mirror;
mod noise;
mod obstacles;
mod starts;
mod torus;

use murmuration_proto::v1;
use murmuration_sim::simulate::{Agent, Arch, Start, Swarm};
use murmuration_swarm::{Boundary, Controller, Preset, Purpose, RandomStream, World};
use proptest::prelude::*;
use std::f64::consts::{PI, TAU};

/// Every instruction set that this CPU supports.
pub(crate) fn arches() -> Vec<Arch> {
    let mut arches = vec![Arch::Scalar, Arch::new()];
    #[cfg(target_arch = "x86_64")]
    arches.extend(pulp::x86::V3::try_new().map(Arch::V3));
    arches
}

fn world(message: v1::World) -> World {
    World::try_from(message).unwrap()
}

/// A square world of the paper's robots.
fn square(side: f64, agents: u32) -> World {
    world(v1::World {
        width: Some(side),
        height: Some(side),
        agents: Some(agents),
        padding: Some(1.0),
        ..World::default().into()
    })
}

/// The same controller, for robots with the bodies and wheels of `world`.
pub(crate) fn sized(controller: &Controller, world: &World) -> Controller {
    let preset = controller.model().preset().unwrap();
    Controller::new(world.robots_of(preset).unwrap(), controller.genes()).unwrap()
}

fn single(genes: [f64; 4]) -> Controller {
    Controller::new(Preset::SingleSensor, &genes).unwrap()
}

fn bits(swarm: &Swarm) -> Vec<[u64; 8]> {
    let bits = |agent: Agent| {
        let [x, y] = agent.position;
        let [hx, hy] = agent.heading;
        let [dx, dy] = agent.displacement;
        [x, y, hx, hy, agent.theta, dx, dy, f64::from(agent.sensed)].map(f64::to_bits)
    };
    swarm.agents().map(bits).collect()
}

pub(crate) fn controllers() -> impl Strategy<Value = Controller> {
    let speeds = || -1.0..=1.0;
    let single = prop::collection::vec(speeds(), 4)
        .prop_map(|genes| Controller::new(Preset::SingleSensor, &genes).unwrap());
    let two = (prop::collection::vec(speeds(), 8), -PI..=PI).prop_map(|(mut genes, angle)| {
        genes.push(angle);
        Controller::new(Preset::TwoSensor, &genes).unwrap()
    });
    prop_oneof![single, two]
}

/// Worlds of all shapes, including crowded worlds.
pub(crate) fn worlds(agents: impl Strategy<Value = u32>) -> impl Strategy<Value = World> {
    (
        (10.0..400.0, 10.0..400.0, 0.01..5.0, 0.0..1.0),
        (agents, 0.1..20.0, 0.01..5.0, any::<bool>()),
    )
        .prop_map(|((width, height, radius, walls), (agents, wheel, dt, jitter))| {
            let room: f64 = f64::min(width, height) / 2.0 - radius;
            world(v1::World {
                width: Some(width),
                height: Some(height),
                padding: Some(0.99 * walls * room),
                agents: Some(agents),
                radius: Some(radius),
                wheel_radius: Some(wheel),
                dt: Some(dt),
                jitter: Some(jitter),
                ..v1::World::default()
            })
        })
}

/// The sensor state of agent `i` at `at`, by the definition.
fn sensed_by_hand(positions: &[[f64; 2]], i: usize, at: [f64; 2], rays: &[[f64; 2]], radius: f64) -> u8 {
    let hits = |ray: &[f64; 2]| {
        positions.iter().enumerate().any(|(j, other)| {
            let e = [other[0] - at[0], other[1] - at[1]];
            let along = e[0] * ray[0] + e[1] * ray[1];
            let squared = e[0] * e[0] + e[1] * e[1];
            j != i && along >= 0.0 && radius * radius - squared + along * along >= 0.0
        })
    };
    rays.iter().fold(0, |state, ray| 2 * state + u8::from(hits(ray)))
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(128))]

    #[test]
    fn the_bits_are_the_same_on_every_cpu(
        controller in controllers(),
        world in worlds(1..=70u32),
        seed: u64,
    ) {
        let controller = sized(&controller, &world);
        let start = Start::seeded(seed);
        let run = |arch| {
            let mut swarm = Swarm::on(arch, &controller, &world, &start).unwrap();
            swarm.advance(60);
            (bits(&swarm), swarm.jitter_events())
        };
        let scalar = run(Arch::Scalar);
        for arch in arches() {
            prop_assert_eq!(&run(arch), &scalar, "{:?}", arch);
        }
    }

    /// Tests worlds of any density, up to worlds so crowded that all agents touch, and starts beyond the walls.
    #[test]
    fn a_grid_changes_no_bit(
        controller in controllers(),
        world in worlds(100..=400u32),
        seed: u64,
        spread in prop_oneof![Just(1.0), 0.0..3.0_f64],
    ) {
        let controller = sized(&controller, &world);
        let poses = Start::seeded(seed).poses_for(&world).unwrap().into_owned();
        let start = Start::at(poses.iter().map(|&[x, y, theta]| [spread * x - 0.3 * x, spread * y, theta]).collect()).unwrap();
        let mut all = Swarm::pairwise(Arch::new(), &controller, &world, &start).unwrap();
        let mut near = all.clone().with_grid(&world);
        for swarm in [&mut all, &mut near] {
            swarm.advance(40);
        }
        prop_assert_eq!(bits(&near), bits(&all));
        prop_assert_eq!(near.jitter_events(), all.jitter_events());
    }

    #[test]
    fn the_bits_do_not_depend_on_how_the_steps_are_grouped(
        controller in controllers(),
        world in worlds(1..=30u32),
        seed: u64,
        groups in prop::collection::vec(1u32..300, 1..5),
    ) {
        let controller = sized(&controller, &world);
        let start = Start::seeded(seed);
        let mut grouped = Swarm::new(&controller, &world, &start).unwrap();
        let mut single = grouped.clone();
        for steps in groups {
            grouped.advance(steps);
            (0..steps).for_each(|_| single.step());
        }
        prop_assert_eq!(grouped.steps(), single.steps());
        prop_assert_eq!(bits(&grouped), bits(&single));
    }

    #[test]
    fn nothing_valid_leaves_the_finite_numbers(
        controller in controllers(),
        world in worlds(1..=40u32),
        seed: u64,
    ) {
        let controller = sized(&controller, &world);
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        swarm.advance(300);
        for agent in swarm.agents() {
            let [[x, y], [dx, dy], [hx, hy]] = [agent.position, agent.displacement, agent.heading];
            prop_assert!([x, y, dx, dy, agent.theta].iter().all(|value| value.is_finite()));
            prop_assert!((hx * hx + hy * hy - 1.0).abs() < 1e-12);
        }
    }

    /// Computes the sensor state of each agent, and the step of agents that touch no other agent, by the definition. The numbers
    /// of agents lie on both sides of the limits of groups of blocks.
    #[test]
    fn a_step_is_what_the_definition_says(
        controller in controllers(),
        agents in prop_oneof![1..=70u32, 250..=262u32, 510..=514u32],
        seed: u64,
    ) {
        let world = square(10_000.0, agents);
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        swarm.step();
        let before: Vec<Agent> = swarm.agents().collect();
        swarm.step();
        let mut positions: Vec<[f64; 2]> = before.iter().map(|agent| agent.position).collect();
        for (i, (was, is)) in before.iter().zip(swarm.agents()).enumerate() {
            let [left, right] = controller.robots().next().unwrap().pairs()[usize::from(was.sensed)];
            let driven = [0, 1].map(|axis| (was.position[axis] + (left + right) * was.heading[axis]).clamp(6.0, 9994.0));
            let pushed = is.position != driven;
            if pushed {
                let near = |other: &[f64; 2]| (other[0] - driven[0]).hypot(other[1] - driven[1]) < 10.0;
                let others = positions.iter().enumerate().filter(|&(j, _)| j != i);
                prop_assert!(others.map(|(_, other)| other).any(near), "agent {} moved for no reason", i);
            }
            prop_assert_eq!(is.theta, was.theta + (left - right) / 10.0);
            let rays: Vec<[f64; 2]> = swarm.sensor_directions(i, is.heading).collect();
            let sensed = sensed_by_hand(&positions, i, is.position, &rays, 5.0);
            prop_assert_eq!(is.sensed, sensed, "agent {}", i);
            positions[i] = is.position;
        }
    }

    #[test]
    fn two_agents_never_overlap_and_keep_to_the_walls(controller in controllers(), seed: u64) {
        let world = square(60.0, 2);
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        for _ in 0..200 {
            swarm.step();
            let agents: Vec<[f64; 2]> = swarm.agents().map(|agent| agent.position).collect();
            let [dx, dy] = [agents[0][0] - agents[1][0], agents[0][1] - agents[1][1]];
            prop_assert!(dx.hypot(dy) >= 10.0 - 1e-9, "{:?}", agents);
            // A push by the other agent can move an agent beyond the walls, but only once.
            let walls = 6.0 - 10.001 - 1e-9..=54.0 + 10.001 + 1e-9;
            prop_assert!(agents.iter().flatten().all(|value| walls.contains(value)), "{:?}", agents);
        }
    }

    #[test]
    fn an_agent_alone_keeps_to_the_walls(controller in controllers(), seed: u64) {
        let world = square(60.0, 1);
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        for _ in 0..200 {
            swarm.step();
            let inside = |agent: Agent| agent.position.iter().all(|value| (6.0..=54.0).contains(value));
            prop_assert!(swarm.agents().all(inside));
        }
    }
}

#[test]
fn the_heading_follows_theta_however_long() {
    let world = square(100.0, 3);
    let mut swarm = Swarm::new(&single([1.0, -0.7, 0.3, 0.9]), &world, &Start::seeded(1)).unwrap();
    swarm.advance(10_000);
    for agent in swarm.agents() {
        // The error of theta itself is as large: each addition rounds at a magnitude of some thousands.
        assert!((agent.heading[0] - agent.theta.cos()).abs() < 1e-8);
        assert!((agent.heading[1] - agent.theta.sin()).abs() < 1e-8);
    }
}

#[test]
fn agents_at_the_very_same_place_part_towards_the_centre() {
    let world = square(100.0, 2);
    let stay = single([0.0; 4]);
    let positions = |poses: [[f64; 3]; 2]| {
        let mut swarm = Swarm::new(&stay, &world, &Start::at(poses.to_vec()).unwrap()).unwrap();
        swarm.step();
        swarm.agents().map(|agent| agent.position).collect::<Vec<_>>()
    };
    assert_eq!(
        positions([[50.0, 20.0, 0.0]; 2]),
        [[50.0, 20.0 + 10.001], [50.0, 20.0]]
    );
    assert_eq!(
        positions([[50.0, 50.0, 0.0]; 2]),
        [[50.0 + 10.001, 50.0], [50.0, 50.0]]
    );
}

/// A pile of agents occurs in a large swarm if several starts are clamped into one corner.
#[test]
fn a_pile_of_agents_comes_apart() {
    let world = square(200.0, 12);
    let start = Start::at((0..12).map(|i| [0.0, 0.0, f64::from(i)]).collect()).unwrap();
    let mut swarm = Swarm::new(&single([0.6, 1.0, 0.4, 0.5]), &world, &start).unwrap();
    swarm.advance(200);
    let positions: Vec<[f64; 2]> = swarm.agents().map(|agent| agent.position).collect();
    for (i, a) in positions.iter().enumerate() {
        for b in &positions[..i] {
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) >= 10.0 - 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn jitter_is_seeded_and_only_where_it_is_asked_for() {
    // A given start has the seed 0.
    let drawn = Start::seeded(9);
    let run = |jitter, given| {
        let world = world(v1::World {
            width: Some(100.0),
            height: Some(100.0),
            jitter: Some(jitter),
            ..World::default().into()
        });
        let controller = single([0.6, 1.0, 0.4, 0.5]);
        let poses = drawn.poses_for(&world).unwrap().into_owned();
        let start = if given {
            Start::at(poses).unwrap()
        } else {
            drawn.clone()
        };
        let mut swarm = Swarm::new(&controller, &world, &start).unwrap();
        swarm.advance(20);
        assert!(swarm.jitter_events() > 0);
        bits(&swarm)
    };
    assert_eq!(run(true, false), run(true, false));
    assert_ne!(run(true, false), run(true, true));
    assert_ne!(run(true, false), run(false, false));
    assert_eq!(run(false, false), run(false, true));
}

#[test]
fn a_seeded_start_is_drawn_agent_by_agent() {
    let world = World::default();
    let swarm = Swarm::new(&single([0.0; 4]), &world, &Start::seeded(3)).unwrap();
    let mut stream = RandomStream::derive(3, Purpose::Start, 0);
    for agent in swarm.agents() {
        assert_eq!(agent.position, [(); 2].map(|()| 500.0 * stream.random::<f64>()));
        assert_eq!(agent.theta, TAU * stream.random::<f64>());
    }
}

#[test]
fn a_start_that_does_not_fit_is_refused() {
    let error = Start::at(vec![[0.0; 3], [0.0, f64::NAN, 0.0]]).unwrap_err();
    assert_eq!(
        error.to_string(),
        "initial[1] = NaN: must be three finite numbers"
    );
    let start = Start::at(vec![[0.0; 3]; 3]).unwrap();
    let error = Swarm::new(&single([0.0; 4]), &World::default(), &start).unwrap_err();
    assert_eq!(
        error.to_string(),
        "initial = 3 poses: must be 24 poses, one an agent"
    );
}
