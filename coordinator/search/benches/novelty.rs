//! Compares novelty by brute force, by rebuilt trees and by trees that grow with the archive, in the same run.

#![expect(
    clippy::print_stdout,
    clippy::expect_used,
    reason = "a table is printed; nobody interrupts"
)]

mod archive;

use archive::archive;
use criterion::{BatchSize, BenchmarkId, Criterion, criterion_group};
use murmuration_search::{
    interrupt::Interrupt,
    novelty::{Behaviours, Index, novelty_of},
};
use std::{
    hint::black_box,
    ops::Range,
    time::{Duration, Instant},
};

/// Default number of neighbours of a campaign.
const NEIGHBOURS: usize = 15;

/// Individuals per generation in the paper.
const GENERATION: usize = 100;

fn by_index(index: &mut Index, behaviours: &Behaviours, queries: Range<usize>) -> Vec<f64> {
    let novelty = index.novelty(black_box(behaviours), queries, NEIGHBOURS, &Interrupt::default());
    novelty.expect("not interrupted")
}

fn by_brute_force(behaviours: &Behaviours, queries: Range<usize>) -> Vec<f64> {
    let queries: Vec<usize> = queries.collect();
    let novelty = novelty_of(black_box(behaviours), &queries, NEIGHBOURS, &Interrupt::default());
    novelty.expect("not interrupted")
}

/// Novelty of one generation against archives of 10^3 to 10^6 individuals.
fn generation(c: &mut Criterion) {
    let mut group = c.benchmark_group("novelty of a generation");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(500));
    for points in [1_000, 10_000, 100_000, 1_000_000] {
        let behaviours = archive(points);
        let newest = points - GENERATION..points;
        let indices: Vec<usize> = (0..newest.start).collect();
        let before = behaviours.among(&indices);
        let mut index = Index::new();
        index.extend(&before);
        group.bench_function(BenchmarkId::new("brute force", points), |b| {
            b.iter(|| by_brute_force(&behaviours, newest.clone()));
        });
        group.bench_function(BenchmarkId::new("built anew", points), |b| {
            b.iter(|| by_index(&mut Index::new(), &behaviours, newest.clone()));
        });
        group.bench_function(BenchmarkId::new("extended", points), |b| {
            b.iter_batched_ref(
                || index.clone(),
                |index| by_index(index, &behaviours, newest.clone()),
                BatchSize::PerIteration,
            );
        });
    }
}

/// Mean cost of a generation while an archive doubles in size, including the rebuilding of indexes.
fn growth() {
    println!("| archive | generation | extended, ms | built anew, ms | brute force, ms | extended : anew |");
    println!("|--:|--:|--:|--:|--:|--:|");
    for points in [2_000, 20_000, 200_000, 1_000_000] {
        let all = archive(points);
        let population = GENERATION.max(points / 1000);
        let mut index = Index::new();
        let first: Vec<usize> = (0..points / 2).collect();
        let mut grown = all.among(&first);
        index.extend(&grown);
        let begun = Instant::now();
        let mut generations = 0_u32;
        for start in (points / 2..points).step_by(population) {
            for new in start..start + population {
                grown.push(all.point(new).as_slice()).expect("it was one before");
            }
            by_index(&mut index, &grown, start..start + population);
            generations += 1;
        }
        let extended = begun.elapsed() / generations;
        let newest = points - population..points;
        let begun = Instant::now();
        let novelty = by_index(&mut Index::new(), &all, newest.clone());
        let anew = begun.elapsed();
        let begun = Instant::now();
        assert_eq!(by_brute_force(&all, newest), novelty);
        let compared = begun.elapsed();
        let ratio = extended.as_secs_f64() / anew.as_secs_f64();
        let [extended, anew, compared] = [extended, anew, compared].map(|time| time.as_secs_f64() * 1e3);
        println!("| {points} | {population} | {extended:.2} | {anew:.2} | {compared:.2} | {ratio:.3} |");
    }
}

criterion_group!(benches, generation);

fn main() {
    benches();
    // `cargo test --benches` only checks that the benchmark runs.
    if std::env::args().any(|argument| argument == "--bench") {
        growth();
    }
}
