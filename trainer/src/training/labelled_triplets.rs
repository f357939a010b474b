//! An epoch of the paper's recipe on labels: fresh random triplets of labelled pictures.

use super::{
    EpochLoss, Training,
    random_triplets::{CHUNK, learn},
};
use crate::{augment::Augmentation, labelled_pictures::LabelledPictures, network::scaled};
use murmuration_proto::{Purpose, Stream, training::PaperLabelled};

pub(super) fn epoch(
    training: &mut Training,
    labelled: &LabelledPictures,
    recipe: &PaperLabelled,
    stream: &mut Stream,
) -> EpochLoss {
    let mut total = 0.0;
    for _ in 0..recipe.steps {
        let drawn = (0..recipe.batch).map(|_| Triplet::draw(labelled, recipe.augmented, stream));
        let batch = Batch {
            labelled,
            triplets: drawn.collect(),
            augmentation: Augmentation::from(training.configuration.recipe()),
            key: stream.bits(),
        };
        total += learn(training, &recipe.triplets(), |chunk, images| {
            batch.append(chunk, images)
        });
    }
    EpochLoss {
        mean: total / recipe.steps as f64,
        triplets: (recipe.steps * recipe.batch) as u64,
    }
}

/// Which pictures a triplet is made of; without another positive, it is made of the anchor.
struct Triplet {
    anchor: usize,
    positive: Option<usize>,
    negative: usize,
}

impl Triplet {
    /// Classes are drawn in proportion to their pictures: an anchor is any picture, a negative any of another class.
    fn draw(labelled: &LabelledPictures, augmented: f64, stream: &mut Stream) -> Self {
        let below = |count: usize, stream: &mut Stream| stream.below(count as u64) as usize;
        let pictures = labelled.by_class();
        let anchor = below(pictures.len(), stream);
        let class = labelled.ranges().partition_point(|range| range.end <= anchor);
        let own = labelled.ranges()[class].clone();
        let positive = (own.len() > 1 && stream.unit() >= augmented)
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
}

struct Batch<'a> {
    labelled: &'a LabelledPictures,
    triplets: Vec<Triplet>,
    augmentation: Augmentation,
    /// Seed of the augmentations.
    key: u64,
}

impl Batch<'_> {
    /// Appends the images of a chunk: all anchors, all positives, all negatives.
    fn append(&self, chunk: usize, images: &mut Vec<f32>) {
        let first = chunk * CHUNK;
        let triplets = &self.triplets[first..(first + CHUNK).min(self.triplets.len())];
        let side = self.labelled.side();
        let plain = |picture| {
            self.labelled
                .picture(picture)
                .iter()
                .map(|&grey| scaled::<f32>(grey))
        };
        images.extend(triplets.iter().flat_map(|triplet| plain(triplet.anchor)));
        for (i, triplet) in triplets.iter().enumerate() {
            match triplet.positive {
                Some(positive) => images.extend(plain(positive)),
                None => {
                    let start = images.len();
                    images.resize(start + side * side, 0.0);
                    let mut stream = Stream::derive(self.key, Purpose::Augment, (first + i) as u64);
                    let picture = self.labelled.picture(triplet.anchor);
                    self.augmentation
                        .apply(picture, side, &mut stream, &mut images[start..]);
                }
            }
        }
        images.extend(triplets.iter().flat_map(|triplet| plain(triplet.negative)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_positive_is_another_of_the_class_and_a_negative_of_another(
            classes in prop::collection::vec(0..6u32, 2..20),
            augmented in 0.0..=1.0,
            seed: u64,
        ) {
            prop_assume!(classes.iter().any(|&class| class != classes[0]));
            let labelled = LabelledPictures::new(1, vec![0; classes.len()], classes.clone()).unwrap();
            let mut stream = Stream::derive(seed, Purpose::Train, 0);
            for _ in 0..50 {
                let Triplet { anchor, positive, negative } = Triplet::draw(&labelled, augmented, &mut stream);
                prop_assert_ne!(classes[anchor], classes[negative]);
                if let Some(positive) = positive {
                    prop_assert!(positive != anchor && classes[positive] == classes[anchor]);
                }
            }
        }
    }

    #[test]
    fn as_many_positives_are_augmented_anchors_as_the_recipe_says() {
        let labelled = LabelledPictures::new(1, vec![0; 6], vec![0, 0, 0, 1, 1, 1]).unwrap();
        let mut stream = Stream::derive(1, Purpose::Train, 0);
        let drawn = (0..10_000).map(|_| Triplet::draw(&labelled, 0.6, &mut stream));
        let augmented = drawn.filter(|triplet| triplet.positive.is_none()).count();
        assert!((5_800..6_200).contains(&augmented), "{augmented}");
    }
}
