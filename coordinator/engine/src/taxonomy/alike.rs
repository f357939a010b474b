//! Medoids that may be one behaviour.

use super::Taxonomy;
use murmuration_swarm::Scale;

/// Two clusters of a taxonomy that touch: the distance of their medoids is less than the sum of the clusters' mean distances. No
/// gap separates two such clusters, so they may be two halves of one behaviour. The ratio of this sum to the distance of the
/// medoids is the similarity of Davies and Bouldin, *A cluster separation measure*, 1979. For clusters that touch, the ratio is
/// above 1.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Alike {
    /// The place of the larger cluster.
    pub one: usize,
    /// The place of the smaller cluster.
    pub other: usize,
    /// The distance between the two medoids, in units of the behaviour space.
    pub distance: f64,
}

impl Taxonomy {
    /// The pairs of clusters whose medoids are alike, nearest first. Call this only for the current taxonomy: the behaviour
    /// spaces of former versions no longer exist.
    pub fn alike(&self, scale: &Scale) -> Vec<Alike> {
        let places: Vec<Vec<f64>> = self
            .medoids
            .iter()
            .map(|medoid| medoid.individual.behaviour(scale))
            .collect();
        let mut found = Vec::new();
        for (other, theirs) in self.medoids.iter().enumerate() {
            for (one, ours) in self.medoids[..other].iter().enumerate() {
                let distance = distance(&places[one], &places[other]);
                if touch(distance, [ours.mean_distance, theirs.mean_distance]) {
                    found.push(Alike { one, other, distance });
                }
            }
        }
        found.sort_by(|a, b| a.distance.total_cmp(&b.distance));
        found
    }
}

/// Whether two clusters touch, by the distance of their medoids and the mean distance of each cluster.
pub fn touch(distance: f64, [one, other]: [f64; 2]) -> bool {
    distance < one + other
}

/// The distance of two behaviours in one behaviour space.
pub fn distance(one: &[f64], other: &[f64]) -> f64 {
    let squares = one.iter().zip(other).map(|(a, b)| (a - b) * (a - b));
    squares.sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::taxonomy::Medoid;
    use murmuration_store::Trial;
    use murmuration_swarm::BehaviourSpace;

    /// A taxonomy whose medoids have these first features and whose clusters have these mean distances.
    fn taxonomy(medoids: &[(f64, f64)]) -> Taxonomy {
        let medoid = |(index, &(at, mean_distance)): (u64, &(f64, f64))| Medoid {
            individual: crate::still(index, 0).with_trial(Trial {
                features: [at, 0.0, 0.0, 0.0, 0.0],
                ..Trial::default()
            }),
            cluster_size: 1,
            mean_distance,
            novelty: 0.0,
        };
        Taxonomy {
            medoids: (0..).zip(medoids).map(medoid).collect(),
            clusters: Vec::new(),
            loss: 0.0,
            robust_trials: Vec::new(),
        }
    }

    #[test]
    fn medoids_are_alike_where_their_clusters_touch() {
        // The distance between the third and the fourth medoid equals the sum of their mean distances: a gap of zero is a gap.
        let taxonomy = taxonomy(&[(0.0, 0.5), (1.5, 1.25), (9.0, 1.0), (10.5, 0.5), (0.5, 0.25)]);
        let found = taxonomy.alike(&Scale::unscaled(BehaviourSpace::Features));
        let found: Vec<_> = found
            .iter()
            .map(|pair| (pair.one, pair.other, pair.distance))
            .collect();
        assert_eq!(found, [(0, 4, 0.5), (1, 4, 1.0), (0, 1, 1.5)]);
    }
}
