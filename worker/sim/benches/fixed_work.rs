//! Fixed work whose instructions `scripts/instruction-counts` counts. Runs one item a given number of times.
#![expect(clippy::unwrap_used, reason = "a benchmark that cannot start should stop")]

use murmuration_sim::{
    evaluate::Evaluator,
    rasterise::Rasteriser,
    simulate::{Start, Swarm},
};
use murmuration_swarm::{Controller, ImageFormat, Preset, World};
use std::{env, f64::consts::FRAC_PI_3, hint::black_box};

const SINGLE: (Preset, &[f64]) = (Preset::SingleSensor, &[0.6, 1.0, 0.4, 0.5]);
const TWO: (Preset, &[f64]) = (
    Preset::TwoSensor,
    &[0.8, 0.5, 0.6, -0.5, -0.5, 0.0, -0.2, 0.5, -FRAC_PI_3],
);

/// Usage: `fixed_work ITEM TIMES`. Without arguments, as in `cargo bench`, runs every item once.
fn main() {
    let arguments: Vec<_> = env::args()
        .skip(1)
        .filter(|argument| !argument.starts_with('-'))
        .collect();
    match arguments.as_slice() {
        [item, times] => (0..times.parse().unwrap()).for_each(|_| work(item)),
        _ => [
            "loop-one-sensor",
            "loop-two-sensors",
            "evaluate-one-sensor",
            "evaluate-two-sensors",
            "picture",
        ]
        .into_iter()
        .for_each(work),
    }
}

fn work(item: &str) {
    match item {
        "loop-one-sensor" => simulate(SINGLE),
        "loop-two-sensors" => simulate(TWO),
        "evaluate-one-sensor" => evaluate(SINGLE),
        "evaluate-two-sensors" => evaluate(TWO),
        "picture" => picture(),
        _ => unreachable!("{item} is no item"),
    }
}

fn controller((model, genes): (Preset, &[f64])) -> Controller {
    Controller::new(model, genes).unwrap()
}

/// Steps a swarm, without observing it.
fn simulate(of: (Preset, &[f64])) {
    let mut swarm = Swarm::new(&controller(of), &World::default(), &Start::seeded(1)).unwrap();
    swarm.advance(600);
    black_box(swarm);
}

/// Eight evaluations at once.
fn evaluate(of: (Preset, &[f64])) {
    let tasks: Vec<_> = (0..8).map(|seed| (controller(of), Start::seeded(seed))).collect();
    let mut evaluator = Evaluator::new(&World::default(), &ImageFormat::default()).unwrap();
    black_box(evaluator.evaluate_all(&tasks).unwrap());
}

/// Draws a swarm a hundred times, and computes the picture.
fn picture() {
    let world = World::default();
    let mut rasteriser = Rasteriser::new(&world, &ImageFormat::default()).unwrap();
    let mut swarm = Swarm::new(&controller(SINGLE), &world, &Start::seeded(1)).unwrap();
    for _ in 0..100 {
        swarm.step();
        rasteriser.draw(&swarm);
    }
    black_box(rasteriser.image());
}
