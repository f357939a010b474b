//! An epoch of the labelled recipe: steps with equally many pictures of every class, and unlabelled pairs.

use super::{
    EpochLoss, Training,
    in_batch::{self, CHUNK},
};
use crate::{
    augment::{Augmentation, Symmetries},
    labelled_pictures::LabelledPictures,
    loss::{
        self,
        labelled::{ClassShare, Weights},
    },
};
use murmuration_swarm::{Purpose, RandomStream, training::Labelled};
use rand::RngExt as _;
use rayon::prelude::*;
use std::ops::Range;

pub(super) fn epoch(
    training: &mut Training,
    labelled: &LabelledPictures,
    recipe: &Labelled,
    stream: &mut RandomStream,
) -> EpochLoss {
    let recipe = &recipe.for_labels(labelled.labels());
    let mut deck = Deck::new(labelled, recipe, stream);
    let mut unlabelled = training.held_out.trained_on().to_vec();
    stream.shuffle(&mut unlabelled);
    let pairs = recipe.unlabelled.min(unlabelled.len());
    let mut left = unlabelled.iter().copied().cycle();
    let augmentation = Augmentation {
        crop: recipe.crop,
        symmetries: Symmetries::All,
    };
    let mut sum = EpochLoss {
        mean: 0.0,
        triplets: 0,
    };
    for step in 0..recipe.steps {
        let done = training.state.epoch as f64 + step as f64 / recipe.steps as f64;
        let rate = recipe.learning_rate * (1.0 - done / recipe.epochs as f64);
        training.state.schedule.set_learning_rate(rate);
        let Dealt { pictures, shares } = deck.deal(recipe, stream);
        let behaviours: Vec<usize> = left.by_ref().take(pairs).collect();
        let mut images = augmented(labelled, &pictures, augmentation, stream);
        images.extend(in_batch::augmented(training, &behaviours, stream));
        let weights = Weights::of_classes(&shares);
        sum.mean += self::step(training, recipe, pictures.len(), &weights, &images) / recipe.steps as f64;
        let others = pictures.len() - recipe.per_class;
        sum.triplets += (pictures.len() * (recipe.per_class - 1) * others + pairs * (pairs - 1)) as u64;
    }
    sum
}

/// Takes one step of the optimiser on `images`, and returns the loss of the step. The first `labelled` images have labels;
/// `weights` are the weights of their classes.
fn step(
    training: &mut Training,
    recipe: &Labelled,
    labelled: usize,
    weights: &Weights,
    images: &[f32],
) -> f64 {
    let state = &mut training.state;
    let dimensions = state.network.architecture().dimensions();
    let loss = training.shards.gradient_at_once(
        &state.network,
        images,
        CHUNK,
        |embeddings, gradient| {
            let margin = recipe.margin;
            let (named, unnamed) = embeddings.split_at(labelled * dimensions);
            let (by_named, by_unnamed) = gradient.split_at_mut(named.len());
            let labelled = loss::labelled::loss(named, dimensions, weights, margin, by_named);
            let unlabelled = loss::in_batch::loss(unnamed, dimensions, margin, by_unnamed);
            for slope in by_unnamed {
                *slope *= recipe.unlabelled_weight as f32;
            }
            labelled + recipe.unlabelled_weight * unlabelled
        },
        &mut training.gradient,
    );
    state.descend(&training.gradient, recipe.weight_decay);
    loss
}

/// The labelled pictures of each class in random order. Steps take these pictures in turn: no picture repeats before a step has
/// taken all other pictures of its class.
struct Deck {
    classes: Vec<Class>,
}

struct Class {
    pictures: Vec<usize>,
    next: usize,
    /// Weight of the class's anchors.
    anchors: f64,
}

/// The pictures of a step.
struct Dealt {
    /// Pictures of the step, class after class, equally many of each class.
    pictures: Vec<usize>,
    /// The share of each class of the step.
    shares: Vec<ClassShare>,
}

impl Deck {
    fn new(labelled: &LabelledPictures, recipe: &Labelled, stream: &mut RandomStream) -> Self {
        let class = |range: &Range<usize>| {
            let mut pictures = labelled.by_class()[range.clone()].to_vec();
            stream.shuffle(&mut pictures);
            let random = labelled.class(pictures[0]) == LabelledPictures::RANDOM;
            let anchors = if random { recipe.random_anchors } else { 1.0 };
            Class {
                pictures,
                next: 0,
                anchors,
            }
        };
        Self {
            classes: labelled.ranges().iter().map(class).collect(),
        }
    }

    /// The pictures of the next step.
    fn deal(&mut self, recipe: &Labelled, stream: &mut RandomStream) -> Dealt {
        if self.classes.len() > recipe.classes {
            stream.shuffle(&mut self.classes);
        }
        let most = recipe.classes.min(self.classes.len());
        let drawn = &mut self.classes[..most];
        let share = |class: &Class| ClassShare {
            size: class.pictures.len(),
            anchors: class.anchors,
        };
        let shares = drawn.iter().map(share).collect();
        let pictures = drawn.iter_mut().flat_map(|class| {
            let first = class.next;
            class.next = (first + recipe.per_class) % class.pictures.len();
            let pictures = class.pictures.iter().cycle().skip(first);
            pictures.take(recipe.per_class).copied().collect::<Vec<_>>()
        });
        Dealt {
            pictures: pictures.collect(),
            shares,
        }
    }
}

/// The images of the labelled pictures of a step.
fn augmented(
    labelled: &LabelledPictures,
    dealt: &[usize],
    augmentation: Augmentation,
    stream: &mut RandomStream,
) -> Vec<f32> {
    let shape = labelled.shape();
    let key = stream.random();
    let mut images = vec![0.0; dealt.len() * shape.bytes()];
    let places = images.par_chunks_mut(shape.bytes()).zip(dealt).enumerate();
    places.for_each(|(i, (image, &picture))| {
        let mut stream = RandomStream::derive(key, Purpose::Augment, i as u64);
        augmentation.apply(labelled.picture(picture), shape, &mut stream, image);
    });
    images
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_class_of_a_step_has_as_many_pictures_and_all_of_them_take_turns(
            classes in prop::collection::vec(0..6u32, 2..40),
            per_class in 2..9usize,
            most in 2..7usize,
        ) {
            prop_assume!(classes.iter().any(|&class| class != classes[0]));
            let labelled = LabelledPictures::new(grey(1), vec![0; classes.len()], classes.clone()).unwrap();
            let recipe = Labelled { per_class, classes: most, random_anchors: 0.25, ..Labelled::default() };
            let mut stream = RandomStream::derive(1, Purpose::Train, 0);
            let mut deck = Deck::new(&labelled, &recipe, &mut stream);
            let mut dealt = vec![0_usize; classes.len()];
            for _ in 0..5 {
                let Dealt { pictures, shares } = deck.deal(&recipe, &mut stream);
                prop_assert_eq!(pictures.len(), per_class * most.min(labelled.ranges().len()));
                prop_assert_eq!(shares.len() * per_class, pictures.len());
                for (class, share) in pictures.chunks_exact(per_class).zip(shares) {
                    let own = classes[class[0]];
                    prop_assert!(class.iter().all(|&picture| classes[picture] == own));
                    prop_assert_eq!(classes.iter().filter(|&&class| class == own).count(), share.size);
                    let anchors = if own == LabelledPictures::RANDOM { 0.25 } else { 1.0 };
                    prop_assert_eq!(share.anchors, anchors);
                }
                for picture in pictures {
                    dealt[picture] += 1;
                }
            }
            for range in labelled.ranges() {
                let times = labelled.by_class()[range.clone()].iter().map(|&picture| dealt[picture]);
                prop_assert!(times.clone().max().unwrap() - times.min().unwrap() <= 1);
            }
        }
    }
}
