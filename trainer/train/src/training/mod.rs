//! A training, run one epoch at a time. It can be saved after any epoch, and resumed.

mod fine_tuning;
mod flattening;
mod held_out;
mod in_batch;
mod labelled;
mod labelled_triplets;
mod random_triplets;
mod saved;
mod schedule;
#[cfg(test)]
mod tests;
mod triplets;

use crate::{
    network::Network,
    optimise::Adam,
    pictures::Pictures,
    quality::{Moments, Quality},
    shards::Shards,
};
use held_out::HeldOut;
use murmuration_swarm::{
    PictureShape, Purpose, RandomStream,
    training::{Architecture, ArchitectureError, Configuration, PaperLabelled, Recipe},
};
use schedule::Schedule;
use std::{sync::Arc, time::Instant};

pub use fine_tuning::{FineTuned, FineTuning};

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
    /// Time of the epoch's steps, seconds, without the measurement of quality.
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

/// A training with all its inputs. On one kind of CPU, the inputs and the epoch determine every bit of a training. The number of
/// threads of the rayon pool does not matter.
#[derive(Debug)]
pub struct Training {
    configuration: Configuration,
    pictures: Arc<Pictures>,
    held_out: HeldOut,
    /// Labels and parent; `None` if the recipe takes no labels.
    fine_tuned: Option<FineTuned>,
    shards: Shards<f32>,
    gradient: Vec<f32>,
    /// How often the in-batch recipe draws each behaviour, relative to the other behaviours; `None` if all behaviours are drawn
    /// equally often.
    weights: Option<Vec<f64>>,
    state: State,
}

/// The state that changes from epoch to epoch, and is saved.
#[derive(Debug, Clone)]
struct State {
    network: Network,
    adam: Adam<f32>,
    schedule: Schedule,
    epoch: u64,
    best: Best,
}

impl State {
    /// Takes one step of the optimiser against the gradient with respect to the weights.
    fn descend(&mut self, gradient: &[f32], weight_decay: f64) {
        let rate = self.schedule.learning_rate();
        let weights = self.network.parameters_mut();
        self.adam.step(weights, gradient, rate, weight_decay);
    }
}

/// The weights to publish.
#[derive(Debug, Clone, PartialEq)]
struct Best {
    parameters: Vec<f32>,
    epoch: u64,
    triplet_accuracy: f64,
}

/// Why a training cannot begin or resume.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The network does not fit the pictures.
    #[error("the network does not fit pictures of {shape}: {source}")]
    Architecture {
        shape: PictureShape,
        source: ArchitectureError,
    },
    /// The recipe needs labels, but the training has none.
    #[error("the recipe \"{0}\" needs labels")]
    NoLabels(&'static str),
    /// The recipe draws rare behaviours more often, which needs features, but they are missing.
    #[error("the recipe \"{0}\" needs the features of every behaviour unless its flattening is 0")]
    NoFeatures(&'static str),
    /// The recipe takes no labels, but the training has labels.
    #[error("the recipe \"{0}\" takes no labels")]
    NoUseForLabels(&'static str),
    /// Labelled pictures have another size or other channels than the unlabelled pictures.
    #[error("labelled pictures are of {labelled}, unlabelled ones of {shape}")]
    LabelledShape {
        shape: PictureShape,
        labelled: PictureShape,
    },
    /// The network to train further has other layers than the configuration.
    #[error("the network to train further differs from the configuration's network")]
    OtherParent,
    /// The saved training is damaged, or of another version of the trainer.
    #[error("not a saved training: {0}")]
    Damaged(String),
    /// The saved state belongs to another training.
    #[error("the saved training belongs to another {0}")]
    Other(&'static str),
}

/// The outcome of one epoch of a recipe.
struct EpochLoss {
    mean: f64,
    triplets: u64,
}

impl Training {
    /// A training without labels before its first epoch.
    ///
    /// # Errors
    /// If the network does not fit the pictures, or the recipe learns from labels or needs features that the pictures lack.
    pub fn new(configuration: &Configuration, pictures: Arc<Pictures>) -> Result<Self, TrainingError> {
        if configuration.recipe().is_labelled() {
            return Err(TrainingError::NoLabels(configuration.recipe().name()));
        }
        let architecture = Self::architecture(configuration, &pictures)?;
        let network = Network::initialise(architecture, configuration.seed());
        let recipe = configuration.recipe();
        let weights = match (recipe.flattening(), pictures.features()) {
            (0, _) => None,
            (flattening, Some(features)) => Some(flattening::weights(features, flattening)),
            (_, None) => return Err(TrainingError::NoFeatures(recipe.name())),
        };
        Ok(Self {
            weights,
            ..Self::starting_with(network, configuration, pictures, None)
        })
    }

    fn architecture(
        configuration: &Configuration,
        pictures: &Pictures,
    ) -> Result<Architecture, TrainingError> {
        let shape = pictures.shape();
        let architecture = configuration.architecture(shape);
        architecture.map_err(|source| TrainingError::Architecture { shape, source })
    }

    fn starting_with(
        network: Network,
        configuration: &Configuration,
        pictures: Arc<Pictures>,
        fine_tuned: Option<FineTuned>,
    ) -> Self {
        let weights = network.parameters().len();
        Self {
            held_out: HeldOut::new(configuration, &pictures),
            fine_tuned,
            shards: Shards::new(&network),
            gradient: vec![0.0; weights],
            weights: None,
            state: State {
                adam: Adam::new(weights),
                schedule: Schedule::new(configuration.recipe()),
                epoch: 0,
                best: Best {
                    parameters: network.parameters().to_vec(),
                    epoch: 0,
                    triplet_accuracy: 0.0,
                },
                network,
            },
            configuration: configuration.clone(),
            pictures,
        }
    }

    /// Resumes the training that [`Training::save`] saved. The training continues as if it had never stopped.
    ///
    /// # Errors
    /// If `saved` is damaged, or if its configuration, pictures, labels or parent differ from this training's.
    pub fn taken_up(mut self, saved: &[u8]) -> Result<Self, TrainingError> {
        saved::restore(&mut self, saved)?;
        Ok(self)
    }

    /// The training as bytes, the optimiser's state included. Equal trainings have equal bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        saved::save(self)
    }

    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.state.epoch
    }

    /// Why the training has ended; `None` if a further epoch follows.
    #[must_use]
    pub fn ending(&self) -> Option<Ending> {
        let State {
            epoch,
            schedule,
            best,
            ..
        } = &self.state;
        let low = |enough, over| schedule.mean_of_last(over) < enough;
        match self.configuration.recipe() {
            _ if schedule.has_diverged() => Some(Ending::Diverged),
            Recipe::Paper(triplets) | Recipe::PaperLabelled(PaperLabelled { triplets, .. })
                if low(triplets.enough, triplets.enough_over) =>
            {
                Some(Ending::LowLoss)
            }
            Recipe::InBatch(recipe) if epoch - best.epoch >= recipe.patience => Some(Ending::NoBetter),
            recipe if *epoch >= recipe.epochs() => Some(Ending::LastEpoch),
            _ => None,
        }
    }

    /// Trains for one epoch. After the end of the training, this function does nothing and returns `None`.
    pub fn step(&mut self) -> Option<Progress> {
        if self.ending().is_some() {
            return None;
        }
        let started = Instant::now();
        let mut stream = RandomStream::derive(self.configuration.seed(), Purpose::Train, self.state.epoch);
        let labelled = self
            .fine_tuned
            .as_ref()
            .map(|fine_tuned| Arc::clone(&fine_tuned.labelled));
        let loss = match (self.configuration.recipe().clone(), labelled) {
            (Recipe::Paper(recipe), _) => random_triplets::epoch(self, &recipe, &mut stream),
            (Recipe::InBatch(recipe), _) => in_batch::epoch(self, &recipe, &mut stream),
            (Recipe::Labelled(recipe), Some(labelled)) => {
                labelled::epoch(self, &labelled, &recipe, &mut stream)
            }
            (Recipe::PaperLabelled(recipe), Some(labelled)) => {
                labelled_triplets::epoch(self, &labelled, &recipe, &mut stream)
            }
            (Recipe::Untrained, _) | (_, None) => return None,
        };
        let seconds = started.elapsed().as_secs_f64();
        let learning_rate = self.state.schedule.learning_rate();
        self.state.epoch += 1;
        self.state.schedule.after_epoch(loss.mean);
        let quality = self.held_out.quality(&self.state.network);
        self.keep_if_best(quality);
        Some(Progress {
            epoch: self.state.epoch,
            epochs: self.configuration.recipe().epochs(),
            loss: loss.mean,
            learning_rate,
            triplets: loss.triplets,
            seconds,
            quality,
        })
    }

    /// The network after the last epoch.
    #[must_use]
    pub const fn network(&self) -> &Network {
        &self.state.network
    }

    /// The embedder to publish: for the in-batch recipe, the weights that were most accurate on held-out triplets; otherwise
    /// the weights after the last epoch.
    ///
    /// The embedder's last layer is shifted and scaled so that held-out behaviours have mean 0 and spread 1. This scaling changes
    /// no comparison of distances, and gives novelty the same unit for all recipes. A collapsed network is not changed.
    #[must_use]
    pub fn embedder(&self) -> Network {
        let mut network = self.best_network();
        let plain = network.embed(self.held_out.plain());
        let moments = Moments::of(&plain, network.architecture().dimensions());
        let spread = moments.spread();
        if spread > 0.0 && spread.is_finite() {
            network.move_and_scale(&moments.mean, 1.0 / spread);
        }
        network
    }

    /// The quality of the network of [`Training::embedder`] on held-out behaviours, before the network is scaled.
    #[must_use]
    pub fn quality(&self) -> Quality {
        self.held_out.quality(&self.best_network())
    }

    fn best_network(&self) -> Network {
        let mut network = self.state.network.clone();
        network
            .parameters_mut()
            .copy_from_slice(&self.state.best.parameters);
        network
    }

    fn keep_if_best(&mut self, quality: Quality) {
        let State {
            network, epoch, best, ..
        } = &mut self.state;
        let candidate = match self.configuration.recipe() {
            Recipe::InBatch(_) => quality.triplet_accuracy > best.triplet_accuracy,
            _ => true,
        };
        if candidate && quality.spread.is_finite() {
            best.parameters.copy_from_slice(network.parameters());
            best.epoch = *epoch;
            best.triplet_accuracy = quality.triplet_accuracy;
        }
    }
}
