//! Repeats one fixed piece of work a given number of times; `scripts/instruction-counts` counts its instructions.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]

use murmuration_train::bench::Steps;
use std::env;

/// Number of anchors of a step. With an eighth of the default, valgrind takes only seconds.
const ANCHORS: usize = 32;

/// Usage: `fixed_work training-step TIMES`. Without arguments, as `cargo bench` runs it, TIMES is 1.
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
    // The pool has one thread, because waiting threads execute instructions too.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| (0..times).for_each(|_| steps.step()));
}
