//! Synthetic motions of two species with known patterns, and mixtures of two species without a pattern.

use super::{
    hand_made::{MIDDLE, on_circle, packed, tight, turning},
    judge_species,
};
use murmuration_proto::v1;
use murmuration_swarm::{Pattern, Purpose, RandomStream, Replay, Verdict, World};
use proptest::prelude::*;
use std::f64::consts::TAU;

/// The judge's verdict on a swarm of two species in the paper's world. In each of the last 160 steps, robot `place` of a species is
/// at `path(species, place, step)`.
fn verdict(robots: [u32; 2], path: impl Fn(usize, u32, f64) -> [f64; 2]) -> Verdict {
    let of = |species: usize| (0..robots[species]).map(move |place| (species, place));
    let robots: Vec<(usize, u32)> = of(0).chain(of(1)).collect();
    let world = World::try_from(v1::World {
        agents: Some(robots.len() as u32),
        ..v1::World::default()
    });
    let steps: Vec<u32> = (0..=160).step_by(4).collect();
    let poses = steps.iter().flat_map(|&step| {
        let at = |&(species, place): &(usize, u32)| {
            let [x, y] = path(species, place, f64::from(step));
            [x as f32, y as f32, 0.0]
        };
        robots.iter().map(at).collect::<Vec<_>>()
    });
    let motion = Replay::new(steps.clone(), robots.len(), poses.collect()).unwrap();
    let species: Vec<usize> = robots.iter().map(|&(species, _)| species).collect();
    judge_species(&motion, &species, &world.unwrap())
}

/// Place of a robot on an exact ring of `robots` at `step`, if it moves `speed` per step.
fn on_ring(middle: [f64; 2], radius: f64, robots: u32, place: u32, way: f64) -> [f64; 2] {
    let turns = f64::from(place) / f64::from(robots) + way / (TAU * radius);
    on_circle(middle, radius, turns)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn a_ring_around_a_clump_of_the_other_species_is_a_containment(
        outer in 12_u32..=24,
        inner in 1_u32..=10,
        room in 1.0..1.8_f64,
        radius in 75.0..150.0_f64,
        (middle, speed) in turning(),
        is_first in any::<bool>(),
    ) {
        let places = packed(inner, 10.0 * room);
        let robots = if is_first { [outer, inner] } else { [inner, outer] };
        let verdict = verdict(robots, |species, place, step| match (species == 0) == is_first {
            true => on_ring(middle, radius, outer, place, speed * step),
            false => [0, 1].map(|axis| middle[axis] + 10.0 + places[place as usize][axis]),
        });
        prop_assert_eq!(verdict, Verdict::Pattern(Pattern::Containment));
    }

    #[test]
    fn a_ring_in_a_ring_of_the_other_species_is_embedded_cycles(
        outer in 10_u32..=24,
        inner in 4_u32..=10,
        part in 0.3..0.65_f64,
        (middle, speed) in turning(),
        sense in prop_oneof![Just(1.0_f64), Just(-1.0)],
    ) {
        let radius = (tight(outer) * 1.5).clamp(90.0, 150.0);
        let inside = radius * part;
        // A robot that goes less than a sixteenth of a turn in the window does not visibly turn.
        let way = (speed.abs().max(radius * TAU / 16.0 / 160.0)) * speed.signum();
        let verdict = verdict([outer, inner], |species, place, step| match species {
            0 => on_ring(middle, radius, outer, place, way * step),
            _ => on_ring(middle, inside, inner, place, way * sense * step),
        });
        prop_assert_eq!(verdict, Verdict::Pattern(Pattern::EmbeddedCycles));
    }

    #[test]
    fn two_species_on_one_circle_are_a_two_coloured_mill(
        robots in (6_u32..=16, 6_u32..=16),
        part in 0.8..1.0_f64,
        radius in 60.0..150.0_f64,
        middle in [220.0..280.0_f64, 220.0..280.0_f64],
        turns in prop_oneof![-0.9..-0.1_f64, 0.1..0.9_f64],
    ) {
        let verdict = verdict([robots.0, robots.1], |species, place, step| {
            let (robots, radius) = if species == 0 { (robots.0, radius) } else { (robots.1, radius * part) };
            let first = (f64::from(place) + 0.25 * species as f64) / f64::from(robots);
            on_circle(middle, radius, first + turns * step / 160.0)
        });
        prop_assert_eq!(verdict, Verdict::Pattern(Pattern::TwoColouredMill));
    }

    #[test]
    fn a_ring_beside_the_other_species_is_an_own_ring(
        ring in 6_u32..=14,
        others in 6_u32..=14,
        room in 1.1..2.0_f64,
        turns in prop_oneof![-2.0..-0.2_f64, 0.2..2.0_f64],
    ) {
        let radius = tight(ring) * room;
        let verdict = verdict([others, ring], |species, place, step| match species {
            0 => [485.0, 480.0 - 30.0 * f64::from(place)],
            _ => on_circle([150.0, 250.0], radius, f64::from(place) / f64::from(ring) + turns * step / 160.0),
        });
        prop_assert_eq!(verdict, Verdict::Pattern(Pattern::OwnRing));
    }
}

/// Number of mixtures of two species at random that get each pattern of two species.
fn found_in_mixtures(mixtures: u64, path: impl Fn(&mut RandomStream) -> [f64; 4]) -> Vec<(u64, Verdict)> {
    let mixture = |seed: u64| {
        let mut random = RandomStream::derive(seed, Purpose::Start, 0);
        let robots = [random.random_range(3..=12), random.random_range(8..=21)];
        let paths: Vec<[f64; 4]> = (0..robots[0] + robots[1]).map(|_| path(&mut random)).collect();
        let verdict = verdict(robots, |species, place, step| {
            let [x, y, radius, turns] = paths[(place + if species == 0 { 0 } else { robots[0] }) as usize];
            on_circle([x, y], radius, x + turns * step / 160.0).map(|place| place.clamp(20.0, 480.0))
        });
        (seed, verdict)
    };
    let is_of_two = |verdict: &Verdict| verdict.pattern().is_some_and(Pattern::is_of_two_species);
    (0..mixtures)
        .map(mixture)
        .filter(|(_, verdict)| is_of_two(verdict))
        .collect()
}

#[test]
fn random_mixtures_have_no_pattern_of_two_species() {
    let standing = |random: &mut RandomStream| {
        [
            random.random_range(20.0..480.0),
            random.random_range(20.0..480.0),
            0.0,
            0.0,
        ]
    };
    let in_a_disc = |random: &mut RandomStream| {
        let (angle, from_middle) = (
            random.random_range(0.0..1.0_f64),
            150.0 * random.random::<f64>().sqrt(),
        );
        let [x, y] = on_circle([MIDDLE; 2], from_middle, angle);
        [
            x,
            y,
            10.0 * random.random_range(0.0..1.0_f64),
            random.random_range(-1.0..1.0),
        ]
    };
    let circling = |random: &mut RandomStream| {
        let [x, y] = [0; 2].map(|_| random.random_range(40.0..460.0));
        [
            x,
            y,
            random.random_range(5.0..120.0),
            random.random_range(-1.5..1.5),
        ]
    };
    assert_eq!(found_in_mixtures(300, standing), []);
    assert_eq!(found_in_mixtures(300, in_a_disc), []);
    assert_eq!(found_in_mixtures(300, circling), []);
}
