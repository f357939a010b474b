//! Worlds on a torus.

use super::*;

fn torus(side: f64, agents: u32) -> World {
    world(v1::World {
        boundary: Some(Boundary::Torus.name().to_owned()),
        ..square(side, agents).into()
    })
}

fn swarm(genes: [f64; 4], world: &World, poses: &[[f64; 3]]) -> Swarm {
    Swarm::new(&single(genes), world, &Start::at(poses.to_vec()).unwrap()).unwrap()
}

fn positions(swarm: &Swarm) -> Vec<[f64; 2]> {
    swarm.agents().map(|agent| agent.position).collect()
}

#[test]
fn a_robot_that_drives_straight_comes_back() {
    let world = torus(100.0, 1);
    for (theta, ahead) in [(0.0, [1.0, 0.0]), (1.5 * PI, [0.0, -1.0])] {
        let mut swarm = swarm([1.0; 4], &world, &[[30.0, 40.0, theta]]);
        for step in 1..=50 {
            swarm.step();
            let agent = swarm.agents().next().unwrap();
            let moved = agent.displacement;
            assert!(
                (moved[0] - 2.0 * ahead[0]).abs() < 1e-9,
                "{moved:?} at step {step}"
            );
            assert!(
                (moved[1] - 2.0 * ahead[1]).abs() < 1e-9,
                "{moved:?} at step {step}"
            );
            assert!(agent.position.iter().all(|value| (0.0..100.0).contains(value)));
        }
        let [x, y] = positions(&swarm)[0];
        assert!((x - 30.0).abs() < 1e-9 && (y - 40.0).abs() < 1e-9, "{x} {y}");
    }
}

#[test]
fn robots_collide_across_the_edge() {
    let world = torus(100.0, 2);
    let mut swarm = swarm([0.0; 4], &world, &[[2.0, 50.0, 0.0], [97.0, 50.0, 0.0]]);
    swarm.step();
    // The robots are five units apart across the edge; the first robot is pushed to the right.
    let at = positions(&swarm);
    assert!((at[0][0] - 7.001).abs() < 1e-9 && at[0][1] == 50.0, "{at:?}");
    assert_eq!(at[1], [97.0, 50.0]);
    let [dx, dy] = swarm.agents().next().unwrap().displacement;
    assert!((dx - 5.001).abs() < 1e-9 && dy == 0.0);
}

#[test]
fn robots_see_each_others_nearest_image_only() {
    let world = torus(100.0, 2);
    let reading = |x: f64, theta: f64| {
        let swarm = swarm([0.0; 4], &world, &[[90.0, 50.0, theta], [x, 50.0, 0.0]]);
        swarm.readings()[0]
    };
    // The other robot is 20 units to the right across the edge, or 30 units to the left. No robot is seen the longer way around.
    assert_eq!((reading(10.0, 0.0), reading(10.0, PI)), (1, 0));
    assert_eq!((reading(60.0, 0.0), reading(60.0, PI)), (0, 1));
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(64))]

    #[test]
    fn the_bits_are_the_same_on_every_cpu_and_nobody_leaves(
        controller in controllers(),
        agents in 1..=40_u32,
        seed: u64,
    ) {
        let world = torus(150.0, agents);
        let run = |arch| {
            let mut swarm = Swarm::on(arch, &controller, &world, &Start::seeded(seed)).unwrap();
            swarm.advance(60);
            (bits(&swarm), swarm.readings())
        };
        let scalar = run(Arch::Scalar);
        for arch in arches() {
            prop_assert_eq!(&run(arch), &scalar, "{:?}", arch);
        }
    }

    #[test]
    fn described_robots_sense_the_same_wherever_the_edges_are(
        controller in described::swarms(8),
        shift in prop::array::uniform2(0..256_u32),
        seed: u64,
    ) {
        let shift = shift.map(f64::from);
        let run = |arch, [dx, dy]: [f64; 2]| {
            let moved = |value: f64, by: f64| (value + by).rem_euclid(256.0);
            let (disc, square) = ([60.0, 200.0], [250.0, 30.0]);
            let world = world(v1::World {
                obstacles: vec![
                    v1::Obstacle {
                        x: Some(moved(disc[0], dx)),
                        y: Some(moved(disc[1], dy)),
                        radius: Some(20.0),
                        ..v1::Obstacle::default()
                    },
                    v1::Obstacle {
                        x: Some(moved(square[0], dx)),
                        y: Some(moved(square[1], dy)),
                        width: Some(30.0),
                        height: Some(30.0),
                        ..v1::Obstacle::default()
                    },
                ],
                ..described::world_of(controller.model(), 256.0, Boundary::Torus).into()
            });
            let poses = Start::seeded(seed).poses_for(&world).unwrap().into_owned();
            let poses = poses.into_iter().map(|[x, y, theta]| [moved(x, dx), moved(y, dy), theta]);
            let start = Start::at(poses.collect()).unwrap();
            let mut swarm = Swarm::on(arch, &controller, &world, &start).unwrap();
            let before = swarm.readings();
            swarm.advance(3);
            (before, bits(&swarm))
        };
        let here = run(Arch::Scalar, [0.0; 2]);
        for arch in arches() {
            prop_assert_eq!(&run(arch, [0.0; 2]), &here, "{:?}", arch);
        }
        // Even with ranges beyond half the world, readings do not depend on the edges: sensors see only the nearest image of a
        // robot, and nine images of an obstacle.
        prop_assert_eq!(run(Arch::Scalar, shift).0, here.0);
    }

    /// Far from its edges, a torus behaves like a world with walls.
    #[test]
    fn far_from_the_edges_there_is_no_torus(controller in controllers(), seed: u64) {
        let plain = square(10_000.0, 20);
        let near = |&[x, y, theta]: &[f64; 3]| [5_000.0 + 0.02 * x, 5_000.0 + 0.02 * y, theta];
        let poses: Vec<_> = Start::seeded(seed).poses_for(&plain).unwrap().iter().map(near).collect();
        let run = |world: &World| {
            let mut swarm = Swarm::new(&controller, world, &Start::at(poses.clone()).unwrap()).unwrap();
            swarm.advance(60);
            swarm
        };
        let (plain, torus) = (run(&plain), run(&torus(10_000.0, 20)));
        prop_assert_eq!(positions(&plain), positions(&torus));
        prop_assert_eq!(plain.readings(), torus.readings());
    }
}
