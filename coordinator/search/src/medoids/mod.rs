//! k-medoids: the behaviours that represent an archive (paper, "Evolution and Clustering").
//!
//! Up to [`MOST_EXACT`] points the algorithm is FasterPAM (Schubert and Rousseeuw, "Fast and eager k-medoids clustering", 2021):
//! a point that is not a medoid is weighed against *all* medoids in one pass over the points, and a swap that lowers the loss is
//! made at once. This module differs from FasterPAM in two points. Distances are computed when they are needed, so memory grows
//! with the number of points, not with its square. Candidates are weighed in parallel blocks: all candidates of a block are
//! weighed against the same medoids, then the best swap of the block is made. The block size is fixed, so the outcome does not
//! depend on the number of threads. The result is a local optimum: no single swap lowers the loss by more than a rounding error.
//! Time grows with the square of the number of points.
//!
//! For more points, FasterPAM finds medoids among samples, and these medoids are then moved among all points (`sampled`). The
//! time grows with the number of points. `docs/performance.md` has the times; `cargo bench --bench medoids` measures the times.

mod assignment;
mod by_class;
mod centre;
mod coverage;
mod sampled;
mod seeding;
mod swaps;

pub use coverage::order;

use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use by_class::cluster_by_class;
use coverage::cover;
use murmuration_swarm::{CampaignSpec, Choice, Purpose, RandomStream};
use rayon::prelude::*;
use sampled::Sampling;
use std::{cmp::Reverse, collections::BTreeMap};

/// Maximum number of points for FasterPAM on all points, which takes about a second of one core.
pub const MOST_EXACT: usize = 16_384;

/// Samples among which medoids of more than [`MOST_EXACT`] points are sought. The outcome depends on these numbers.
const SAMPLING: Sampling = Sampling { size: 8192, count: 4 };

/// Algorithm that finds medoids. The algorithms have different outcomes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Algorithm {
    /// FasterPAM on all points.
    FasterPam,
    /// FasterPAM on samples, then exact medoids of the clusters of all points.
    Sampled,
}

impl Algorithm {
    /// The algorithm for this number of points.
    #[must_use]
    pub(crate) const fn for_size(points: usize) -> Self {
        if points <= MOST_EXACT {
            Self::FasterPam
        } else {
            Self::Sampled
        }
    }
}

/// Progress of a clustering.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Number of completed samples; 0 without sampling.
    pub samples: u32,
    /// Number of times that medoids were swapped or moved, over all samples.
    pub moves: u32,
    /// Current mean distance to the nearest medoid, over the points of the current sample or step.
    pub mean_distance: f64,
}

/// Behaviours in clusters, each about a medoid.
#[derive(Debug, Clone, PartialEq)]
pub struct Clustering {
    /// Distinct indices of the medoids, in descending order of cluster size, then by index.
    pub medoids: Vec<usize>,
    /// For each behaviour, the place of its nearest medoid in `medoids`; of equally near medoids, the medoid with the lowest
    /// index. A medoid is in its own cluster, even if other medoids coincide with it.
    pub clusters: Vec<u32>,
    /// Sum of the distances of all behaviours to their medoids.
    pub loss: f64,
}

/// Clusters an archive about the behaviours that its taxonomy shows, chosen according to `spec`; `labelled` maps indices of
/// points to classes. `told` receives the progress.
///
/// # Errors
/// Fails as [`cluster`] does.
pub fn choose(
    spec: &CampaignSpec,
    points: &Behaviours,
    labelled: &BTreeMap<usize, u32>,
    interrupt: &Interrupt,
    told: &dyn Fn(Progress),
) -> Result<Clustering, Interrupted> {
    let k = spec.medoids() as usize;
    let mut stream = RandomStream::derive(spec.seed(), Purpose::Medoids, 0);
    match spec.choice() {
        Choice::Coverage => {
            let neighbours = spec.search().neighbours() as usize;
            cover(points, labelled, k, neighbours, &mut stream, interrupt)
        }
        Choice::Medoids => {
            let algorithm = Algorithm::for_size(points.len());
            cluster_by(algorithm, points, k, &mut stream, interrupt, told)
        }
        Choice::ByClass => cluster_by_class(points, labelled, k, &mut stream, interrupt, told),
    }
}

/// Clusters `points` about `k` of them so that the sum of Euclidean distances to the nearest medoid is locally least. The
/// stream determines the initial medoids and the samples.
///
/// If `k` exceeds the number of points, every point is a medoid; if `k` is 0, there is one medoid. Without points there are no
/// medoids.
///
/// # Errors
/// [`Interrupted`] once `interrupt` is raised.
pub fn cluster(
    points: &Behaviours,
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
) -> Result<Clustering, Interrupted> {
    let algorithm = Algorithm::for_size(points.len());
    cluster_by(algorithm, points, k, stream, interrupt, &|_| {})
}

/// Clusters as [`cluster`] does, with a given algorithm; `told` receives the progress.
///
/// # Errors
/// Fails as [`cluster`] does.
pub fn cluster_by(
    algorithm: Algorithm,
    points: &Behaviours,
    k: usize,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
    told: &dyn Fn(Progress),
) -> Result<Clustering, Interrupted> {
    let k = k.max(1).min(points.len());
    match algorithm {
        Algorithm::FasterPam => {
            let medoids = swaps::fasterpam(points, k, stream, interrupt, told)?;
            arrange(points, medoids, interrupt)
        }
        Algorithm::Sampled => sampled::cluster(points, k, SAMPLING, stream, interrupt, told),
    }
}

/// The clusters of `medoids`, the largest first.
fn arrange(
    points: &Behaviours,
    mut medoids: Vec<usize>,
    interrupt: &Interrupt,
) -> Result<Clustering, Interrupted> {
    medoids.sort_unstable();
    let nearest: Vec<(usize, f64)> = (0..points.len())
        .into_par_iter()
        .map(|point| {
            interrupt.check()?;
            Ok(nearest_medoid(points, &medoids, point))
        })
        .collect::<Result<_, Interrupted>>()?;
    let loss = nearest.iter().fold(0.0, |sum, (_, squared)| sum + squared.sqrt());

    let mut sizes = vec![0usize; medoids.len()];
    for &(place, _) in &nearest {
        sizes[place] += 1;
    }
    let mut order: Vec<usize> = (0..medoids.len()).collect();
    order.sort_by_key(|&place| (Reverse(sizes[place]), medoids[place]));
    let mut new_place = vec![0u32; medoids.len()];
    for (new, &old) in (0..).zip(&order) {
        new_place[old] = new;
    }
    Ok(Clustering {
        medoids: order.iter().map(|&place| medoids[place]).collect(),
        clusters: nearest.iter().map(|&(place, _)| new_place[place]).collect(),
        loss,
    })
}

/// Place (among ascending `medoids`) and squared distance of the medoid of `point`.
fn nearest_medoid(points: &Behaviours, medoids: &[usize], point: usize) -> (usize, f64) {
    if let Ok(own) = medoids.binary_search(&point) {
        return (own, 0.0);
    }
    let mut nearest = (0, f64::INFINITY);
    for (place, &medoid) in medoids.iter().enumerate() {
        let squared = points.squared_distance(point, medoid);
        if squared < nearest.1 {
            nearest = (place, squared);
        }
    }
    nearest
}

#[cfg(test)]
mod tests;
