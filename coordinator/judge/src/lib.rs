//! The judge: names the class of a behaviour from its motion, by rules that people can read.
//!
//! It sees what people are shown, the paths of the last 160 steps and where they end, and no embeddings or features.
//! [`Measures`] are geometry and kinematics in units of the bodies and the arena. [`Class::of`] is the list of rules.
//! `murmuration judge` and `tests/tests/single_node/judge.rs` measure its agreement with people.

mod arrangement;
mod body;
mod class;
mod geometry;
mod measures;
mod motion;
mod rules;
mod scale;
mod statistics;
mod walls;
mod window;

pub use arrangement::Arrangement;
pub use body::Body;
pub use class::{Class, Pattern};
pub use measures::Measures;
pub use motion::Motion;
pub use scale::Scale;
pub use walls::Walls;

use murmuration_proto::{Frames, Replay, World};

/// The judge's verdict on a motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// Its class.
    pub class: Class,
    /// Its pattern, if its class is [`Class::Random`] and it has one.
    pub pattern: Option<Pattern>,
    /// The measures.
    pub measures: Measures,
}

/// The frames of a motion in `world` that the judge needs: every fourth of its last 160 steps.
#[must_use]
pub fn frames(world: &World) -> Frames {
    Frames::of_end(window::WINDOW_STEPS, window::STRIDE, world)
}

/// Judges the end of a motion in `world`: its last 160 steps. Every fourth step is enough.
///
/// Pure. The cost grows with the square of the number of agents: 24 take some milliseconds.
#[must_use]
pub fn judge(replay: &Replay, world: &World) -> Verdict {
    let measures = Measures::of(replay, world);
    let class = Class::of(&measures);
    Verdict {
        class,
        pattern: (class == Class::Random).then(|| Pattern::of(&measures)).flatten(),
        measures,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// 24 agents of the paper's world over 160 steps, each on its own path.
    fn motion(path: impl Fn(f64, f64) -> [f64; 2]) -> Replay {
        let at = |step: u32, agent: u32| {
            let [x, y] = path(f64::from(agent), f64::from(step));
            [x as f32, y as f32, 0.0]
        };
        let poses = (0..=160).flat_map(|step| (0..24).map(move |agent| at(step, agent)));
        Replay::new((0..=160).collect(), 24, poses.collect()).unwrap()
    }

    fn on_circle(centre: [f64; 2], radius: f64, turns: f64) -> [f64; 2] {
        let (sine, cosine) = libm::sincos(turns * TAU);
        [centre[0] + radius * cosine, centre[1] + radius * sine]
    }

    fn on_grid(agent: f64, spacing: f64) -> [f64; 2] {
        [
            70.0 + spacing * (agent % 5.0),
            70.0 + spacing * (agent / 5.0).floor(),
        ]
    }

    #[track_caller]
    fn check(class: Class, path: impl Fn(f64, f64) -> [f64; 2]) {
        let verdict = judge(&motion(path), &World::default());
        assert_eq!(verdict.class, class, "{:#?}", verdict.measures);
    }

    #[test]
    fn textbook_examples_are_known() {
        let ring = |agent: f64, step: f64| on_circle([250.0; 2], 120.0, agent / 24.0 + step / 700.0);
        check(Class::CyclicPursuit, ring);
        check(Class::NestedCycle, |agent, step| {
            let radius = if agent < 20.0 { 120.0 } else { 30.0 };
            on_circle(
                [250.0; 2],
                radius,
                agent / if agent < 20.0 { 20.0 } else { 4.0 } + step / 700.0,
            )
        });
        check(Class::Aggregation, |agent, _| on_grid(agent, 10.0));
        check(Class::Dispersal, |agent, _| on_grid(agent, 90.0));
        check(Class::Dispersal, |agent, step| {
            on_circle(on_grid(agent, 90.0), 12.0, step / 100.0)
        });
        check(Class::Milling, |agent, step| {
            on_circle([250.0; 2], 20.0 + 4.0 * agent, agent * 0.382 + step / 250.0)
        });
        check(Class::WallFollowing, |agent, step| {
            let way = (agent * 76.0 + step) % 1840.0;
            let (side, along) = ((way / 460.0).floor(), 20.0 + way % 460.0);
            [
                [along, 20.0],
                [480.0, along],
                [500.0 - along, 480.0],
                [20.0, 500.0 - along],
            ][side as usize]
        });
        check(Class::Random, |agent, step| {
            on_circle([250.0; 2], 10.0 + step + agent, agent * 0.382)
        });
    }

    #[test]
    fn groups_are_a_pattern() {
        let groups = |agent: f64, _| {
            let [x, y] = [(agent % 4.0), (agent / 4.0).floor()];
            [100.0 + 150.0 * (y % 3.0) + 10.0 * x, 120.0 + 90.0 * y]
        };
        let verdict = judge(&motion(groups), &World::default());
        assert_eq!(
            (verdict.class, verdict.pattern),
            (Class::Random, Some(Pattern::SmallClusters))
        );
    }

    #[test]
    fn what_does_not_move_or_is_alone_is_judged_too() {
        check(Class::Aggregation, |_, _| [100.0, 100.0]);
        check(Class::Random, |agent, _| [20.0 + 19.0 * agent, 20.0]);
        let alone = Replay::new(vec![0, 1200], 1, vec![[30.0, 30.0, 0.0]; 2]).unwrap();
        let measures = judge(&alone, &World::default()).measures;
        assert_eq!(measures.arrangement.clusters, [1]);
    }
}
