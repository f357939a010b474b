//! Benchmark: simulations and whole evaluations of the paper's world per second, with scalar and with vector instructions.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use murmuration_sim::{
    evaluate::Evaluator,
    simulate::{Start, Swarm},
};
use murmuration_swarm::{Controller, ImageFormat, Preset, World};
use pulp::Arch;
use std::{hint::black_box, time::Duration};

/// The paper's milling and nested-cycle controllers.
const CONTROLLERS: [(Preset, &[f64]); 2] = [
    (Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]),
    (
        Preset::TwoSensor,
        &[
            0.8,
            0.5,
            0.6,
            -0.5,
            -0.5,
            0.0,
            -0.2,
            0.5,
            -std::f64::consts::FRAC_PI_3,
        ],
    ),
];

fn evaluate(criterion: &mut Criterion) {
    let world = World::default();
    for (model, genes) in CONTROLLERS {
        let controller = Controller::new(model, genes).unwrap();
        let mut group = criterion.benchmark_group(model.name());
        for (name, arch) in [("scalar", Arch::Scalar), ("dispatched", Arch::new())] {
            let mut seeds = (0..).map(Start::seeded);
            group.bench_function(BenchmarkId::new("simulate", name), |bencher| {
                bencher.iter(|| {
                    let start = seeds.next().unwrap();
                    let mut swarm = Swarm::on(arch, &controller, &world, &start).unwrap();
                    swarm.advance(world.horizon());
                    black_box(swarm);
                });
            });
            let mut evaluator = Evaluator::on(arch, &world, &ImageFormat::default()).unwrap();
            group.bench_function(BenchmarkId::new("evaluate", name), |bencher| {
                bencher.iter(|| black_box(evaluator.evaluate(&controller, &seeds.next().unwrap()).unwrap()));
            });
        }
        group.finish();
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(1))
        .sample_size(20);
    targets = evaluate
}
criterion_main!(benches);
