//! A t-SNE of an archive of any size: t-SNE places some behaviours, and interpolation places the other behaviours.
//!
//! As openTSNE and FIt-SNE do for large sets (Kobak and Berens 2019), t-SNE arranges a bounded number of *landmarks*, and every
//! other behaviour is placed at the weighted mean of its nearest landmarks. So t-SNE's time and memory are bounded, and every
//! other behaviour costs one look-up in a tree.

mod arrange;

use arrange::{arrange, in_background};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    novelty::{Behaviours, Index, Neighbour},
};
use rayon::prelude::*;

/// Points in the order of their behaviours, in arbitrary units.
pub type Points = Vec<[f64; 2]>;

/// Maximum number of behaviours that t-SNE places: twice the paper's archive.
const MOST: usize = 20_000;

/// Number of landmarks that each other behaviour is interpolated from.
const BETWEEN: usize = 5;

/// Places `behaviours`, whose points on the principal axes are `axes`; returns `axes` if there are too few behaviours to arrange.
/// Uses half of the machine's threads.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn embed(
    behaviours: &Behaviours,
    axes: &[[f64; 2]],
    interrupt: &Interrupt,
) -> Result<Points, Interrupted> {
    embed_by(MOST, behaviours, axes, interrupt)
}

/// Like [`embed`], with at most `most` landmarks.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn embed_by(
    most: usize,
    behaviours: &Behaviours,
    axes: &[[f64; 2]],
    interrupt: &Interrupt,
) -> Result<Points, Interrupted> {
    let count = behaviours.len();
    if count <= most {
        return arrange(behaviours, axes, interrupt);
    }
    // Landmarks are spread evenly from the first generation to the last.
    let indices: Vec<usize> = (0..most).map(|place| place * count / most).collect();
    let landmarks = behaviours.among(&indices);
    let axes: Points = indices.iter().map(|&index| axes[index]).collect();
    let placed = arrange(&landmarks, &axes, interrupt)?;
    let mut index = Index::new();
    index.extend(&landmarks);
    in_background(|| {
        let place = |behaviour: usize| {
            interrupt.check()?;
            let nearest = index.nearest(behaviours.point(behaviour).as_slice(), BETWEEN);
            Ok(between(&nearest, &placed))
        };
        (0..count).into_par_iter().map(place).collect()
    })
}

/// The mean of the places of the landmarks `nearest` (in ascending order of distance), weighted by inverse distance. If the first
/// landmark is at distance 0, the result is that landmark's place.
fn between(nearest: &[Neighbour], placed: &[[f64; 2]]) -> [f64; 2] {
    let least = nearest.first().map_or(0.0, |first| first.distance);
    let (mut sum, mut weights) = ([0.0; 2], 0.0);
    for neighbour in nearest {
        let [x, y] = placed[neighbour.index];
        if least == 0.0 {
            return [x, y];
        }
        let weight = least / neighbour.distance;
        sum = [sum[0] + weight * x, sum[1] + weight * y];
        weights += weight;
    }
    sum.map(|value| value / weights)
}
