//! Measures the speed of trainings on this machine, for `murmuration lab bench train`.

use crate::{
    pictures::{Pictures, PicturesError},
    training::{Training, TrainingError},
};
use murmuration_swarm::{
    PictureShape, Purpose, RandomStream,
    training::{Configuration, ConfigurationError, Recipe},
};
use rand::RngExt as _;
use std::sync::Arc;

/// The figures of one network and recipe.
#[derive(Debug, Clone, PartialEq)]
pub struct Figures {
    /// `compact` or `paper`.
    pub network: &'static str,
    /// `in-batch` or `paper`.
    pub recipe: &'static str,
    /// Number of weights of the network.
    pub weights: usize,
    /// Triplets per step.
    pub triplets_per_step: u64,
    /// Mean time of a step, seconds.
    pub step_seconds: f64,
    /// Time of an epoch's steps, seconds.
    pub epoch_seconds: f64,
    /// Peak memory of the process so far, bytes; `None` if the system does not report it.
    pub peak_memory: Option<u64>,
}

/// Why the benchmark failed.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A value of the configuration is not allowed.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// There are too few behaviours.
    #[error(transparent)]
    Pictures(#[from] PicturesError),
    /// The network cannot be trained.
    #[error(transparent)]
    Training(#[from] TrainingError),
}

/// Trains each network with each recipe for one epoch on pictures (50 x 50 pixels) of `behaviours` synthetic behaviours, and
/// reports each training's figures. The default of campaigns, 10,000 behaviours, takes about 20 s on two cores. The training with
/// the least memory runs first, because the peak of a process never falls.
///
/// # Errors
/// If there are fewer than four behaviours.
pub fn train(behaviours: usize, mut report: impl FnMut(Figures)) -> Result<(), BenchError> {
    let pictures = Arc::new(made_up(behaviours)?);
    for (network, recipe) in [
        ("compact", "in-batch"),
        ("paper", "in-batch"),
        ("compact", "paper"),
        ("paper", "paper"),
    ] {
        report(one_epoch(network, recipe, &pictures)?);
    }
    Ok(())
}

fn one_epoch(
    network: &'static str,
    recipe: &'static str,
    pictures: &Arc<Pictures>,
) -> Result<Figures, BenchError> {
    let configuration =
        Configuration::from_toml(&format!("network.name = \"{network}\"\n[recipe.{recipe}]"))?;
    let mut training = Training::new(&configuration, Arc::clone(pictures))?;
    let (seconds, triplets) = training
        .step()
        .map_or((0.0, 0), |progress| (progress.seconds, progress.triplets));
    let triplets_per_step = match configuration.recipe() {
        Recipe::Paper(recipe) => recipe.batch as u64,
        Recipe::InBatch(recipe) => recipe.batch as u64 * (recipe.batch as u64 - 1),
        Recipe::Labelled(_) | Recipe::PaperLabelled(_) | Recipe::Untrained => 1,
    };
    let steps = (triplets / triplets_per_step).max(1);
    Ok(Figures {
        network,
        recipe,
        weights: training.embedder().parameters().len(),
        triplets_per_step,
        step_seconds: seconds / steps as f64,
        epoch_seconds: seconds,
        peak_memory: peak_memory(),
    })
}

/// Steps of the default recipe on the default network and pictures of 50 x 50 pixels, for benchmarks.
#[derive(Debug)]
pub struct Steps {
    training: Training,
    anchors: usize,
}

impl Steps {
    /// A training before its first step, with this number of anchors in a step, 2 to 256 (the default of campaigns).
    ///
    /// # Errors
    /// If the default configuration cannot be trained.
    pub fn new(anchors: usize) -> Result<Self, BenchError> {
        let pictures = Arc::new(made_up(300)?);
        Ok(Self {
            training: Training::new(&Configuration::default(), pictures)?,
            anchors,
        })
    }

    /// Takes a step: augmentation, both passes, loss and optimiser. Every step has the same behaviours.
    pub fn step(&mut self) {
        self.training.step_on_first(self.anchors);
    }
}

/// Synthetic pictures as dark as those of trajectories: a few short lines on black.
fn made_up(behaviours: usize) -> Result<Pictures, PicturesError> {
    let shape = PictureShape::PAPER;
    let side = shape.side();
    let mut stream = RandomStream::derive(0, Purpose::Train, 0);
    let mut bytes = vec![0; behaviours * shape.bytes()];
    for picture in bytes.chunks_exact_mut(shape.bytes()) {
        for _ in 0..24 {
            let start = stream.random_range(0..side * (side - 6));
            picture[start..start + 6].fill(255);
        }
    }
    let features = (0..behaviours).map(|_| std::array::from_fn(|_| stream.random::<f64>()));
    let features = features.collect();
    Pictures::new(shape, 1, bytes)?.with_features(features)
}

/// The peak memory of this process, as reported by Linux.
fn peak_memory() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    let kibibytes: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kibibytes * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_are_too_few_are_named() {
        let error = train(3, |_| {}).unwrap_err().to_string();
        assert!(error.contains("3 behaviours"), "{error}");
    }

    #[test]
    fn made_up_pictures_are_mostly_black_and_no_two_alike() {
        let pictures = made_up(10).unwrap();
        let lit = |i| pictures.picture(i, 0).iter().filter(|&&grey| grey > 0).count();
        assert!((0..10).all(|i| (20..=144).contains(&lit(i))));
        assert_ne!(pictures.picture(0, 0), pictures.picture(1, 0));
    }
}
