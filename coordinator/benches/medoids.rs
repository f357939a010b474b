//! Medoids of a whole archive, as a taxonomy asks for them.

mod archive;

use archive::archive;
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use murmuration_proto::{Purpose, Stream};
use murmuration_search::{interrupt::Interrupt, medoids::cluster};
use std::{hint::black_box, time::Duration};

fn medoids(c: &mut Criterion) {
    let mut group = c.benchmark_group("medoids");
    group
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    for (points, k) in [(1_000, 12), (10_000, 12), (10_000, 16)] {
        let behaviours = archive(points);
        group.bench_function(BenchmarkId::from_parameter(format!("{k} of {points}")), |b| {
            b.iter(|| {
                let mut stream = Stream::derive(1, Purpose::Medoids, 0);
                cluster(black_box(&behaviours), k, &mut stream, &Interrupt::default())
            });
        });
    }
}

criterion_group!(benches, medoids);
criterion_main!(benches);
