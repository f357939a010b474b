//! t-SNE: a map on which neighbours stay neighbours.
//!
//! By interpolation on a grid (FIt-SNE, Linderman et al. 2019), whose steps cost the same for few points and many: 10,000
//! behaviours take 3 s of one core, where a tree of the points takes 10 s.

use super::Points;
use crate::novelty::Behaviours;
use bhtsne::tSNE;

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
/// Spread of the start; the first steps need room to rearrange.
const START: f64 = 1e-4;

/// Places `behaviours` by t-SNE, from where `axes` have them on; as `axes` where there are too few.
pub(super) fn embed(behaviours: &Behaviours, axes: &[[f64; 2]]) -> Points {
    let count = behaviours.len();
    if count < FEWEST {
        return axes.to_vec();
    }
    let spread = axes.iter().map(|point| point[0].abs()).fold(0.0, f64::max);
    if spread == 0.0 {
        return axes.to_vec();
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
        tSNE::<f32, Vec<f32>, 2>::new(&vectors)
            .perplexity(perplexity)
            .early_exaggeration(EXAGGERATION)
            .learning_rate(rate)
            .epochs(STEPS)
            .initial_embedding(start)
            .fit_sne(|one, other| distance(one, other))
            .embedding()
    };
    // The search goes first: a picture may take half the machine.
    let threads = rayon::current_num_threads().div_ceil(2);
    let placed = match rayon::ThreadPoolBuilder::new().num_threads(threads).build() {
        Ok(pool) => pool.install(place),
        Err(_) => place(),
    };
    let points: Points = placed
        .as_chunks::<2>()
        .0
        .iter()
        .map(|point| point.map(f64::from))
        .collect();
    // Nothing may come out of numbers that ran away.
    match points.iter().flatten().all(|value| value.is_finite()) {
        true => points,
        false => axes.to_vec(),
    }
}

fn distance(one: &[f32], other: &[f32]) -> f32 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f32>().sqrt()
}
