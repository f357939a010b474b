//! How a network is trained: two recipes by name, with every number of theirs.

use crate::augment::{Augmentation, Symmetries};
use serde::{Deserialize, Serialize};

/// A way to train.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Recipe {
    /// The paper's: random negatives, a large margin.
    Paper(RandomTriplets),
    /// The default: every other image of the batch is a negative.
    InBatch(InBatch),
}

impl Default for Recipe {
    fn default() -> Self {
        Self::InBatch(InBatch::default())
    }
}

/// The numbers of the paper's recipe ("Simulation and Data"; the margin from the authors' code).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RandomTriplets {
    /// Distance by which a negative must be farther than the positive, over 0 to 1,000.
    pub margin: f64,
    /// Triplets a step, 1 to 65,536.
    pub batch: usize,
    /// Triplets an epoch, each used once, `batch` to 10,000,000.
    pub triplets: usize,
    /// Adam's first learning rate, over 0 to 1.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// Epochs without a lower loss after which the learning rate falls, 1 to 10,000.
    pub plateau: usize,
    /// What it is then multiplied by, over 0 to 1.
    pub plateau_factor: f64,
    /// Most epochs, 1 to 100,000.
    pub epochs: usize,
    /// Mean loss of the last `enough_over` epochs at which training stops, 0 or more.
    pub enough: f64,
    /// Epochs that `enough` is a mean over, 1 to 10,000.
    pub enough_over: usize,
    /// Least and greatest share of width and height that a positive's crop keeps, over 0 to 2.
    pub crop: [f64; 2],
}

impl Default for RandomTriplets {
    fn default() -> Self {
        Self {
            margin: 10.0,
            batch: 4096,
            triplets: 16_384,
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
    pub(crate) const fn augmentation(&self) -> Augmentation {
        Augmentation {
            crop: self.crop,
            symmetries: Symmetries::Turns,
            gain: 0.0,
            noise: 0.0,
            erase: 0.0,
        }
    }
}

/// The numbers of the in-batch recipe.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InBatch {
    /// Distance by which a negative must be farther than the positive, over 0 to 1,000.
    pub margin: f64,
    /// Anchors a step, each with a positive, 2 to 65,536.
    pub batch: usize,
    /// Adam's learning rate, over 0 to 1.
    pub learning_rate: f64,
    /// Share of the weights that is added to the gradient, 0 to 1.
    pub weight_decay: f64,
    /// Most epochs (each shows every controller once), 1 to 100,000.
    pub epochs: usize,
    /// Epochs without a better accuracy on held-out triplets after which training stops, 1 to 100,000.
    pub patience: usize,
    /// Share of the controllers that is held out, over 0 to 0.5 (at most 1,000 controllers).
    pub held_out: f64,
    /// Least and greatest share of width and height that a crop keeps, over 0 to 2.
    pub crop: [f64; 2],
    /// x
    pub gain: f64,
    /// x
    pub noise: f64,
    /// x
    pub erase: f64,
    /// x
    pub cosine: bool,
    /// x
    pub ema: f64,
    /// Experimental loss
    pub temperature: f64,
}

impl Default for InBatch {
    fn default() -> Self {
        Self {
            margin: 1.0,
            batch: 256,
            learning_rate: 1e-3,
            weight_decay: 1e-6,
            epochs: 12,
            patience: 100,
            held_out: 0.1,
            crop: [0.6, 1.0],
            gain: 0.0,
            noise: 0.0,
            erase: 0.0,
            cosine: false,
            ema: 0.0,
            temperature: 0.0,
        }
    }
}

impl InBatch {
    pub(crate) const fn augmentation(&self) -> Augmentation {
        Augmentation {
            crop: self.crop,
            symmetries: Symmetries::All,
            gain: self.gain,
            noise: self.noise,
            erase: self.erase,
        }
    }
}
