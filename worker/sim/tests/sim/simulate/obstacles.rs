//! Tests that obstacles push robots out, and that sensors see obstacles.

use super::*;
use murmuration_swarm::{CapabilityModel, Drive, Robot, Seen, Sensor, SensorAngle, SensorDescription};
use std::f64::consts::FRAC_PI_4;

fn disc(x: f64, y: f64, radius: f64) -> v1::Obstacle {
    v1::Obstacle {
        x: Some(x),
        y: Some(y),
        radius: Some(radius),
        ..v1::Obstacle::default()
    }
}

fn rectangle(x: f64, y: f64, width: f64, height: f64) -> v1::Obstacle {
    v1::Obstacle {
        x: Some(x),
        y: Some(y),
        width: Some(width),
        height: Some(height),
        ..v1::Obstacle::default()
    }
}

fn with(obstacles: Vec<v1::Obstacle>, boundary: Boundary, world: World) -> World {
    super::world(v1::World {
        obstacles,
        boundary: Some(boundary.name().to_owned()),
        ..world.into()
    })
}

fn obstacles() -> impl Strategy<Value = Vec<v1::Obstacle>> {
    let at = || 0.0..200.0_f64;
    let size = || 1.0..60.0_f64;
    let disc = (at(), at(), size()).prop_map(|(x, y, radius)| disc(x, y, radius / 2.0));
    let rectangle =
        (at(), at(), size(), size()).prop_map(|(x, y, width, height)| rectangle(x, y, width, height));
    prop::collection::vec(prop_oneof![disc, rectangle], 1..12)
}

proptest! {
    #![proptest_config(crate::proptest_cases::at_most(96))]

    #[test]
    fn a_robot_alone_is_never_inside_one(
        controller in controllers(),
        obstacles in obstacles(),
        boundary in prop_oneof![Just(Boundary::Walls), Just(Boundary::Open), Just(Boundary::Torus)],
        seed: u64,
    ) {
        let world = with(obstacles, boundary, square(200.0, 1));
        let mut swarm = Swarm::new(&controller, &world, &Start::seeded(seed)).unwrap();
        for _ in 0..200 {
            swarm.step();
            let at = swarm.agents().next().unwrap().position;
            for obstacle in world.obstacles() {
                prop_assert!(obstacle.distance(at) >= 5.0, "{:?} in {:?}", at, obstacle);
            }
        }
    }

    #[test]
    fn the_bits_are_the_same_on_every_cpu_with_a_grid_and_together(
        controller in controllers(),
        obstacles in obstacles(),
        seed: u64,
    ) {
        let world = with(obstacles, Boundary::Walls, square(200.0, 20));
        let start = Start::seeded(seed);
        let run = |arch, grid| {
            let mut swarm = Swarm::pairwise(arch, &controller, &world, &start).unwrap();
            if grid {
                swarm = swarm.with_grid(&world);
            }
            swarm.advance(60);
            bits(&swarm)
        };
        let scalar = run(Arch::Scalar, false);
        for arch in arches() {
            prop_assert_eq!(&run(arch, false), &scalar, "{:?}", arch);
        }
        prop_assert_eq!(&run(Arch::new(), true), &scalar);
    }
}

/// Final position of a robot of the paper that starts at `from` with the heading `theta`, and drives 2 units per step.
fn end(obstacles: Vec<v1::Obstacle>, from: [f64; 2], theta: f64, steps: u32) -> [f64; 2] {
    let world = with(obstacles, Boundary::Walls, square(200.0, 1));
    let start = Start::at(vec![[from[0], from[1], theta]]).unwrap();
    let mut swarm = Swarm::new(&single([1.0; 4]), &world, &start).unwrap();
    swarm.advance(steps);
    swarm.agents().next().unwrap().position
}

#[track_caller]
fn assert_near(at: [f64; 2], expected: [f64; 2]) {
    let off = (at[0] - expected[0]).hypot(at[1] - expected[1]);
    assert!(off < 1e-9, "{at:?}, not {expected:?}");
}

#[test]
fn a_robot_stops_before_what_it_drives_straight_into() {
    assert_near(
        end(vec![disc(150.0, 100.0, 20.0)], [100.0, 100.0], 0.0, 50),
        [124.999, 100.0],
    );
    let side = rectangle(150.0, 100.0, 40.0, 100.0);
    assert_near(end(vec![side], [100.0, 100.0], 0.0, 50), [124.999, 100.0]);
    // The robot is not stopped before it reaches the side.
    assert_near(end(vec![side], [100.0, 100.0], 0.0, 12), [124.0, 100.0]);
    // The robot slides along a side that it drives into at an angle.
    let slid = end(vec![side], [100.0, 100.0], 0.5, 40);
    assert_near(slid, [124.999, 100.0 + 40.0 * 2.0 * 0.5_f64.sin()]);
}

#[test]
fn a_robot_that_starts_inside_leaves_by_the_nearest_way() {
    let still = |obstacle, x, y| {
        let world = with(vec![obstacle], Boundary::Walls, square(200.0, 1));
        let start = Start::at(vec![[x, y, 0.0]]).unwrap();
        let mut swarm = Swarm::new(&single([0.0; 4]), &world, &start).unwrap();
        swarm.step();
        swarm.agents().next().unwrap().position
    };
    assert_near(still(disc(100.0, 100.0, 20.0), 100.0, 90.0), [100.0, 74.999]);
    assert_near(still(disc(100.0, 100.0, 20.0), 100.0, 100.0), [125.001, 100.0]);
    assert_near(
        still(rectangle(100.0, 100.0, 40.0, 60.0), 90.0, 100.0),
        [74.999, 100.0],
    );
    assert_near(
        still(rectangle(100.0, 100.0, 40.0, 60.0), 105.0, 125.0),
        [105.0, 135.001],
    );
}

/// Two discs with a gap that is too small for the robot.
#[test]
fn a_robot_that_does_not_fit_through_stays_before() {
    let gap = vec![disc(150.0, 84.0, 12.0), disc(150.0, 116.0, 12.0)];
    let at = end(gap, [100.0, 100.0], 0.0, 100);
    assert!(at[0] < 150.0 && at[0] > 138.0, "{at:?}");
}

#[test]
fn a_robot_shut_in_by_the_wall_leaves_along_it() {
    // The disc extends beyond the wall, so pushes by the disc and by the wall would alternate for ever.
    let start = end(vec![disc(5.0, 100.0, 40.0)], [6.0, 100.0], PI, 1);
    assert!(
        (start[0] - 5.0).hypot(start[1] - 100.0) >= 45.0 && start[0] >= 6.0,
        "{start:?}"
    );
}

fn ray_that_sees_obstacles(half_angle: f64, range: Option<f64>, angle: f64) -> Sensor {
    Sensor::try_from(SensorDescription {
        angle: SensorAngle::fixed(angle).unwrap(),
        half_angle,
        range,
        sees: vec![Seen::Obstacles],
        wall_range: None,
    })
    .unwrap()
}

/// Whether a robot at (100, 100) that heads along x sees the obstacle.
fn sees(sensor: Sensor, obstacle: v1::Obstacle) -> bool {
    let robot = Robot::new(vec![sensor], 5.0, Drive::unicycle(1.0, 1.0).unwrap()).unwrap();
    let controller = Controller::new(CapabilityModel::of_one(robot).unwrap(), &[0.0; 4]).unwrap();
    let world = with(vec![obstacle], Boundary::Walls, square(200.0, 1));
    let start = Start::at(vec![[100.0, 100.0, 0.0]]).unwrap();
    let mut swarm = Swarm::new(&controller, &world, &start).unwrap();
    let before = swarm.readings();
    swarm.step();
    assert_eq!(swarm.agents().next().unwrap().sensed, before[0]);
    before[0] == 1
}

#[test]
fn a_ray_sees_the_edges_and_corners_of_a_box_within_its_range() {
    let ray = |range, angle| ray_that_sees_obstacles(0.0, range, angle);
    // This box has a side at x = 130, from y = 90 to 110.
    let side = rectangle(140.0, 100.0, 20.0, 20.0);
    assert!(sees(ray(None, 0.0), side) && !sees(ray(None, PI), side));
    assert!(sees(ray(Some(30.0), 0.0), side) && !sees(ray(Some(29.999), 0.0), side));
    // The corners of this side lie atan(10 / 30) above and below the robot's heading.
    let corner = (10.0_f64 / 30.0).atan();
    for sign in [-1.0, 1.0] {
        assert!(sees(ray(None, sign * (corner - 1e-6)), side));
        assert!(!sees(ray(None, sign * (corner + 1e-6)), side));
    }
    let far = 30.0_f64.hypot(10.0);
    assert!(sees(ray(Some(far), corner - 1e-6), side) && !sees(ray(Some(far - 0.01), corner - 1e-6), side));
    // A ray along the diagonal sees a corner of this box; a ray along an axis passes by the box.
    let diagonal = rectangle(140.0, 140.0, 20.0, 20.0);
    assert!(sees(ray(None, FRAC_PI_4), diagonal) && !sees(ray(None, 0.0), diagonal));
    assert!(!sees(
        ray(Some(30.0 * f64::sqrt(2.0) - 0.01), FRAC_PI_4),
        diagonal
    ));
}

#[test]
fn a_cone_sees_what_lies_in_it_or_meets_its_edge() {
    let cone = |half, range| ray_that_sees_obstacles(half, range, 0.0);
    let side = rectangle(140.0, 140.0, 20.0, 20.0);
    // The corner that is seen at the smallest angle is at (50, 30) from the robot.
    let least = (30.0_f64 / 50.0).atan();
    assert!(sees(cone(least + 1e-6, None), side) && !sees(cone(least - 1e-6, None), side));
    // The whole box is between the edges of the cone: its nearest point, the corner at (30, 30), decides.
    let corner = 30.0 * f64::sqrt(2.0);
    assert!(sees(cone(1.5, Some(corner + 0.01)), side) && !sees(cone(1.5, Some(corner - 0.01)), side));
    // A wide cone does not see a box behind the robot; a cone all around does.
    let behind = rectangle(60.0, 100.0, 20.0, 20.0);
    assert!(!sees(cone(2.0, None), behind) && sees(cone(PI, Some(30.0)), behind));
}

#[test]
fn a_disc_is_seen_as_a_robot_is_up_to_its_nearest_point() {
    let ray = |range, angle| ray_that_sees_obstacles(0.0, range, angle);
    let round = disc(150.0, 100.0, 20.0);
    assert!(sees(ray(Some(30.0), 0.0), round) && !sees(ray(Some(29.999), 0.0), round));
    let tangent = (20.0_f64 / 50.0).asin();
    assert!(sees(ray(None, tangent - 1e-6), round) && !sees(ray(None, tangent + 1e-6), round));
    assert!(!sees(ray(None, PI), round));
}

#[test]
fn robots_are_seen_through_obstacles() {
    let world = with(
        vec![rectangle(100.0, 100.0, 20.0, 90.0)],
        Boundary::Walls,
        square(200.0, 2),
    );
    let start = Start::at(vec![[50.0, 100.0, 0.0], [150.0, 100.0, 0.0]]).unwrap();
    let swarm = Swarm::new(&single([0.0; 4]), &world, &start).unwrap();
    assert_eq!(swarm.readings(), [1, 0]);
}
