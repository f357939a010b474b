//! Fixed work for `scripts/instruction-counts`, which counts its instructions: one item, so many times.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]

use murmuration_train::bench::Steps;
use std::env;

/// Anchors of a step: an eighth of the default, which valgrind gets through in seconds.
const ANCHORS: usize = 32;

/// Usage: `fixed_work training-step TIMES`; without arguments, as `cargo bench` runs it, one step.
fn main() {
    let arguments: Vec<_> = env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with('-'))
        .collect();
    let times = match arguments.as_slice() {
        [item, times] if item == "training-step" => times.parse().unwrap(),
        [item, ..] => unreachable!("{item} is no item"),
        [] => 1,
    };
    let mut steps = Steps::new(ANCHORS).unwrap();
    // One thread, because threads that wait for each other execute instructions too.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| (0..times).for_each(|_| steps.step()));
}
