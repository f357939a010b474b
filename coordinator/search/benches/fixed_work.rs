//! Fixed work for `scripts/instruction-counts`, which counts instructions: one item of work, a given number of times.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]

mod archive;

use archive::archive;
use murmuration_search::{interrupt::Interrupt, novelty::Index};
use std::{env, hint::black_box};

/// Individuals before and after the counted generations.
const ARCHIVE: [usize; 2] = [4_000, 5_000];
/// Individuals per generation in the paper.
const GENERATION: usize = 100;
/// Default number of neighbours of a campaign.
const NEIGHBOURS: usize = 15;

/// Usage: `fixed_work novelty TIMES`. Without arguments, as `cargo bench` runs it, TIMES is 1.
fn main() {
    let arguments: Vec<_> = env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with('-'))
        .collect();
    let times = match arguments.as_slice() {
        [item, times] if item == "novelty" => times.parse().unwrap(),
        [item, ..] => unreachable!("{item} is no item"),
        [] => 1,
    };
    // The work runs on one thread, because waiting threads execute instructions too.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    pool.install(|| novelty(times));
}

/// Measures the novelty of successive generations while the archive grows, as a campaign does.
fn novelty(times: u32) {
    let [before, after] = ARCHIVE;
    let all = archive(after);
    let first = all.among(&(0..before).collect::<Vec<_>>());
    let mut index = Index::new();
    index.extend(&first);
    for _ in 0..times {
        let (mut grown, mut index) = (first.clone(), index.clone());
        for start in (before..after).step_by(GENERATION) {
            let newest = start..start + GENERATION;
            for individual in newest.clone() {
                grown.push(all.point(individual).as_slice()).unwrap();
            }
            black_box(index.novelty(&grown, newest, NEIGHBOURS, &Interrupt::default())).unwrap();
        }
    }
}
