//! Levels the density of behaviours. Most random controllers behave alike, so a network that sees all controllers equally often
//! mainly learns to distinguish random behaviours.

use murmuration_swarm::Features;
use rayon::prelude::*;

/// The rank of the neighbour whose distance measures how rare a behaviour is.
const NEIGHBOUR: usize = 15;
/// The rarest behaviours, one in `RAREST`, count as equally rare.
const RAREST: usize = 100;
/// Maximum number of behaviours among which neighbours are searched.
const SAMPLE: usize = 10_000;

/// How often each behaviour is drawn, relative to the other behaviours: `min(r, q)` to the power of `flattening`. Here r is the
/// distance to the 15th nearest neighbour in features of equal standard deviation, and q is the 99 % quantile of r. All weights
/// are equal if all distances are 0.
pub(super) fn weights(features: &[Features], flattening: u32) -> Vec<f64> {
    let scaled = scaled(features);
    let step = scaled.len().div_ceil(SAMPLE).max(1);
    let distances: Vec<f64> = (0..scaled.len())
        .into_par_iter()
        .map(|behaviour| distance(&scaled, behaviour, step))
        .collect();
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let most = sorted
        .len()
        .checked_sub(1 + sorted.len() / RAREST)
        .map_or(0.0, |place| sorted[place]);
    if most == 0.0 {
        return vec![1.0; features.len()];
    }
    let power = |distance: f64| (0..flattening).fold(1.0, |product, _| product * distance);
    distances
        .into_iter()
        .map(|distance| power(distance.min(most) / most))
        .collect()
}

/// The features, each scaled to a standard deviation of 1 unless it is constant.
fn scaled(features: &[Features]) -> Vec<Features> {
    let count = features.len() as f64;
    let mut scaled = features.to_vec();
    for feature in 0..Features::default().len() {
        let values = || features.iter().map(|values| values[feature]);
        let mean = values().sum::<f64>() / count;
        let variance = values().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count;
        let scale = if variance > 0.0 {
            1.0 / variance.sqrt()
        } else {
            0.0
        };
        for values in &mut scaled {
            values[feature] = (values[feature] - mean) * scale;
        }
    }
    scaled
}

/// The distance from a behaviour to its 15th nearest neighbour (or to the farthest neighbour if there are fewer) among every
/// `step`th behaviour.
fn distance(all: &[Features], behaviour: usize, step: usize) -> f64 {
    let mut nearest: Vec<f64> = Vec::with_capacity(NEIGHBOUR + 1);
    for other in (0..all.len()).step_by(step).filter(|other| *other != behaviour) {
        let pairs = all[behaviour].iter().zip(&all[other]);
        let squared: f64 = pairs.map(|(one, two)| (one - two) * (one - two)).sum();
        if nearest.len() < NEIGHBOUR || nearest.last().is_some_and(|farthest| squared < *farthest) {
            nearest.insert(nearest.partition_point(|known| *known <= squared), squared);
            nearest.truncate(NEIGHBOUR);
        }
    }
    nearest.last().copied().unwrap_or_default().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A dense square of 20 x 20 behaviours, and 20 behaviours that are spread widely.
    fn features() -> Vec<Features> {
        let dense = (0..400).map(|i| [f64::from(i % 20), f64::from(i / 20), 0.0, 7.0, 0.0]);
        let rare = (0..20).map(|i| [1000.0 + f64::from(i) * 50.0, 0.0, 0.0, 7.0, 0.0]);
        dense.chain(rare).collect()
    }

    #[test]
    fn rare_behaviours_are_drawn_more_often_and_the_rarest_equally_often() {
        let weights = weights(&features(), 2);
        let dense = weights[..400].iter().copied().fold(0.0, f64::max);
        let rare = weights[400..].iter().copied().fold(f64::INFINITY, f64::min);
        assert!(rare > 100.0 * dense, "{rare} {dense}");
        assert!(weights.iter().filter(|weight| **weight == 1.0).count() >= 4);
    }

    #[test]
    fn without_flattening_and_without_differences_all_are_equal() {
        assert!(weights(&features(), 0).iter().all(|weight| *weight == 1.0));
        assert!(weights(&[[1.0; 5]; 30], 2).iter().all(|weight| *weight == 1.0));
        assert_eq!(weights(&[], 2), [0.0; 0]);
    }

    #[test]
    fn neighbours_among_a_sample_are_as_far_as_among_all() {
        let all: Vec<Features> = (0..3000)
            .map(|i| {
                [
                    f64::from(i * 7919 % 3001),
                    f64::from(i * 104_729 % 2999),
                    0.0,
                    0.0,
                    0.0,
                ]
            })
            .collect();
        let scaled = scaled(&all);
        for behaviour in [0, 17, 2999] {
            // With a third of the points in the plane, the distance to neighbours grows by a factor of the square root of three.
            let ratio = distance(&scaled, behaviour, 3) / distance(&scaled, behaviour, 1);
            assert!((1.3..2.3).contains(&ratio), "{ratio}");
        }
    }
}
