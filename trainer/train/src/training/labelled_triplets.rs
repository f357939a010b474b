//! An epoch of the paper's recipe on labels: new random triplets of labelled pictures.

use super::{
    EpochLoss, Training,
    triplets::{Triplet, learn},
};
use crate::labelled_pictures::LabelledPictures;
use murmuration_swarm::{RandomStream, training::PaperLabelled};
use rand::RngExt as _;

pub(super) fn epoch(
    training: &mut Training,
    labelled: &LabelledPictures,
    recipe: &PaperLabelled,
    stream: &mut RandomStream,
) -> EpochLoss {
    let PaperLabelled { augmented, triplets } = recipe;
    let mut total = 0.0;
    for _ in 0..triplets.steps {
        let drawn = (0..triplets.batch).map(|_| Drawn::draw(labelled, *augmented, stream).of(labelled));
        let drawn: Vec<Triplet> = drawn.collect();
        total += learn(training, triplets, &drawn, stream.random());
    }
    EpochLoss {
        mean: total / triplets.steps as f64,
        triplets: (triplets.steps * triplets.batch) as u64,
    }
}

/// The pictures of a triplet. If `positive` is `None`, the positive is made from the anchor.
struct Drawn {
    anchor: usize,
    positive: Option<usize>,
    negative: usize,
}

impl Drawn {
    /// Draws the anchor uniformly from all pictures, and the negative uniformly from the pictures of other classes.
    fn draw(labelled: &LabelledPictures, augmented: f64, stream: &mut RandomStream) -> Self {
        let below = |count: usize, stream: &mut RandomStream| stream.below(count as u64) as usize;
        let pictures = labelled.by_class();
        let anchor = below(pictures.len(), stream);
        let class = labelled.ranges().partition_point(|range| range.end <= anchor);
        let own = labelled.ranges()[class].clone();
        let positive = (own.len() > 1 && stream.random::<f64>() >= augmented)
            .then(|| own.start + (anchor - own.start + 1 + below(own.len() - 1, stream)) % own.len());
        let other = below(pictures.len() - own.len(), stream);
        let negative = if other < own.start {
            other
        } else {
            other + own.len()
        };
        Self {
            anchor: pictures[anchor],
            positive: positive.map(|positive| pictures[positive]),
            negative: pictures[negative],
        }
    }

    fn of(self, labelled: &LabelledPictures) -> Triplet<'_> {
        Triplet {
            anchor: labelled.picture(self.anchor),
            positive: self.positive.map(|positive| labelled.picture(positive)),
            negative: labelled.picture(self.negative),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;
    use murmuration_swarm::Purpose;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_positive_is_another_of_the_class_and_a_negative_of_another(
            classes in prop::collection::vec(0..6u32, 2..20),
            augmented in 0.0..=1.0,
            seed: u64,
        ) {
            prop_assume!(classes.iter().any(|&class| class != classes[0]));
            let labelled = LabelledPictures::new(grey(1), vec![0; classes.len()], classes.clone()).unwrap();
            let mut stream = RandomStream::derive(seed, Purpose::Train, 0);
            for _ in 0..50 {
                let Drawn { anchor, positive, negative } = Drawn::draw(&labelled, augmented, &mut stream);
                prop_assert_ne!(classes[anchor], classes[negative]);
                if let Some(positive) = positive {
                    prop_assert!(positive != anchor && classes[positive] == classes[anchor]);
                }
            }
        }
    }

    #[test]
    fn as_many_positives_are_augmented_anchors_as_the_recipe_says() {
        let labelled = LabelledPictures::new(grey(1), vec![0; 6], vec![0, 0, 0, 1, 1, 1]).unwrap();
        let mut stream = RandomStream::derive(1, Purpose::Train, 0);
        let drawn = (0..10_000).map(|_| Drawn::draw(&labelled, 0.6, &mut stream));
        let augmented = drawn.filter(|triplet| triplet.positive.is_none()).count();
        assert!((5_800..6_200).contains(&augmented), "{augmented}");
    }
}
