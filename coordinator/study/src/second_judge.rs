//! The second judge: classifies a behaviour by what it learned from labelled behaviours.
//!
//! The second judge sees the same paths as the rule-based judge, but shares no code, measure or threshold with that judge or with
//! an embedder. If both judges agree, they agree from different evidence. `scripts/second-judge` grows the second judge's
//! decision trees; docs/judge.md documents how often the second judge agrees with the annotators of the labelled sets.

mod canvas;
mod forest;
mod measures;
mod paths;
mod statistics;

use murmuration_swarm::{Class, Replay, World};
use paths::Paths;

/// The second judge's class of the last 160 steps of a motion in `world`. Every fourth step of the motion is enough.
///
/// A pure function. A swarm of 24 robots takes about half a millisecond; the time grows with the square of the number of robots.
/// The function never returns a class that has no meaning in `world`.
#[must_use]
pub fn second_judge(motion: &Replay, world: &World) -> Class {
    second_judge_by(&second_judge_measures(motion, world), world)
}

/// The second judge's class of a motion in `world` with these measures.
#[must_use]
pub fn second_judge_by(measures: &[f64], world: &World) -> Class {
    forest::class(measures, world)
}

/// Measures of the end of a motion in `world`, to train the second judge: always the same number of measures, all finite.
#[must_use]
pub fn second_judge_measures(motion: &Replay, world: &World) -> Vec<f64> {
    measures::measures(&Paths::of(motion, world))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::v1;
    use std::f64::consts::TAU;

    /// A motion of this many robots over 160 steps, each on its own path.
    fn motion(robots: u32, path: impl Fn(f64, f64) -> [f64; 2]) -> Replay {
        let at = |step: u32, robot: u32| {
            let [x, y] = path(f64::from(robot), f64::from(step));
            [x as f32, y as f32, 0.0]
        };
        let poses = (0..=160).flat_map(|step| (0..robots).map(move |robot| at(step, robot)));
        Replay::new((0..=160).collect(), robots as usize, poses.collect()).unwrap()
    }

    fn on_circle(centre: [f64; 2], radius: f64, turns: f64) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(turns * TAU);
        [centre[0] + radius * cosine, centre[1] + radius * sine]
    }

    fn on_grid(robot: f64, spacing: f64) -> [f64; 2] {
        [
            70.0 + spacing * (robot % 5.0),
            70.0 + spacing * (robot / 5.0).floor(),
        ]
    }

    fn along_the_border(robot: f64, step: f64) -> [f64; 2] {
        let way = (robot * 76.0 + step) % 1840.0;
        let (side, along) = ((way / 460.0).floor(), 20.0 + way % 460.0);
        let corners = [
            [along, 20.0],
            [480.0, along],
            [500.0 - along, 480.0],
            [20.0, 500.0 - along],
        ];
        corners[side as usize]
    }

    fn ring(robot: f64, step: f64) -> [f64; 2] {
        on_circle([250.0; 2], 120.0, robot / 24.0 + step / 700.0)
    }

    fn world(boundary: &str) -> World {
        World::try_from(v1::World {
            boundary: Some(boundary.to_owned()),
            ..v1::World::default()
        })
        .unwrap()
    }

    #[track_caller]
    fn check(class: Class, path: impl Fn(f64, f64) -> [f64; 2]) {
        assert_eq!(second_judge(&motion(24, path), &World::default()), class);
    }

    /// The test leaves milling out: the second judge calls a disc that turns like a rigid wheel a concave path, because no
    /// labelled swarm turns like that.
    #[test]
    fn textbook_examples_are_known() {
        check(Class::CyclicPursuit, ring);
        check(Class::NestedCycle, |robot, step| match robot < 18.0 {
            true => on_circle([250.0; 2], 120.0, robot / 18.0 + step / 700.0),
            false => on_circle([250.0; 2], 40.0, robot / 6.0 + step / 240.0),
        });
        check(Class::Aggregation, |robot, _| on_grid(robot, 10.0));
        check(Class::Dispersal, |robot, _| on_grid(robot, 90.0));
        check(Class::WallFollowing, along_the_border);
    }

    #[test]
    fn the_order_of_robots_reflections_and_quarter_turns_change_little() {
        let world = World::default();
        let path =
            |robot: f64, step: f64| on_circle([230.0, 270.0], 60.0 + 3.0 * robot, robot / 9.0 + step / 500.0);
        let measured = |path: &dyn Fn(f64, f64) -> [f64; 2]| second_judge_measures(&motion(24, path), &world);
        let before = measured(&path);
        let others: [&dyn Fn(f64, f64) -> [f64; 2]; 3] = [
            &|robot, step| path(23.0 - robot, step),
            &|robot, step| path(robot, step).map(|along| 500.0 - along),
            &|robot, step| {
                let [x, y] = path(robot, step);
                [y, 500.0 - x]
            },
        ];
        for other in others {
            for (place, (one, other)) in before.iter().zip(measured(other)).enumerate() {
                assert!(
                    (one - other).abs() < 0.1 * (1.0 + one.abs()),
                    "{place}: {one} {other}"
                );
            }
        }
    }

    #[test]
    fn on_a_torus_a_swarm_across_the_edges_is_judged_as_one_in_the_middle() {
        let across = |robot: f64, step: f64| {
            let [x, y] = ring(robot, step);
            [(x + 240.0) % 500.0, (y + 245.0) % 500.0]
        };
        let torus = world("torus");
        assert_eq!(second_judge(&motion(24, across), &torus), Class::CyclicPursuit);
        assert_eq!(second_judge(&motion(24, ring), &torus), Class::CyclicPursuit);
        assert_ne!(
            second_judge(&motion(24, across), &World::default()),
            Class::CyclicPursuit
        );
    }

    #[test]
    fn a_class_without_meaning_is_never_the_answer() {
        for boundary in ["open", "torus"] {
            let class = second_judge(&motion(24, along_the_border), &world(boundary));
            assert_ne!(class, Class::WallFollowing);
        }
        let one = World::try_from(v1::World {
            agents: Some(1),
            ..v1::World::default()
        });
        assert_eq!(second_judge(&motion(1, ring), &one.unwrap()), Class::Random);
    }

    #[test]
    fn whatever_moves_or_stands_anywhere_has_measures() {
        let far = |robot: f64, step: f64| [1e6 * robot - 1e7, 1e5 * step];
        let still = |_, _| [100.0, 100.0];
        for world in [World::default(), world("open"), world("torus")] {
            for motion in [
                motion(24, far),
                motion(24, still),
                motion(2, ring),
                motion(1, still),
            ] {
                let measures = second_judge_measures(&motion, &world);
                assert_eq!(measures.len(), measures::MEASURES);
                assert!(measures.iter().all(|measure| measure.is_finite()), "{measures:?}");
            }
        }
        let start_alone = Replay::new(vec![0], 1, vec![[3.0, 4.0, 0.0]]).unwrap();
        assert_eq!(
            second_judge_measures(&start_alone, &World::default()).len(),
            measures::MEASURES
        );
    }
}
