//! Labelled in-batch triplets: of any anchor, every other picture of its class is a positive and every picture of
//! another class a negative. The mean is over violated triplets only.

use super::{distance, is_violated, push};
use crate::real::Real;

/// The mean of d(anchor, positive) - d(anchor, negative) + margin over the triplets where it is over 0 (0 if none is).
///
/// `embeddings` are those of one class after the other, `per_class` of each, `dimensions` numbers each; `gradient`
/// becomes the gradient by them.
pub(crate) fn loss<T: Real>(
    embeddings: &[T],
    dimensions: usize,
    per_class: usize,
    margin: f64,
    gradient: &mut [T],
) -> f64 {
    let pictures: Vec<&[T]> = embeddings.chunks_exact(dimensions).collect();
    let count = pictures.len();
    let mut total = 0.0;
    let mut violated = 0_u64;
    // By how many triplets each distance, from anchor to other, should shrink; less than none if it should grow.
    let mut pulls = vec![0_i64; count * count];
    let mut distances = vec![0.0; count * count];
    for (anchor, pulls) in pulls.chunks_exact_mut(count).enumerate() {
        let row = &mut distances[anchor * count..][..count];
        for (to, other) in row.iter_mut().zip(&pictures) {
            *to = distance(pictures[anchor], other);
        }
        let first = anchor / per_class * per_class;
        let own = first..first + per_class;
        for positive in own.clone().filter(|&positive| positive != anchor) {
            for negative in (0..first).chain(own.end..count) {
                let violation = row[positive] - row[negative] + margin;
                if is_violated(violation) {
                    total += violation;
                    violated += 1;
                    pulls[positive] += 1;
                    pulls[negative] -= 1;
                }
            }
        }
    }
    let weight = 1.0 / violated.max(1) as f64;
    let mut slopes = vec![0.0; embeddings.len()];
    for (place, pull) in pulls.into_iter().enumerate().filter(|(_, pull)| *pull != 0) {
        let (anchor, other) = (place / count, place % count);
        let by_anchor = anchor * dimensions..(anchor + 1) * dimensions;
        let by_other = other * dimensions..(other + 1) * dimensions;
        let weight = pull as f64 * weight;
        if let Ok([d_anchor, d_other]) = slopes.get_disjoint_mut([by_anchor, by_other]) {
            let far = distances[place];
            push(pictures[anchor], pictures[other], far, weight, d_anchor, d_other);
        }
    }
    for (gradient, slope) in gradient.iter_mut().zip(slopes) {
        *gradient = T::of(slope);
    }
    total * weight
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::{Purpose, Stream};

    #[test]
    fn only_violated_triplets_count() {
        // From 0 the own one is at 1 and the others at 3 and 9; from 3 the own one is at 6, the others at 3 and 2.
        let embeddings = [0.0, 1.0, 3.0, 9.0];
        let loss = loss(&embeddings, 1, 2, 2.5, &mut [0.0; 4]);
        let violations = [1.0 - 3.0 + 2.5, 1.0 - 2.0 + 2.5, 6.0 - 3.0 + 2.5, 6.0 - 2.0 + 2.5];
        // From 9 the own one is at 6, the others at 9 and 8: one violation of half.
        let mean = (violations.iter().sum::<f64>() + 0.5) / 5.0;
        assert!((loss - mean).abs() < 1e-5, "{loss} is not {mean}");
    }

    #[test]
    fn classes_that_are_apart_have_no_loss_and_no_gradient() {
        let mut gradient = [7.0; 4];
        assert_eq!(loss(&[0.0, 0.1, 5.0, 5.1], 1, 2, 1.0, &mut gradient), 0.0);
        assert_eq!(gradient, [0.0; 4]);
    }

    #[test]
    fn the_gradient_is_that_of_the_loss() {
        const STEP: f64 = 1e-6;
        let mut stream = Stream::derive(1, Purpose::Train, 0);
        let mut embeddings: Vec<f64> = (0..3 * 4 * 2).map(|_| stream.between(-1.0, 1.0)).collect();
        let mut gradient = vec![0.0; embeddings.len()];
        let of = |embeddings: &[f64], gradient: &mut [f64]| loss(embeddings, 2, 4, 0.3, gradient);
        of(&embeddings, &mut gradient);
        for i in 0..embeddings.len() {
            let value = embeddings[i];
            let [above, below] = [STEP, -STEP].map(|step| {
                embeddings[i] = value + step;
                of(&embeddings, &mut [0.0; 24])
            });
            embeddings[i] = value;
            let slope = (above - below) / (2.0 * STEP);
            assert!(
                (gradient[i] - slope).abs() < 1e-7,
                "{i}: {}, not {slope}",
                gradient[i]
            );
        }
    }
}
