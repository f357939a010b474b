//! Starts of swarms, by the world's shape.

use super::*;

fn starting(start: v1::StartShape, agents: u32) -> World {
    world(v1::World {
        agents: Some(agents),
        start: Some(start),
        ..v1::World::default()
    })
}

fn poses(world: &World, seed: u64) -> Vec<[f64; 3]> {
    let swarm = Swarm::new(&single([0.0; 4]), world, &Start::seeded(seed)).unwrap();
    let pose = |agent: Agent| [agent.position[0], agent.position[1], agent.theta];
    swarm.agents().map(pose).collect()
}

fn shaped(shape: &str) -> v1::StartShape {
    v1::StartShape {
        shape: Some(shape.to_owned()),
        ..v1::StartShape::default()
    }
}

#[test]
fn a_disc_is_filled_evenly_about_the_centre() {
    let world = starting(
        v1::StartShape {
            radius: Some(100.0),
            ..shaped("disc")
        },
        10_000,
    );
    let poses = poses(&world, 1);
    let distance = |pose: &[f64; 3]| (pose[0] - 250.0).hypot(pose[1] - 250.0);
    assert!(poses.iter().all(|pose| distance(pose) <= 100.0));
    let share = |inside: &dyn Fn(&[f64; 3]) -> bool| {
        poses.iter().filter(|pose| inside(pose)).count() as f64 / poses.len() as f64
    };
    // The shares are within four standard errors.
    assert!((share(&|pose| distance(pose) < 50.0) - 0.25).abs() < 0.018);
    assert!((share(&|pose| pose[0] < 250.0) - 0.5).abs() < 0.02);
    assert!((share(&|pose| pose[1] < 250.0) - 0.5).abs() < 0.02);
    assert!((share(&|pose| pose[2] < PI) - 0.5).abs() < 0.02);
    assert!(poses.iter().all(|pose| (0.0..TAU).contains(&pose[2])));
}

#[test]
fn a_line_is_horizontal_and_evenly_spaced() {
    let line = |length, agents| {
        let shape = v1::StartShape {
            length: Some(length),
            ..shaped("line")
        };
        poses(&starting(shape, agents), 3)
    };
    let poses = line(400.0, 5);
    let places: Vec<_> = poses.iter().map(|pose| [pose[0], pose[1]]).collect();
    assert_eq!(places, [50.0, 150.0, 250.0, 350.0, 450.0].map(|x| [x, 250.0]));
    assert!(
        poses.windows(2).all(|pair| pair[0][2] != pair[1][2]),
        "headings are drawn"
    );
    assert_eq!(line(400.0, 1)[0][..2], [250.0, 250.0]);
}

#[test]
fn poses_are_the_same_whatever_the_seed() {
    let shape = v1::StartShape {
        poses: vec![10.0, 20.0, 0.5, 30.0, 40.0, -7.0],
        ..shaped("poses")
    };
    let world = starting(shape, 2);
    for seed in 0..3 {
        assert_eq!(poses(&world, seed), [[10.0, 20.0, 0.5], [30.0, 40.0, -7.0]]);
    }
}
