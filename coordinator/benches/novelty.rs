//! Novelty by brute force and by a k-d tree, in the same run: what `Lookup::for_size` rests on.

mod archive;

use archive::archive;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use murmuration_search::{
    interrupt::Interrupt,
    novelty::{Lookup, novelty_by},
};
use std::{hint::black_box, time::Duration};

/// Compares the two for the newest `queries` of `points`, each asking for `k` neighbours.
fn compare(c: &mut Criterion, name: &str, cases: impl IntoIterator<Item = (usize, usize, usize)>) {
    let mut group = c.benchmark_group(name);
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_millis(500));
    for (points, queries, k) in cases {
        let behaviours = archive(points);
        for lookup in [Lookup::BruteForce, Lookup::Tree] {
            let case = BenchmarkId::new(format!("{lookup:?}"), format!("{queries} of {points}, k = {k}"));
            group.bench_function(case, |b| {
                b.iter(|| {
                    let newest = points - queries..points;
                    novelty_by(lookup, black_box(&behaviours), newest, k, &Interrupt::default())
                });
            });
        }
    }
}

/// A generation of the search against an archive that grows.
fn generation(c: &mut Criterion) {
    compare(
        c,
        "generation",
        [100, 1_000, 10_000, 100_000].map(|points| (points, 100, 15)),
    );
}

/// Every point against every other: the novelty of a whole archive.
fn whole_archive(c: &mut Criterion) {
    compare(
        c,
        "whole archive",
        [500, 1_000, 2_000, 5_000, 10_000].map(|points| (points, points, 15)),
    );
}

/// Where building a tree begins to pay.
fn queries(c: &mut Criterion) {
    compare(
        c,
        "queries",
        [150, 200, 300, 400].map(|queries| (10_000, queries, 15)),
    );
}

/// Where a tree is asked for so much that it prunes nothing.
fn neighbours(c: &mut Criterion) {
    compare(c, "neighbours", [50, 200, 500, 1_000].map(|k| (10_000, 2_000, k)));
}

criterion_group!(benches, generation, whole_archive, queries, neighbours);
criterion_main!(benches);
