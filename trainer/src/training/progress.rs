//! How far a training has come.

use crate::quality::Quality;

/// What an epoch came to.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    /// Epochs done, 1 or more.
    pub epoch: u64,
    /// Most epochs that there will be.
    pub epochs: u64,
    /// Mean loss of the epoch's steps.
    pub loss: f64,
    /// Learning rate of the epoch's last step.
    pub learning_rate: f64,
    /// Triplets that the epoch learned from.
    pub triplets: u64,
    /// Time that its steps took, seconds, without the measuring of quality.
    pub seconds: f64,
    /// What held-out behaviours say of the network after the epoch.
    pub quality: Quality,
}

impl Progress {
    /// Triplets learned from in a second.
    #[must_use]
    pub fn triplets_per_second(&self) -> f64 {
        self.triplets as f64 / self.seconds
    }
}

/// Why a training has come to its end.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The last epoch is done.
    LastEpoch,
    /// The accuracy on held-out triplets did not improve for as many epochs as the recipe is patient.
    NoBetter,
    /// The loss is as low as the recipe asks for.
    LowLoss,
    /// The loss is no number any more: the learning rate is too high for the network.
    Diverged,
}
