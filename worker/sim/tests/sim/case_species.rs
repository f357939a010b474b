//! Tests the judge on the worlds that the authors saved as behaviours of two species.

use murmuration_judge::{judge, judge_species};
use murmuration_sim::case::Case;
use murmuration_swarm::Verdict;
use std::{fs, num::NonZeroU32};

/// The judge's names of a saved world: without its species, and with them.
fn names(world: &str) -> [&'static str; 2] {
    let file = format!(
        "{}/../../tests/vectors/robots/{world}.feb2023.json",
        env!("CARGO_MANIFEST_DIR")
    );
    let case = Case::from_json(&fs::read_to_string(file).unwrap()).unwrap();
    let motion = case.replay(NonZeroU32::MIN).unwrap();
    let species = case.controller().species_of_robots(case.world().agents());
    let blind = judge(&motion, case.world());
    [blind, judge_species(&motion, &species, case.world())].map(Verdict::name)
}

#[track_caller]
fn check(world: &str, without_species: &str, with_species: &str) {
    assert_eq!(names(world), [without_species, with_species], "{world}");
}

#[test]
fn the_judge_names_what_the_species_of_saved_worlds_do() {
    check("containment_packed", "cyclic_pursuit", "containment");
    check("cyclone", "milling", "two_coloured_mill");
    // Most robots of one species circle near the ring of the other, on its inside.
    check("embedded_cycles", "milling", "containment");
    // One species is a ring in a corner, and the other stays elsewhere.
    check("engulfing_stored", "random", "own_ring");
    // Without the goal of the saved world, the leaders turn on the spot inside the ring of the followers.
    check("leader_follower_packed", "cyclic_pursuit", "containment");
    check("leader_follower_spread", "cyclic_pursuit", "containment");
    check("nucleus", "milling", "containment");
    check("world_9745", "nested_cycle", "embedded_cycles");
}

#[test]
fn species_change_nothing_where_no_pattern_of_two_species_is_seen() {
    // From spread starts, these two worlds do not become what they are named after within their time.
    let spread = ["containment_spread", "engulfing_spread", "world_9032"];
    let unnamed = [
        "genome_00",
        "genome_01",
        "genome_03",
        "genome_04",
        "genome_06",
        "mixed_00",
        "mixed_01",
        "mixed_04",
    ];
    for world in spread.into_iter().chain(unnamed) {
        let [without_species, with_species] = names(world);
        assert_eq!(without_species, with_species, "{world}");
    }
}
