//! t-SNE: a map on which neighbours stay neighbours.
//!
//! By interpolation on a grid (FIt-SNE, Linderman et al. 2019), whose steps cost the same for few points and many: 10,000
//! behaviours take 3 s of one core, where a tree of the points takes 10 s. Few behaviours are placed exactly: their first
//! steps go so far that the grid becomes huge, and 16 of them took longer than 10,000.

use super::Points;
use bhtsne::tSNE;
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// How many neighbours count, about; fewer among few behaviours.
const PERPLEXITY: f32 = 30.0;
/// The first steps exaggerate what is near by this.
const EXAGGERATION: f32 = 12.0;
/// Least learning rate, for few behaviours.
const LEAST_RATE: f32 = 50.0;
/// Steps. At a rate of one for each behaviour and exaggeration (Belkina et al. 2019) they go farther than twice as many
/// at a quarter of it, which is what the crate takes by itself.
const STEPS: usize = 500;
/// Below this there is nothing to arrange.
const FEWEST: usize = 8;
/// Fewest behaviours that are placed on a grid.
const FEWEST_ON_GRID: usize = 256;
/// Spread of the start; the first steps need room to rearrange.
const START: f64 = 1e-4;

/// Places `behaviours` by t-SNE, from where `axes` have them on; as `axes` where there are too few.
pub(super) fn arrange(
    behaviours: &Behaviours,
    axes: &[[f64; 2]],
    interrupt: &Interrupt,
) -> Result<Points, Interrupted> {
    let count = behaviours.len();
    if count < FEWEST {
        return Ok(axes.to_vec());
    }
    let spread = axes.iter().map(|point| point[0].abs()).fold(0.0, f64::max);
    if spread == 0.0 {
        return Ok(axes.to_vec());
    }
    let vectors: Vec<Vec<f32>> = (0..count)
        .map(|index| {
            behaviours
                .point(index)
                .iter()
                .map(|value| *value as f32)
                .collect()
        })
        .collect();
    let start: Vec<f32> = axes
        .iter()
        .flatten()
        .map(|value| (value / spread * START) as f32)
        .collect();
    let perplexity = PERPLEXITY.min((count - 1) as f32 / 4.0);
    let rate = (count as f32 / EXAGGERATION).max(LEAST_RATE);
    let place = || {
        let mut map = tSNE::<f32, Vec<f32>, 2>::new(&vectors);
        map.perplexity(perplexity)
            .early_exaggeration(EXAGGERATION)
            .learning_rate(rate)
            .epochs(STEPS)
            .initial_embedding(start)
            .epoch_callback(|_, _| unwind_if(interrupt));
        match count < FEWEST_ON_GRID {
            true => map.exact(|one, other| distance(one, other)),
            false => map.fit_sne(|one, other| distance(one, other)),
        };
        map.embedding()
    };
    let place = || in_background(place);
    let placed = catch_unwind(AssertUnwindSafe(place)).map_err(|reason| match reason.downcast() {
        Ok(interrupted) => *interrupted,
        Err(panic) => resume_unwind(panic),
    })?;
    let points: Points = placed
        .as_chunks::<2>()
        .0
        .iter()
        .map(|point| point.map(f64::from))
        .collect();
    // Nothing may come out of numbers that ran away.
    Ok(match points.iter().flatten().all(|value| value.is_finite()) {
        true => points,
        false => axes.to_vec(),
    })
}

/// Computes on half of the machine: the search goes first, before what is only to be looked at.
pub(super) fn in_background<T: Send>(compute: impl FnOnce() -> T + Send) -> T {
    let threads = rayon::current_num_threads().div_ceil(2);
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(compute),
        Err(_) => compute(),
    }
}

/// Unwinds to [`arrange`] once `interrupt` is raised: what is called after every step cannot tell the crate to stop.
fn unwind_if(interrupt: &Interrupt) {
    if let Err(interrupted) = interrupt.check() {
        resume_unwind(Box::new(interrupted));
    }
}

fn distance(one: &[f32], other: &[f32]) -> f32 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f32>().sqrt()
}
