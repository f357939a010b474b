//! t-SNE: a map on which neighbours stay neighbours.
//!
//! Many behaviours are placed by interpolation on a grid (FIt-SNE, Linderman et al. 2019): 10,000 behaviours take 3 s of one
//! core, but 10 s with a tree of the points. Few behaviours are placed without a grid. Their first steps go so far that the grid
//! would become huge: with it, 16 behaviours took longer than 10,000.

use super::Points;
use bhtsne::tSNE;
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Approximate number of neighbours that t-SNE keeps near a behaviour; lower for few behaviours.
const PERPLEXITY: f32 = 30.0;
/// Factor by which the first steps exaggerate the attraction of neighbours.
const EXAGGERATION: f32 = 12.0;
/// Minimum learning rate, for few behaviours.
const LEAST_RATE: f32 = 50.0;
/// Number of steps. Our learning rate is the number of behaviours divided by the exaggeration (Belkina et al. 2019). At this
/// rate, 500 steps converge further than 1,000 steps at a quarter of it, which are the crate's defaults.
const STEPS: usize = 500;
/// Minimum number of behaviours to arrange.
const FEWEST: usize = 8;
/// Minimum number of behaviours for the grid.
const FEWEST_ON_GRID: usize = 256;
/// Spread of the initial places; small, so that the first steps can rearrange the behaviours.
const START: f64 = 1e-4;

/// Places `behaviours` by t-SNE, starting from `axes`; returns `axes` if there are fewer than [`FEWEST`] behaviours.
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
    // If t-SNE diverged, the points on the principal axes replace its result.
    Ok(match points.iter().flatten().all(|value| value.is_finite()) {
        true => points,
        false => axes.to_vec(),
    })
}

/// Computes on half of the machine's threads, because the search has priority over a map.
pub(super) fn in_background<T: Send>(compute: impl FnOnce() -> T + Send) -> T {
    let threads = rayon::current_num_threads().div_ceil(2);
    match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(compute),
        Err(_) => compute(),
    }
}

/// Unwinds to [`arrange`] once `interrupt` is raised, because the callback of a step cannot tell the crate to stop.
fn unwind_if(interrupt: &Interrupt) {
    if let Err(interrupted) = interrupt.check() {
        resume_unwind(Box::new(interrupted));
    }
}

fn distance(one: &[f32], other: &[f32]) -> f32 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f32>().sqrt()
}
