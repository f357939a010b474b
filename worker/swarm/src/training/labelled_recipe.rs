//! Recipes that train a trained network further, on labels.

use super::unlabelled_recipe::{RandomTriplets, check_crop};
use crate::{
    Invalid,
    invalid::{positive, real, whole},
};
use serde::{Deserialize, Serialize};

/// The numbers of the labelled recipe. A step has equally many pictures of every class, and its loss counts all violated
/// triplets. A triplet's weight is the number of labels of the negative's class times the square root of the number of labels
/// of the anchor's class. Anchors of the class `random` count less, because two behaviours that fit no other class need not be
/// alike. Triplets of unlabelled behaviours, as in [`InBatch`](super::InBatch), keep behaviours apart that no annotator has
/// named yet. The weights after the last epoch are published: no labels are held out, because there may be few.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Labelled {
    /// Distance by which a negative must be farther than the positive, over 0 to 1,000.
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
    /// Adam's first learning rate, over 0 to 1. The rate falls linearly to zero over all epochs.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// Smallest and largest share of width and height that a crop of a labelled picture keeps, over 0 to 2. Above 1, the
    /// picture shrinks on a black background.
    pub crop: [f64; 2],
    /// Smallest and largest share of width and height that a crop of an unlabelled picture keeps, over 0 to 2.
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

    pub(super) fn check(&self) -> Result<(), Invalid> {
        positive("margin", self.margin, 1000.0)?;
        whole("per_class", self.per_class, 2..=1024)?;
        whole("classes", self.classes, 2..=1024)?;
        real("random_anchors", self.random_anchors, 0.0..=1.0)?;
        whole("unlabelled", self.unlabelled, 2..=65_536)?;
        real("unlabelled_weight", self.unlabelled_weight, 0.0..=1000.0)?;
        whole("enough_labels", self.enough_labels, 1..=1_000_000)?;
        whole("steps", self.steps, 1..=100_000)?;
        whole("epochs", self.epochs, 1..=100_000)?;
        positive("learning_rate", self.learning_rate, 1.0)?;
        real("weight_decay", self.weight_decay, 0.0..=1.0)?;
        check_crop("crop", self.crop)?;
        check_crop("unlabelled_crop", self.unlabelled_crop)
    }
}

/// The numbers of the paper's recipe on labels. Anchor and negative are unchanged labelled pictures of two classes. The
/// positive is another picture of the anchor's class, or the augmented anchor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PaperLabelled {
    /// Share of the triplets whose positive is the augmented anchor, 0 to 1. An anchor that is alone in its class always has this
    /// positive.
    pub augmented: f64,
    /// Distance by which a negative must be farther than the positive. This and the following fields have the limits of
    /// [`RandomTriplets`].
    pub margin: f64,
    /// Triplets per step.
    pub batch: usize,
    /// Steps per epoch.
    pub steps: usize,
    /// Adam's first learning rate.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient.
    pub weight_decay: f64,
    /// The learning rate falls after more than this many consecutive epochs without a lower loss.
    pub plateau: u64,
    /// The factor by which the learning rate falls.
    pub plateau_factor: f64,
    /// Maximum number of epochs.
    pub epochs: u64,
    /// Mean loss under which training stops.
    pub enough: f64,
    /// Number of epochs in the mean of `enough`.
    pub enough_over: usize,
    /// Smallest and largest share of width and height that a crop keeps.
    pub crop: [f64; 2],
}

impl Default for PaperLabelled {
    fn default() -> Self {
        let paper = RandomTriplets::default();
        Self {
            augmented: 0.6,
            margin: paper.margin,
            batch: paper.batch,
            steps: paper.steps,
            learning_rate: paper.learning_rate,
            weight_decay: paper.weight_decay,
            plateau: paper.plateau,
            plateau_factor: paper.plateau_factor,
            epochs: 300,
            enough: paper.enough,
            enough_over: paper.enough_over,
            crop: paper.crop,
        }
    }
}

impl PaperLabelled {
    /// The fields shared with the paper's recipe without labels.
    #[must_use]
    pub const fn triplets(&self) -> RandomTriplets {
        RandomTriplets {
            margin: self.margin,
            batch: self.batch,
            steps: self.steps,
            learning_rate: self.learning_rate,
            weight_decay: self.weight_decay,
            plateau: self.plateau,
            plateau_factor: self.plateau_factor,
            epochs: self.epochs,
            enough: self.enough,
            enough_over: self.enough_over,
            crop: self.crop,
        }
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        real("augmented", self.augmented, 0.0..=1.0)?;
        self.triplets().check()
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
