//! The progress of a training.

use crate::quality::Quality;

/// The outcome of an epoch.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Epochs done, 1 or more.
    pub epoch: u64,
    /// Maximum number of epochs.
    pub epochs: u64,
    /// Mean loss of the epoch's steps.
    pub loss: f64,
    /// Learning rate of the epoch's last step.
    pub learning_rate: f64,
    /// Triplets that the epoch learned from.
    pub triplets: u64,
    /// Time of its steps, seconds, without the measurement of quality.
    pub seconds: f64,
    /// The quality of the network after the epoch, on held-out behaviours.
    pub quality: Quality,
}

impl Progress {
    /// Triplets per second.
    #[must_use]
    pub fn triplets_per_second(&self) -> f64 {
        self.triplets as f64 / self.seconds
    }
}

/// Why a training has ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The last epoch is done.
    LastEpoch,
    /// The accuracy on held-out triplets did not improve for as many epochs as the recipe's patience.
    NoBetter,
    /// The loss is as low as the recipe requires.
    LowLoss,
    /// The loss is not finite: the learning rate is too high for the network.
    Diverged,
}
