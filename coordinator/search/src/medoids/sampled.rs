//! Medoids of more points than FasterPAM can handle at once.
//!
//! As in CLARA (Kaufman and Rousseeuw 1990), medoids are found among uniform samples; here, FasterPAM finds a local optimum of
//! each sample. Then the medoids are moved among all points: each medoid moves to the exact medoid of its cluster ([`centre`]),
//! then the points are assigned again, and so on while the loss decreases. The medoids of the sample with the least loss over all
//! points are returned. The sample only decides which clusters exist, and few points suffice for this decision. The moves recover
//! the accuracy that CLARA loses because its medoids must be points of the sample.
//!
//! The reported loss is over all points, and at most the loss of any sample's medoids before the moves.

use super::{Clustering, Progress, arrange, centre, swaps};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use murmuration_swarm::RandomStream;
use rayon::prelude::*;

/// The size and the number of the samples.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sampling {
    /// Number of points of a sample, or [`LEAST_SHARE`] for each medoid if that is more.
    pub(super) size: usize,
    pub(super) count: u32,
}

/// Minimum number of points of a sample for each medoid.
const LEAST_SHARE: usize = 16;

/// Minimum share of the loss that a round must save, so that another round follows.
const WORTHWHILE: f64 = 1e-5;

/// Maximum number of rounds, to bound the time.
const MOST_ROUNDS: u32 = 64;

/// Clusters `points` about `k` medoids; `k` is at most the number of points.
pub(super) fn cluster(
    points: &Behaviours,
    k: usize,
    sampling: Sampling,
    stream: &mut RandomStream,
    interrupt: &Interrupt,
    told: &dyn Fn(Progress),
) -> Result<Clustering, Interrupted> {
    let mut moves = 0;
    let mut best: Option<Clustering> = None;
    for samples in 0..sampling.count.max(1) {
        let sampled = Sample::draw(points, sampling.size.max(k * LEAST_SHARE), stream);
        let swapped = |progress: Progress| {
            told(Progress {
                samples,
                moves: moves + progress.moves,
                ..progress
            })
        };
        let medoids = sampled.medoids(k, stream, interrupt, &swapped)?;
        let found = settle(
            points,
            arrange(points, medoids, interrupt)?,
            interrupt,
            |mean_distance| {
                moves += 1;
                told(Progress {
                    samples,
                    moves,
                    mean_distance,
                });
            },
        )?;
        if best.as_ref().is_none_or(|best| found.loss < best.loss) {
            best = Some(found);
        }
    }
    best.ok_or(Interrupted)
}

/// Moves medoids to the centres of their clusters until a round saves next to nothing.
fn settle(
    points: &Behaviours,
    mut clustering: Clustering,
    interrupt: &Interrupt,
    mut moved: impl FnMut(f64),
) -> Result<Clustering, Interrupted> {
    for _ in 0..MOST_ROUNDS {
        let medoids = centres(points, &clustering, interrupt)?;
        let next = arrange(points, medoids, interrupt)?;
        let saved = clustering.loss - next.loss;
        if saved <= 0.0 {
            break;
        }
        let worthwhile = saved > WORTHWHILE * clustering.loss;
        moved(next.loss / points.len() as f64);
        clustering = next;
        if !worthwhile {
            break;
        }
    }
    Ok(clustering)
}

/// The medoid of every cluster.
fn centres(
    points: &Behaviours,
    clustering: &Clustering,
    interrupt: &Interrupt,
) -> Result<Vec<usize>, Interrupted> {
    let mut members = vec![Vec::new(); clustering.medoids.len()];
    for (point, &cluster) in clustering.clusters.iter().enumerate() {
        members[cluster as usize].push(point);
    }
    let of = |(members, &current): (&Vec<usize>, &usize)| centre::medoid(points, members, current, interrupt);
    members.par_iter().zip(&clustering.medoids).map(of).collect()
}

/// A sample of the points.
pub(super) struct Sample {
    pub(super) behaviours: Behaviours,
    /// Indices of the sample's points among all points, ascending.
    indices: Vec<usize>,
}

impl Sample {
    /// Draws `size` points, or all points if there are fewer; every set of points is equally likely (Knuth's algorithm S).
    pub(super) fn draw(points: &Behaviours, size: usize, stream: &mut RandomStream) -> Self {
        let size = size.min(points.len());
        let mut indices = Vec::with_capacity(size);
        for index in 0..points.len() {
            let left = (points.len() - index) as u64;
            if stream.below(left) < (size - indices.len()) as u64 {
                indices.push(index);
            }
        }
        let behaviours = points.among(&indices);
        Self { behaviours, indices }
    }

    /// The sample's medoids by FasterPAM, as indices among all points.
    fn medoids(
        &self,
        k: usize,
        stream: &mut RandomStream,
        interrupt: &Interrupt,
        told: &dyn Fn(Progress),
    ) -> Result<Vec<usize>, Interrupted> {
        let places = swaps::fasterpam(&self.behaviours, k, stream, interrupt, told)?;
        Ok(places.into_iter().map(|place| self.indices[place]).collect())
    }
}
