//! The quality of an embedding, measured without labels. The loss alone does not measure quality: a network can lower the loss by
//! embedding everything on a line or at a point.

/// The quality of an embedding, measured on held-out behaviours.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quality {
    /// Share of triplets (anchor, positive of the same behaviour, positive of another) whose anchor is strictly nearer to its own
    /// positive, 0 to 1. By chance, the share is 0.5.
    pub triplet_accuracy: f64,
    /// Root mean square distance of embeddings from their mean.
    pub spread: f64,
    /// Effective number of dimensions of the embeddings: (sum of variances)^2 / sum of squared variances, over the principal
    /// axes. The rank is 0 at a point, 1 on a line, and at most the number of dimensions.
    pub rank: f64,
}

impl Quality {
    /// Measures embeddings of `dimensions` numbers each: of anchors, of their positives in the same order, and of pictures
    /// without augmentation.
    pub(crate) fn of(anchors: &[f32], positives: &[f32], plain: &[f32], dimensions: usize) -> Self {
        let moments = Moments::of(plain, dimensions);
        let total = moments.variance();
        let squares: f64 = moments.covariance.iter().map(|value| value * value).sum();
        Self {
            triplet_accuracy: triplet_accuracy(anchors, positives, dimensions),
            spread: moments.spread(),
            rank: if squares > 0.0 {
                total * total / squares
            } else {
                0.0
            },
        }
    }
}

/// Mean and covariance of embeddings.
pub(crate) struct Moments {
    pub(crate) mean: Vec<f64>,
    /// Covariance matrix, `dimensions` x `dimensions`.
    covariance: Vec<f64>,
}

impl Moments {
    pub(crate) fn of(embeddings: &[f32], dimensions: usize) -> Self {
        let count = (embeddings.len() / dimensions) as f64;
        let mut mean = vec![0.0; dimensions];
        for embedding in embeddings.chunks_exact(dimensions) {
            for (mean, &value) in mean.iter_mut().zip(embedding) {
                *mean += f64::from(value) / count;
            }
        }
        let mut covariance = vec![0.0; dimensions * dimensions];
        for embedding in embeddings.chunks_exact(dimensions) {
            let centred = |i: usize| f64::from(embedding[i]) - mean[i];
            for (place, value) in covariance.iter_mut().enumerate() {
                *value += centred(place / dimensions) * centred(place % dimensions) / count;
            }
        }
        Self { mean, covariance }
    }

    /// Sum of the variances of all dimensions.
    fn variance(&self) -> f64 {
        let dimensions = self.mean.len();
        (0..dimensions).map(|i| self.covariance[i * dimensions + i]).sum()
    }

    /// Root mean square distance from the mean.
    pub(crate) fn spread(&self) -> f64 {
        self.variance().sqrt()
    }
}

fn triplet_accuracy(anchors: &[f32], positives: &[f32], dimensions: usize) -> f64 {
    let squared_distance = |a: &[f32], b: &[f32]| -> f64 {
        let differences = a.iter().zip(b).map(|(a, b)| f64::from(a - b));
        differences.map(|difference| difference * difference).sum()
    };
    let positives: Vec<&[f32]> = positives.chunks_exact(dimensions).collect();
    let correct = anchors
        .chunks_exact(dimensions)
        .zip(&positives)
        .map(|(anchor, own)| {
            let near = squared_distance(anchor, own);
            positives
                .iter()
                .filter(|other| near < squared_distance(anchor, other))
                .count()
        });
    let triplets = positives.len() * positives.len().saturating_sub(1);
    correct.sum::<usize>() as f64 / triplets as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_rank_one_and_a_round_cloud_as_many_as_dimensions() {
        let rank = |plain: &[f32]| Quality::of(&[0.0; 4], &[0.0; 4], plain, 2).rank;
        assert!((rank(&[1.0, 2.0, 2.0, 4.0, 3.0, 6.0]) - 1.0).abs() < 1e-12);
        assert!((rank(&[1.0, 0.0, -1.0, 0.0, 0.0, 1.0, 0.0, -1.0]) - 2.0).abs() < 1e-12);
        assert_eq!(rank(&[5.0; 6]), 0.0);
    }

    #[test]
    fn the_spread_is_a_distance_and_needs_no_triplets() {
        assert_eq!(Quality::of(&[], &[], &[0.0, 0.0, 6.0, 8.0], 2).spread, 5.0);
        let quality = Quality::of(&[0.0; 4], &[0.0; 4], &[0.0, 0.0, 6.0, 8.0], 2);
        assert_eq!(quality.spread, 5.0);
    }

    #[test]
    fn triplets_count_when_the_own_positive_is_strictly_nearer() {
        let accuracy = |anchors, positives| triplet_accuracy(anchors, positives, 1);
        assert_eq!(accuracy(&[0.0, 10.0, 20.0], &[1.0, 11.0, 21.0]), 1.0);
        assert_eq!(accuracy(&[0.0, 0.0], &[1.0, 1.0]), 0.0);
        assert_eq!(accuracy(&[0.0, 10.0, 1.4], &[1.0, 11.0, 2.0]), 5.0 / 6.0);
    }
}
