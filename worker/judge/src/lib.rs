//! The judge: names the class of a behaviour from its motion, by rules that people can read.
//!
//! The judge sees what annotators see: the paths of the last 160 steps, and the ends of these paths. The judge uses no embeddings
//! or features. [`Measures`] are geometry and kinematics in units of the bodies and the arena. [`Measures::class`] is the list of
//! rules. `murmuration lab judge` and `tests/tests/single_node/judge.rs` measure the judge's agreement with labels.

mod arrangement;
mod body;
mod geometry;
#[cfg(test)]
mod hand_made;
#[cfg(test)]
mod hand_made_species;
mod motion;
mod nearby;
mod rules;
mod species;
mod walls;
mod window;

pub use arrangement::Arrangement;
pub use body::Body;
pub use motion::Motion;
pub use species::{Against, Alone, Pair};
pub use walls::Walls;

use murmuration_swarm::{Class, Frames, Replay, Verdict, World};
use std::num::NonZeroU32;
use window::Window;

/// Minimum number of robots of a swarm that reports and pages let the judge name: the classes describe groups.
pub const FEWEST_ROBOTS: u32 = 3;
/// Steps between two frames of the judge's window.
pub const STRIDE: NonZeroU32 = window::STRIDE;
/// Number of frames of the judge's window, the first and the last included.
pub const WINDOW_FRAMES: usize = window::STRETCHES as usize + 1;

/// The frames of a motion in `world` that the judge needs: every fourth of the last 160 steps.
#[must_use]
pub fn frames(world: &World) -> Frames {
    Frames::of_end(window::WINDOW_STEPS, window::STRIDE, world)
}

/// Judges the end of a motion in `world`: its last 160 steps. A replay with every fourth of these steps is enough.
///
/// This function is pure. Judging 24 agents takes a few tenths of a millisecond. The time grows with the square of the number of
/// agents.
#[must_use]
pub fn judge(replay: &Replay, world: &World) -> Verdict {
    judge_species(replay, &[], world)
}

/// Judges the end of a motion of several species in `world`, as [`judge`] does. `species` has the place of each robot's species, in
/// index order.
///
/// A pattern that both species form together ([`Pair::joint_pattern`]) is the verdict, whatever the class of the whole swarm. Only
/// if the swarm follows walls, and one of the species has hardly any robots, the class stands. A ring of one species
/// ([`Pair::has_own_ring`]) is the verdict if the class of the whole swarm is random, milling or wall following, because some rings
/// beside robots that move or stand at the walls pass for these. A swarm that is not of two species gets the verdict of [`judge`].
#[must_use]
pub fn judge_species(replay: &Replay, species: &[usize], world: &World) -> Verdict {
    let window = Window::of(replay, world);
    let measures = Measures::of_window(&window, world, &Scale::of(world));
    let class = measures.class(world);
    let of_two = Pair::of(&window, species, world).and_then(|pair| pair.pattern(class, world));
    let pattern = of_two.or_else(|| measures.pattern().filter(|_| class == Class::Random));
    pattern.map_or(Verdict::Class(class), Verdict::Pattern)
}

/// Measures of the last 160 steps of a swarm. All measures are 0 or more; lengths are in the units of [`Scale`].
#[derive(Debug, Clone, PartialEq)]
pub struct Measures {
    pub arrangement: Arrangement,
    pub motion: Motion,
    pub body: Body,
    pub walls: Walls,
}

impl Measures {
    /// Measures the end of a replay. The time grows with the square of the number of agents.
    #[must_use]
    pub fn of(replay: &Replay, world: &World) -> Self {
        Self::of_window(&Window::of(replay, world), world, &Scale::of(world))
    }

    fn of_window(window: &Window, world: &World, scale: &Scale) -> Self {
        let (motion, shared) = Motion::of(window, scale);
        Self {
            arrangement: Arrangement::of(window, scale),
            body: Body::of(window, &shared),
            walls: Walls::of(window, world, scale),
            motion,
        }
    }
}

/// The units of length, in world units.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scale {
    pub radius: f64,
    /// Radius of a disc with the total area of the bodies: body radius times the square root of their number.
    pub packed: f64,
    /// Distance between neighbours if the agents were on a square grid over the whole arena.
    pub spacing: f64,
}

impl Scale {
    #[must_use]
    pub fn of(world: &World) -> Self {
        Self::of_robots(world, world.agents() as usize)
    }

    /// The units for `robots` of the robots in `world`.
    fn of_robots(world: &World, robots: usize) -> Self {
        let agents = robots as f64;
        let sides = [world.width(), world.height()].map(|side| side - 2.0 * world.margin());
        Self {
            radius: world.radius(),
            packed: world.radius() * agents.sqrt(),
            // If the walls leave no room to move, a side counts as one body's radius.
            spacing: (sides.map(|side| side.max(world.radius())).iter().product::<f64>() / agents).sqrt(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::v1;
    use murmuration_swarm::Pattern;
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
        let (motion, world) = (motion(path), World::default());
        assert_eq!(
            judge(&motion, &world).class(),
            class,
            "{:#?}",
            Measures::of(&motion, &world)
        );
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
        assert_eq!(verdict, Verdict::Pattern(Pattern::SmallClusters));
    }

    fn world(boundary: &str) -> World {
        World::try_from(v1::World {
            boundary: Some(boundary.to_owned()),
            ..v1::World::default()
        })
        .unwrap()
    }

    #[test]
    fn on_a_torus_a_swarm_across_the_edges_is_judged_as_one_in_the_middle() {
        let wrapped = |[x, y]: [f64; 2]| [x.rem_euclid(500.0), y.rem_euclid(500.0)];
        let ring =
            |agent: f64, step: f64| wrapped(on_circle([10.0, 495.0], 120.0, agent / 24.0 + step / 700.0));
        let clump =
            |agent: f64, _| wrapped([490.0 + 10.0 * (agent % 5.0), 10.0 * (agent / 5.0).floor() - 20.0]);
        let travelling = |agent: f64, step: f64| {
            let [x, y] = on_grid(agent, 10.0);
            wrapped([x + 3.0 * step, y])
        };
        let torus = world("torus");
        assert_eq!(judge(&motion(ring), &torus).class(), Class::CyclicPursuit);
        assert_eq!(judge(&motion(clump), &torus).class(), Class::Aggregation);
        assert_eq!(judge(&motion(travelling), &torus).class(), Class::Aggregation);
        assert_ne!(
            judge(&motion(ring), &World::default()).class(),
            Class::CyclicPursuit
        );
    }

    #[test]
    fn a_class_without_meaning_is_never_the_answer() {
        let along_the_border = |agent: f64, step: f64| {
            let way = (agent * 76.0 + step) % 1840.0;
            let (side, along) = ((way / 460.0).floor(), 20.0 + way % 460.0);
            let corners = [
                [along, 20.0],
                [480.0, along],
                [500.0 - along, 480.0],
                [20.0, 500.0 - along],
            ];
            corners[side as usize]
        };
        assert_eq!(
            judge(&motion(along_the_border), &World::default()).class(),
            Class::WallFollowing
        );
        for boundary in ["open", "torus"] {
            let verdict = judge(&motion(along_the_border), &world(boundary));
            assert_ne!(verdict.class(), Class::WallFollowing);
            assert!(Class::WallFollowing.without_meaning(&world(boundary)).is_some());
        }
        let one = World::try_from(v1::World {
            agents: Some(1),
            ..v1::World::default()
        });
        let alone = Replay::new(vec![0, 1200], 1, vec![[250.0, 250.0, 0.0]; 2]).unwrap();
        assert_eq!(judge(&alone, &one.unwrap()).class(), Class::Random);
    }

    #[test]
    fn what_does_not_move_or_is_alone_is_judged_too() {
        check(Class::Aggregation, |_, _| [100.0, 100.0]);
        check(Class::Random, |agent, _| [20.0 + 19.0 * agent, 20.0]);
        let alone = Replay::new(vec![0, 1200], 1, vec![[30.0, 30.0, 0.0]; 2]).unwrap();
        let measures = Measures::of(&alone, &World::default());
        assert_eq!(measures.arrangement.clusters, [1]);
    }
}
