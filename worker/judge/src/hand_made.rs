//! Synthetic motions with known classes. The judge must name these classes at any size and speed, even where a labelled set has
//! no examples.

use super::judge;
use murmuration_proto::v1;
use murmuration_swarm::{Class, Replay, World};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// Steps between two frames.
const STRIDE: u32 = 4;
/// Distance between the centres of two touching robots, world units.
const TOUCHING: f64 = 10.0;
pub(super) const MIDDLE: f64 = 250.0;

/// The judge's class of a swarm in the paper's world. Agent `a` is at `path(a, step)` in each of the last 160 steps.
fn class_of(agents: u32, path: impl Fn(u32, f64) -> [f64; 2]) -> Class {
    let world = World::try_from(v1::World {
        agents: Some(agents),
        ..v1::World::default()
    });
    let steps: Vec<u32> = (0..=160).step_by(STRIDE as usize).collect();
    let pose = |step: u32, agent: u32| {
        let [x, y] = path(agent, f64::from(step));
        [x as f32, y as f32, 0.0]
    };
    let poses = steps
        .iter()
        .flat_map(|&step| (0..agents).map(move |agent| pose(step, agent)))
        .collect();
    let motion = Replay::new(steps, agents as usize, poses).unwrap();
    judge(&motion, &world.unwrap()).class()
}

pub(super) fn on_circle([x, y]: [f64; 2], radius: f64, turns: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(turns * TAU);
    [x + radius * cosine, y + radius * sine]
}

/// The radius of a ring of this many touching robots.
pub(super) fn tight(agents: u32) -> f64 {
    f64::from(agents) * TOUCHING / TAU
}

/// A rotating swarm: its centre, and the length of the arc that an agent moves in a step, signed by direction.
pub(super) fn turning() -> impl Strategy<Value = ([f64; 2], f64)> {
    let middle = MIDDLE - 30.0..MIDDLE + 30.0_f64;
    let speed = prop_oneof![-1.9..-0.3_f64, 0.3..1.9_f64];
    ([middle.clone(), middle], speed)
}

/// Places of agents in a packed clump: the places of a triangular lattice that are nearest to its centre.
pub(super) fn packed(agents: u32, spacing: f64) -> Vec<[f64; 2]> {
    let places = (-12..=12).flat_map(|row: i32| {
        (-12..=12).map(move |column: i32| {
            let shift = f64::from(row.rem_euclid(2)) / 2.0;
            let [x, y] = [f64::from(column) + shift, f64::from(row) * 0.75_f64.sqrt()];
            [x * spacing, y * spacing]
        })
    });
    let mut places: Vec<[f64; 2]> = places.collect();
    places.sort_by(|a, b| (a[0].hypot(a[1])).total_cmp(&b[0].hypot(b[1])));
    places.truncate(agents as usize);
    places
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn an_exact_ring_is_a_cyclic_pursuit(
        agents in 8_u32..=48,
        room in 1.05..4.0_f64,
        (middle, speed) in turning(),
    ) {
        let radius = (tight(agents) * room).min(170.0);
        let turns = speed / (TAU * radius);
        let class = class_of(agents, |agent, step| {
            on_circle(middle, radius, f64::from(agent) / f64::from(agents) + turns * step)
        });
        prop_assert_eq!(class, Class::CyclicPursuit);
    }

    #[test]
    fn a_ring_in_a_ring_is_a_nested_cycle(
        outer in 14_u32..=36,
        inner in 3_u32..=10,
        part in 0.15..0.55_f64,
        (middle, speed) in turning(),
    ) {
        let radius = (tight(outer) * 1.5).clamp(90.0, 170.0);
        let inside = (radius * part).max(tight(inner) * 1.1).min(0.55 * radius);
        let class = class_of(outer + inner, |agent, step| match agent.checked_sub(outer) {
            None => on_circle(middle, radius, f64::from(agent) / f64::from(outer) + speed / (TAU * radius) * step),
            Some(place) => {
                let turns = speed / (TAU * inside);
                on_circle(middle, inside, f64::from(place) / f64::from(inner) + turns * step)
            }
        });
        prop_assert_eq!(class, Class::NestedCycle);
    }

    #[test]
    fn robots_that_touch_and_hardly_move_are_an_aggregation(
        agents in 6_u32..=60,
        room in 1.0..1.15_f64,
        x in 120.0..380.0_f64,
        y in 120.0..380.0_f64,
        drift in -0.2..0.2_f64,
    ) {
        let places = packed(agents, TOUCHING * room);
        let class = class_of(agents, |agent, step| {
            let [right, up] = places[agent as usize];
            [x + right + drift * step, y + up]
        });
        prop_assert_eq!(class, Class::Aggregation);
    }

    #[test]
    fn an_even_spread_of_robots_that_stay_is_a_dispersal(
        side in 4_u32..=6,
        fill in 0.75..1.0_f64,
        circle in 0.0..12.0_f64,
        turns in -1.5..1.5_f64,
    ) {
        let spacing = 420.0 * fill / f64::from(side - 1);
        let first = MIDDLE - spacing * f64::from(side - 1) / 2.0;
        let class = class_of(side * side, |agent, step| {
            let home = [agent % side, agent / side].map(|place| first + spacing * f64::from(place));
            on_circle(home, circle, turns * step / 160.0)
        });
        prop_assert_eq!(class, Class::Dispersal);
    }

    #[test]
    fn a_stream_along_the_border_is_wall_following(agents in 8_u32..=48, speed in 0.5..1.9_f64, reverse in any::<bool>()) {
        const SIDE: f64 = 460.0;
        let class = class_of(agents, |agent, step| {
            let way = f64::from(agent) * 4.0 * SIDE / f64::from(agents) + speed * step;
            let way = if reverse { -way } else { way }.rem_euclid(4.0 * SIDE);
            let (side, along) = ((way / SIDE).floor() as usize, 20.0 + way % SIDE);
            let corners = [[along, 20.0], [480.0, along], [500.0 - along, 480.0], [20.0, 500.0 - along]];
            corners[side.min(3)]
        });
        prop_assert_eq!(class, Class::WallFollowing);
    }

    #[test]
    fn a_disc_that_turns_as_a_whole_is_milling(
        agents in 16_u32..=40,
        density in 0.04..0.1_f64,
        turns in prop_oneof![-0.9..-0.25_f64, 0.25..0.9_f64],
    ) {
        // The golden angle spreads places evenly over a disc.
        let radius = tight(agents).max(TOUCHING / 2.0 * (f64::from(agents) / density).sqrt());
        let class = class_of(agents, |agent, step| {
            let from_middle = radius * ((f64::from(agent) + 0.5) / f64::from(agents)).sqrt();
            on_circle([MIDDLE; 2], from_middle, f64::from(agent) * 0.381_966 + turns * step / 160.0)
        });
        prop_assert_eq!(class, Class::Milling);
    }
}
