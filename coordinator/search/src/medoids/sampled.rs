//! Medoids of more points than can all be weighed against each other.
//!
//! As in CLARA (Kaufman and Rousseeuw 1990), medoids are found among uniform samples, here by FasterPAM to a local optimum
//! of the sample, and those of least loss over all points are taken. Before that they are moved in all points: each to
//! the exact medoid of its cluster ([`centre`]), then the clusters are drawn anew, and so on while that lowers the loss.
//! The sample decides which clusters there are, and few points are enough for that; the moves give back what CLARA loses
//! because its medoids lie where the sample happens to have points.
//!
//! The loss reported is that over all points, and never above that of the medoids of any of the samples.

use super::{Clustering, Progress, arrange, centre, swaps};
use crate::{
    interrupt::{Interrupt, Interrupted},
    novelty::Behaviours,
};
use murmuration_proto::RandomStream;
use rayon::prelude::*;

/// How much to sample.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sampling {
    /// Points of a sample, where there are not more than [`LEAST_SHARE`] medoids for each of them.
    pub(super) size: usize,
    pub(super) count: u32,
}

/// Points of a sample for each medoid, at least.
const LEAST_SHARE: usize = 16;

/// The least share of the loss for which the clusters are drawn once more.
const WORTHWHILE: f64 = 1e-5;

/// Most times that they are: a bound on the time.
const MOST_ROUNDS: u32 = 64;

/// Clusters `points` about `k` of them (at most as many as there are).
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

/// Moves medoids to the centres of their clusters until that saves next to nothing.
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

/// Some of the points.
pub(super) struct Sample {
    pub(super) behaviours: Behaviours,
    /// Which they are of all, ascending.
    indices: Vec<usize>,
}

impl Sample {
    /// `size` of the points, or all if they are fewer: every set as likely as any other (Knuth's algorithm S).
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

    /// Its medoids by FasterPAM, as indices of all points.
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
