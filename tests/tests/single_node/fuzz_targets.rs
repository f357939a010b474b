//! Runs the targets of `make fuzz` on valid inputs and on mutations of these inputs. No parser of outside input may panic.

use murmuration_tests::fuzz_targets::{EDGES, dice, mutated};
use rand::RngExt as _;

/// Number of mutations for each parser.
const MUTATIONS: u64 = 20_000;

#[test]
fn whatever_comes_in_is_taken_or_refused() {
    for (number, edge) in (0..).zip(EDGES) {
        let seeds = (edge.seeds)();
        assert!(!seeds.is_empty(), "{}", edge.name);
        for seed in &seeds {
            (edge.parse)(seed);
        }
        let mut dice = dice(number);
        for _ in 0..MUTATIONS {
            let seed = &seeds[dice.random_range(0..seeds.len())];
            (edge.parse)(&mutated(seed, &mut dice));
        }
    }
}
