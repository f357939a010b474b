//! A training, stepped an epoch at a time. It can be put aside after any of them, and taken up again.

mod fine_tuning;
mod held_out;
mod in_batch;
mod labelled;
mod labelled_triplets;
mod progress;
mod random_triplets;
mod saved;
mod schedule;
#[cfg(test)]
mod tests;
mod triplets;

use crate::{
    lanes::Lanes,
    network::Network,
    optimise::Adam,
    pictures::Pictures,
    quality::{Moments, Quality},
};
use held_out::HeldOut;
use murmuration_proto::{
    Purpose, Stream,
    training::{Architecture, ArchitectureError, Configuration, Recipe},
};
use schedule::Schedule;
use std::{sync::Arc, time::Instant};

pub use fine_tuning::FineTuning;
pub(crate) use fine_tuning::Lesson;
pub use progress::{Ending, Progress};

/// A training and all it depends on. Configuration, pictures and epoch decide every bit of it, on one kind of CPU;
/// the number of threads of the rayon pool that it is stepped in does not.
#[derive(Debug)]
pub struct Training {
    configuration: Configuration,
    pictures: Arc<Pictures>,
    held_out: HeldOut,
    /// `None` where the recipe takes no labels.
    lesson: Option<Lesson>,
    lanes: Lanes<f32>,
    gradient: Vec<f32>,
    state: State,
}

/// What changes from epoch to epoch, and is saved.
#[derive(Debug, Clone)]
struct State {
    network: Network,
    adam: Adam<f32>,
    schedule: Schedule,
    /// Epochs done.
    epoch: u64,
    best: Best,
}

impl State {
    /// One step of the optimiser against the gradient by the weights.
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

/// Why a training cannot begin, or be taken up again.
#[derive(Debug, thiserror::Error)]
pub enum TrainingError {
    /// The network does not fit the pictures.
    #[error("the network does not fit pictures of side {side}: {source}")]
    Architecture {
        /// Pixels along a side of the pictures.
        side: usize,
        /// What is wrong.
        source: ArchitectureError,
    },
    /// The recipe learns from labels, and there are none.
    #[error("the recipe \"{0}\" needs labels")]
    NoLabels(&'static str),
    /// The recipe learns without labels, and there are some.
    #[error("the recipe \"{0}\" has no use for labels")]
    NoUseForLabels(&'static str),
    /// Labelled pictures are larger or smaller than the others.
    #[error("labelled pictures have side {labelled}, unlabelled ones {side}")]
    LabelledSide {
        /// Pixels along a side of the pictures.
        side: usize,
        /// Pixels along a side of the labelled ones.
        labelled: usize,
    },
    /// The network to go on from has other layers than the configuration says.
    #[error("the network to go on from is another than the configuration's")]
    OtherParent,
    /// What was saved is damaged, or of another version of the trainer.
    #[error("not a saved training: {0}")]
    Damaged(String),
    /// What was saved belongs to another training.
    #[error("the saved training is of another {0}")]
    Other(&'static str),
}

/// What one epoch of a recipe hands back.
struct EpochLoss {
    mean: f64,
    triplets: u64,
}

impl Training {
    /// A training without labels before its first epoch.
    ///
    /// # Errors
    /// Where the network does not fit the pictures, or the recipe learns from labels.
    pub fn new(configuration: &Configuration, pictures: Arc<Pictures>) -> Result<Self, TrainingError> {
        if configuration.recipe().is_labelled() {
            return Err(TrainingError::NoLabels(configuration.recipe().name()));
        }
        let architecture = Self::architecture(configuration, &pictures)?;
        let network = Network::initialise(architecture, configuration.seed());
        Ok(Self::starting_with(network, configuration, pictures, None))
    }

    fn architecture(
        configuration: &Configuration,
        pictures: &Pictures,
    ) -> Result<Architecture, TrainingError> {
        let side = pictures.side();
        let architecture = configuration.architecture(side);
        architecture.map_err(|source| TrainingError::Architecture { side, source })
    }

    fn starting_with(
        network: Network,
        configuration: &Configuration,
        pictures: Arc<Pictures>,
        lesson: Option<Lesson>,
    ) -> Self {
        let weights = network.parameters().len();
        Self {
            held_out: HeldOut::new(configuration, &pictures),
            lesson,
            lanes: Lanes::new(&network),
            gradient: vec![0.0; weights],
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

    /// The same training where [`Training::save`] put it aside: it goes on as if it had never stopped.
    ///
    /// # Errors
    /// Where `saved` is damaged, or of another configuration, other pictures, labels or another parent.
    pub fn taken_up(mut self, saved: &[u8]) -> Result<Self, TrainingError> {
        saved::restore(&mut self, saved)?;
        Ok(self)
    }

    /// The training as bytes, the optimiser's state included. Equal trainings have equal bytes.
    #[must_use]
    pub fn save(&self) -> Vec<u8> {
        saved::save(self)
    }

    /// Epochs done.
    #[must_use]
    pub const fn epoch(&self) -> u64 {
        self.state.epoch
    }

    /// Why there is no further epoch, if there is none.
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
            Recipe::Paper(recipe) if low(recipe.enough, recipe.enough_over) => Some(Ending::LowLoss),
            Recipe::PaperLabelled(recipe) if low(recipe.enough, recipe.enough_over) => Some(Ending::LowLoss),
            Recipe::InBatch(recipe) if epoch - best.epoch >= recipe.patience => Some(Ending::NoBetter),
            recipe if *epoch >= recipe.epochs() => Some(Ending::LastEpoch),
            _ => None,
        }
    }

    /// Trains for one epoch; `None`, and nothing done, after the end.
    pub fn step(&mut self) -> Option<Progress> {
        if self.ending().is_some() {
            return None;
        }
        let started = Instant::now();
        let mut stream = Stream::derive(self.configuration.seed(), Purpose::Train, self.state.epoch);
        let labelled = self.lesson.as_ref().map(|lesson| Arc::clone(&lesson.labelled));
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

    /// The network as it is after the last epoch.
    #[must_use]
    pub const fn network(&self) -> &Network {
        &self.state.network
    }

    /// The embedder to publish: of the in-batch recipe the weights that were most accurate on held-out triplets, else
    /// those after the last epoch.
    ///
    /// It is moved and scaled (in its last layer, which changes no comparison of distances) such that the held-out
    /// behaviours have mean 0 and spread 1, so that novelty is in one unit whatever the recipe. A collapsed network
    /// is left as it is.
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

    /// What held-out behaviours say of the network that [`Training::embedder`] is made of, before it is scaled.
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
