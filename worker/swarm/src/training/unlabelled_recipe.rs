//! Recipes that learn without labels.

use super::{crop, size};
use crate::{
    Invalid,
    invalid::{positive, real, whole},
};
use murmuration_proto::v1;

/// The numbers of the paper's recipe ("Data and Network Architecture"; the margin is from the authors' code). Only the
/// positive is augmented, not the anchor and the negative.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomTriplets {
    /// Distance by which a negative must be farther than the positive, over 0 and at most 1,000.
    pub margin: f64,
    /// Triplets per step, 1 to 65,536.
    pub batch: usize,
    /// Steps per epoch, each with new triplets, 1 to 100,000.
    pub steps: usize,
    /// Adam's first learning rate, over 0 and at most 1.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// The learning rate falls after more than this many consecutive epochs without a lower loss, 1 to 100,000.
    pub plateau: u64,
    /// The factor by which the learning rate falls, over 0 and at most 1.
    pub plateau_factor: f64,
    /// Maximum number of epochs, 1 to 100,000.
    pub epochs: u64,
    /// Training stops when the mean loss of the last `enough_over` epochs is under this value, 0 or more.
    pub enough: f64,
    /// Number of epochs in the mean for `enough`, 1 to 10,000.
    pub enough_over: usize,
    /// Smallest and largest share of width and height that a crop keeps, over 0 and at most 2. Above 1, the picture shrinks on a
    /// black background.
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
    /// Validates a message, whose absent fields take the values of `default`.
    pub(super) fn with_default(message: v1::RandomTriplets, default: &Self) -> Result<Self, Invalid> {
        let batch = size(message.batch, default.batch);
        let steps = size(message.steps, default.steps);
        let learning_rate = message.learning_rate.unwrap_or(default.learning_rate);
        let weight_decay = message.weight_decay.unwrap_or(default.weight_decay);
        let plateau = message.plateau.unwrap_or(default.plateau);
        let plateau_factor = message.plateau_factor.unwrap_or(default.plateau_factor);
        let epochs = message.epochs.unwrap_or(default.epochs);
        let enough = message.enough.unwrap_or(default.enough);
        let enough_over = size(message.enough_over, default.enough_over);
        Ok(Self {
            margin: positive("margin", message.margin.unwrap_or(default.margin), 1000.0)?,
            batch: whole("batch", batch, 1..=65_536)?,
            steps: whole("steps", steps, 1..=100_000)?,
            learning_rate: positive("learning_rate", learning_rate, 1.0)?,
            weight_decay: real("weight_decay", weight_decay, 0.0..=1.0)?,
            plateau: whole("plateau", plateau, 1..=100_000)?,
            plateau_factor: positive("plateau_factor", plateau_factor, 1.0)?,
            epochs: whole("epochs", epochs, 1..=100_000)?,
            enough: real("enough", enough, 0.0..=1e9)?,
            enough_over: whole("enough_over", enough_over, 1..=10_000)?,
            crop: crop("crop", &message.crop, default.crop)?,
        })
    }
}

impl TryFrom<v1::RandomTriplets> for RandomTriplets {
    type Error = Invalid;

    fn try_from(message: v1::RandomTriplets) -> Result<Self, Invalid> {
        Self::with_default(message, &Self::default())
    }
}

impl From<&RandomTriplets> for v1::RandomTriplets {
    fn from(recipe: &RandomTriplets) -> Self {
        Self {
            margin: Some(recipe.margin),
            batch: Some(recipe.batch as u64),
            steps: Some(recipe.steps as u64),
            learning_rate: Some(recipe.learning_rate),
            weight_decay: Some(recipe.weight_decay),
            plateau: Some(recipe.plateau),
            plateau_factor: Some(recipe.plateau_factor),
            epochs: Some(recipe.epochs),
            enough: Some(recipe.enough),
            enough_over: Some(recipe.enough_over as u64),
            crop: recipe.crop.to_vec(),
        }
    }
}

/// The numbers of the in-batch recipe. Anchors and positives are augmented.
#[derive(Debug, Clone, PartialEq)]
pub struct InBatch {
    /// Distance by which a negative must be farther than the positive, over 0 and at most 1,000.
    pub margin: f64,
    /// Number of anchors per step, each with a positive, 2 to 65,536, or all behaviours if there are fewer.
    pub batch: usize,
    /// Adam's first learning rate, over 0 and at most 1. The rate falls linearly to zero over all epochs.
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
    /// Smallest and largest share of width and height that a crop keeps, over 0 and at most 2. Above 1, the picture shrinks on a
    /// black background.
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

impl TryFrom<v1::InBatch> for InBatch {
    type Error = Invalid;

    fn try_from(message: v1::InBatch) -> Result<Self, Invalid> {
        let default = Self::default();
        let batch = size(message.batch, default.batch);
        let learning_rate = message.learning_rate.unwrap_or(default.learning_rate);
        let weight_decay = message.weight_decay.unwrap_or(default.weight_decay);
        let flattening = message.flattening.unwrap_or(default.flattening);
        let epochs = message.epochs.unwrap_or(default.epochs);
        let patience = message.patience.unwrap_or(default.patience);
        Ok(Self {
            margin: positive("margin", message.margin.unwrap_or(default.margin), 1000.0)?,
            batch: whole("batch", batch, 2..=65_536)?,
            learning_rate: positive("learning_rate", learning_rate, 1.0)?,
            weight_decay: real("weight_decay", weight_decay, 0.0..=1.0)?,
            flattening: whole("flattening", flattening, 0..=8)?,
            epochs: whole("epochs", epochs, 1..=100_000)?,
            patience: whole("patience", patience, 1..=100_000)?,
            crop: crop("crop", &message.crop, default.crop)?,
        })
    }
}

impl From<&InBatch> for v1::InBatch {
    fn from(recipe: &InBatch) -> Self {
        Self {
            margin: Some(recipe.margin),
            batch: Some(recipe.batch as u64),
            learning_rate: Some(recipe.learning_rate),
            weight_decay: Some(recipe.weight_decay),
            flattening: Some(recipe.flattening),
            epochs: Some(recipe.epochs),
            patience: Some(recipe.patience),
            crop: recipe.crop.to_vec(),
        }
    }
}
