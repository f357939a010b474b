//! Recipes that train a trained network further, on labels.

use super::{RandomTriplets, crop, size};
use crate::{
    Invalid,
    invalid::{positive, real, whole},
};
use murmuration_proto::v1;

/// The numbers of the labelled recipe. A step has equally many pictures of every class, and its loss counts all violated
/// triplets. A triplet's weight is the number of labels of the negative's class times the square root of the number of labels
/// of the anchor's class. Anchors of the class `random` count less, because two behaviours that fit no other class need not be
/// alike. Triplets of unlabelled behaviours, as in [`InBatch`](super::InBatch), keep behaviours apart that no annotator has
/// named yet. The weights after the last epoch are published: no labels are held out, because there may be few.
#[derive(Debug, Clone, PartialEq)]
pub struct Labelled {
    /// Distance by which a negative must be farther than the positive, over 0 and at most 1,000.
    pub margin: f64,
    /// Number of pictures of each class in a step, 2 to 1,024. If a class has fewer pictures, they are repeated, mirrored or
    /// rotated.
    pub per_class: usize,
    /// Maximum number of classes in a step, 2 to 1,024. If there are more classes, each step draws some of them.
    pub classes: usize,
    /// Weight of a triplet whose anchor is of the class `random`, relative to other triplets, 0 to 1.
    pub random_anchors: f64,
    /// Number of unlabelled anchors per step, each with a positive, 2 to 65,536, or all behaviours if there are fewer.
    pub unlabelled: usize,
    /// Weight of the loss of unlabelled triplets, relative to the loss of labelled triplets, 0 to 1,000.
    pub unlabelled_weight: f64,
    /// Number of labels, 1 to 1,000,000, from which on `steps` and `unlabelled_weight` apply unchanged. With fewer labels, which
    /// a network soon memorises, an epoch has proportionally fewer steps, and unlabelled triplets have proportionally more
    /// weight.
    pub enough_labels: usize,
    /// Steps per epoch, 1 to 100,000.
    pub steps: usize,
    /// Number of epochs, 1 to 100,000.
    pub epochs: u64,
    /// Adam's first learning rate, over 0 and at most 1. The rate falls linearly to zero over all epochs.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// Smallest and largest share of width and height that a crop of a labelled picture keeps, over 0 and at most 2. Above 1, the
    /// picture shrinks on a black background.
    pub crop: [f64; 2],
    /// Smallest and largest share of width and height that a crop of an unlabelled picture keeps, over 0 and at most 2.
    pub unlabelled_crop: [f64; 2],
}

impl Default for Labelled {
    fn default() -> Self {
        Self {
            margin: 1.0,
            per_class: 12,
            classes: 16,
            random_anchors: 0.25,
            unlabelled: 64,
            unlabelled_weight: 0.25,
            enough_labels: 200,
            steps: 20,
            epochs: 10,
            learning_rate: 3e-3,
            weight_decay: 1e-6,
            crop: [1.0, 1.0],
            unlabelled_crop: [0.7, 1.3],
        }
    }
}

impl Labelled {
    /// The recipe for this number of labels; no label counts as one label.
    #[must_use]
    pub fn for_labels(&self, labels: usize) -> Self {
        let share = (labels.max(1) as f64 / self.enough_labels as f64).min(1.0);
        Self {
            steps: ((self.steps as f64 * share).ceil() as usize).max(1),
            unlabelled_weight: self.unlabelled_weight / share,
            ..self.clone()
        }
    }
}

impl TryFrom<v1::Labelled> for Labelled {
    type Error = Invalid;

    fn try_from(message: v1::Labelled) -> Result<Self, Invalid> {
        let default = Self::default();
        let per_class = size(message.per_class, default.per_class);
        let classes = size(message.classes, default.classes);
        let random_anchors = message.random_anchors.unwrap_or(default.random_anchors);
        let unlabelled = size(message.unlabelled, default.unlabelled);
        let unlabelled_weight = message.unlabelled_weight.unwrap_or(default.unlabelled_weight);
        let enough_labels = size(message.enough_labels, default.enough_labels);
        let steps = size(message.steps, default.steps);
        let epochs = message.epochs.unwrap_or(default.epochs);
        let learning_rate = message.learning_rate.unwrap_or(default.learning_rate);
        let weight_decay = message.weight_decay.unwrap_or(default.weight_decay);
        let unlabelled_crop = &message.unlabelled_crop;
        Ok(Self {
            margin: positive("margin", message.margin.unwrap_or(default.margin), 1000.0)?,
            per_class: whole("per_class", per_class, 2..=1024)?,
            classes: whole("classes", classes, 2..=1024)?,
            random_anchors: real("random_anchors", random_anchors, 0.0..=1.0)?,
            unlabelled: whole("unlabelled", unlabelled, 2..=65_536)?,
            unlabelled_weight: real("unlabelled_weight", unlabelled_weight, 0.0..=1000.0)?,
            enough_labels: whole("enough_labels", enough_labels, 1..=1_000_000)?,
            steps: whole("steps", steps, 1..=100_000)?,
            epochs: whole("epochs", epochs, 1..=100_000)?,
            learning_rate: positive("learning_rate", learning_rate, 1.0)?,
            weight_decay: real("weight_decay", weight_decay, 0.0..=1.0)?,
            crop: crop("crop", &message.crop, default.crop)?,
            unlabelled_crop: crop("unlabelled_crop", unlabelled_crop, default.unlabelled_crop)?,
        })
    }
}

impl From<&Labelled> for v1::Labelled {
    fn from(recipe: &Labelled) -> Self {
        Self {
            margin: Some(recipe.margin),
            per_class: Some(recipe.per_class as u64),
            classes: Some(recipe.classes as u64),
            random_anchors: Some(recipe.random_anchors),
            unlabelled: Some(recipe.unlabelled as u64),
            unlabelled_weight: Some(recipe.unlabelled_weight),
            enough_labels: Some(recipe.enough_labels as u64),
            steps: Some(recipe.steps as u64),
            epochs: Some(recipe.epochs),
            learning_rate: Some(recipe.learning_rate),
            weight_decay: Some(recipe.weight_decay),
            crop: recipe.crop.to_vec(),
            unlabelled_crop: recipe.unlabelled_crop.to_vec(),
        }
    }
}

/// The numbers of the paper's recipe on labels. Anchor and negative are unchanged labelled pictures of two classes. The
/// positive is another picture of the anchor's class, or the augmented anchor.
#[derive(Debug, Clone, PartialEq)]
pub struct PaperLabelled {
    /// Share of the triplets whose positive is the augmented anchor, 0 to 1. An anchor that is alone in its class always has this
    /// positive.
    pub augmented: f64,
    /// The numbers that the paper's recipe without labels has too.
    pub triplets: RandomTriplets,
}

impl Default for PaperLabelled {
    fn default() -> Self {
        Self {
            augmented: 0.6,
            triplets: RandomTriplets {
                epochs: 300,
                ..RandomTriplets::default()
            },
        }
    }
}

impl TryFrom<v1::PaperLabelled> for PaperLabelled {
    type Error = Invalid;

    fn try_from(message: v1::PaperLabelled) -> Result<Self, Invalid> {
        let default = Self::default();
        let augmented = message.augmented.unwrap_or(default.augmented);
        let triplets = v1::RandomTriplets {
            margin: message.margin,
            batch: message.batch,
            steps: message.steps,
            learning_rate: message.learning_rate,
            weight_decay: message.weight_decay,
            plateau: message.plateau,
            plateau_factor: message.plateau_factor,
            epochs: message.epochs,
            enough: message.enough,
            enough_over: message.enough_over,
            crop: message.crop,
        };
        Ok(Self {
            augmented: real("augmented", augmented, 0.0..=1.0)?,
            triplets: RandomTriplets::with_default(triplets, &default.triplets)?,
        })
    }
}

impl From<&PaperLabelled> for v1::PaperLabelled {
    fn from(recipe: &PaperLabelled) -> Self {
        let triplets = v1::RandomTriplets::from(&recipe.triplets);
        Self {
            augmented: Some(recipe.augmented),
            margin: triplets.margin,
            batch: triplets.batch,
            steps: triplets.steps,
            learning_rate: triplets.learning_rate,
            weight_decay: triplets.weight_decay,
            plateau: triplets.plateau,
            plateau_factor: triplets.plateau_factor,
            epochs: triplets.epochs,
            enough: triplets.enough,
            enough_over: triplets.enough_over,
            crop: triplets.crop,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fewer_labels_than_enough_are_learned_from_in_fewer_steps() {
        let recipe = Labelled::default();
        let few = recipe.for_labels(50);
        assert_eq!((few.steps, few.unlabelled_weight), (5, 1.0));
        assert_eq!(recipe.for_labels(0).steps, 1);
        for many in [200, 2000] {
            assert_eq!(recipe.for_labels(many), recipe);
        }
    }
}
