//! Recipes that learn without labels.

use crate::{
    Invalid,
    invalid::{positive, real, whole},
};
use serde::{Deserialize, Serialize};

/// The numbers of the paper's recipe ("Data and Network Architecture"; the margin is from the authors' code). Only the
/// positive is augmented, not the anchor and the negative.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RandomTriplets {
    /// Distance by which a negative must be farther than the positive, over 0 to 1,000.
    pub margin: f64,
    /// Triplets per step, 1 to 65,536.
    pub batch: usize,
    /// Steps per epoch, each with new triplets, 1 to 100,000.
    pub steps: usize,
    /// Adam's first learning rate, over 0 to 1.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// The learning rate falls after more than this many consecutive epochs without a lower loss, 1 to 100,000.
    pub plateau: u64,
    /// The factor by which the learning rate falls, over 0 to 1.
    pub plateau_factor: f64,
    /// Maximum number of epochs, 1 to 100,000.
    pub epochs: u64,
    /// Training stops when the mean loss of the last `enough_over` epochs is under this value, 0 or more.
    pub enough: f64,
    /// Number of epochs in the mean for `enough`, 1 to 10,000.
    pub enough_over: usize,
    /// Smallest and largest share of width and height that a crop keeps, over 0 to 2. Above 1, the picture shrinks on a black
    /// background.
    pub crop: [f64; 2],
}

impl Default for RandomTriplets {
    fn default() -> Self {
        Self {
            margin: 10.0,
            batch: 4096,
            steps: 4,
            learning_rate: 0.08,
            weight_decay: 1e-6,
            plateau: 15,
            plateau_factor: 0.1,
            epochs: 500,
            enough: 1e-3,
            enough_over: 10,
            crop: [0.6, 1.0],
        }
    }
}

impl RandomTriplets {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        positive("margin", self.margin, 1000.0)?;
        whole("batch", self.batch, 1..=65_536)?;
        whole("steps", self.steps, 1..=100_000)?;
        positive("learning_rate", self.learning_rate, 1.0)?;
        real("weight_decay", self.weight_decay, 0.0..=1.0)?;
        whole("plateau", self.plateau, 1..=100_000)?;
        positive("plateau_factor", self.plateau_factor, 1.0)?;
        whole("epochs", self.epochs, 1..=100_000)?;
        real("enough", self.enough, 0.0..=1e9)?;
        whole("enough_over", self.enough_over, 1..=10_000)?;
        check_crop("crop", self.crop)
    }
}

/// The numbers of the in-batch recipe. Anchors and positives are augmented.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InBatch {
    /// Distance by which a negative must be farther than the positive, over 0 to 1,000.
    pub margin: f64,
    /// Number of anchors per step, each with a positive, 2 to 65,536, or all behaviours if there are fewer.
    pub batch: usize,
    /// Adam's first learning rate, over 0 to 1. The rate falls linearly to zero over all epochs.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// Exponent, 0 to 8, by which training shows rare behaviours more often than common behaviours. A behaviour's weight in the
    /// draw is the distance to its 15th neighbour in the features, to this power. With 0, an epoch shows each behaviour once.
    pub flattening: u32,
    /// Maximum number of epochs, 1 to 100,000. An epoch shows as many behaviours as are not held out.
    pub epochs: u64,
    /// Consecutive epochs without a better accuracy on held-out triplets after which training stops, 1 to 100,000.
    pub patience: u64,
    /// Smallest and largest share of width and height that a crop keeps, over 0 to 2. Above 1, the picture shrinks on a black
    /// background.
    pub crop: [f64; 2],
}

impl Default for InBatch {
    fn default() -> Self {
        Self {
            margin: 1.0,
            batch: 256,
            learning_rate: 3e-3,
            weight_decay: 1e-6,
            flattening: 2,
            epochs: 16,
            patience: 8,
            crop: [0.7, 1.3],
        }
    }
}

impl InBatch {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        positive("margin", self.margin, 1000.0)?;
        whole("batch", self.batch, 2..=65_536)?;
        positive("learning_rate", self.learning_rate, 1.0)?;
        real("weight_decay", self.weight_decay, 0.0..=1.0)?;
        whole("flattening", self.flattening, 0..=8)?;
        whole("epochs", self.epochs, 1..=100_000)?;
        whole("patience", self.patience, 1..=100_000)?;
        check_crop("crop", self.crop)
    }
}

pub(super) fn check_crop(field: &str, crop: [f64; 2]) -> Result<(), Invalid> {
    positive(&format!("{field}[0]"), crop[0], 2.0)?;
    real(&format!("{field}[1]"), crop[1], crop[0]..=2.0)?;
    Ok(())
}
