//! Compares FasterPAM and k-medoids by samples in the same run: the losses and times of medoids of a whole archive, as for a
//! taxonomy.

#![expect(
    clippy::print_stdout,
    clippy::expect_used,
    reason = "a table is printed; nobody interrupts"
)]

mod archive;

use archive::{archive, skewed, uniform};
use criterion::{BenchmarkId, Criterion, criterion_group};
use murmuration_search::{
    interrupt::Interrupt,
    medoids::{Algorithm, Clustering, cluster_by},
    novelty::Behaviours,
};
use murmuration_swarm::{Purpose, RandomStream};
use std::{
    hint::black_box,
    time::{Duration, Instant},
};

/// Medoids of the paper's taxonomy.
const MEDOIDS: usize = 12;

/// Number of seeds that losses and times are averaged over, because each seed can find another local optimum.
const SEEDS: u64 = 3;

/// Generates an archive of the given number of behaviours.
type Shape = fn(usize) -> Behaviours;

fn find(algorithm: Algorithm, behaviours: &Behaviours, k: usize, seed: u64) -> Clustering {
    let mut stream = RandomStream::derive(seed, Purpose::Medoids, 0);
    let found = cluster_by(
        algorithm,
        behaviours,
        k,
        &mut stream,
        &Interrupt::default(),
        &|_| {},
    );
    found.expect("not interrupted")
}

fn medoids(c: &mut Criterion) {
    let mut group = c.benchmark_group("medoids");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    for (points, k) in [(1_000, 12), (10_000, 12), (10_000, 16)] {
        let behaviours = archive(points);
        for algorithm in [Algorithm::FasterPam, Algorithm::Sampled] {
            let case = BenchmarkId::new(format!("{algorithm:?}"), format!("{k} of {points}"));
            group.bench_function(case, |b| b.iter(|| find(algorithm, black_box(&behaviours), k, 1)));
        }
    }
}

/// Mean loss and mean time in seconds.
fn measure(algorithm: Algorithm, behaviours: &Behaviours) -> (f64, f64) {
    let begun = Instant::now();
    let losses = (0..SEEDS).map(|seed| find(algorithm, behaviours, MEDOIDS, seed).loss);
    let loss = losses.sum::<f64>() / SEEDS as f64;
    (loss, begun.elapsed().as_secs_f64() / SEEDS as f64)
}

/// Compares one run per seed, for archives that take too long to be clustered repeatedly by criterion.
fn compare() {
    println!("| points | shape | FasterPAM, s | sampled, s | time ratio | loss ratio |");
    println!("|--:|---|--:|--:|--:|--:|");
    let shapes = [
        ("clumps", archive as Shape),
        ("uniform", uniform),
        ("skewed", skewed),
    ];
    for points in [10_000, 30_000, 100_000, 1_000_000] {
        for (shape, behaviours) in shapes {
            let behaviours = behaviours(points);
            let (loss, seconds) = measure(Algorithm::Sampled, &behaviours);
            if points > 30_000 {
                println!("| {points} | {shape} | | {seconds:.2} | | |");
                continue;
            }
            let (full_loss, full_seconds) = measure(Algorithm::FasterPam, &behaviours);
            let (time_ratio, loss_ratio) = (seconds / full_seconds, loss / full_loss);
            println!(
                "| {points} | {shape} | {full_seconds:.2} | {seconds:.2} | {time_ratio:.3} | {loss_ratio:.4} |"
            );
        }
    }
}

criterion_group!(benches, medoids);

fn main() {
    benches();
    // `cargo test --benches` only checks that the benchmark runs.
    if std::env::args().any(|argument| argument == "--bench") {
        compare();
    }
}
