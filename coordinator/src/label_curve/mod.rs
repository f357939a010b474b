//! How accurate an embedding becomes with answers: accuracy against their number, by what is asked and by query strategy.
//!
//! A labelled set stands for a person: whichever of its behaviours a strategy asks about, the set answers. Accuracy is
//! measured on another set. [`Sets`] is the only way to have both, and does not come into being where they share a picture.

mod comparisons;
mod plot;
mod pretrained;
mod questions;
mod sets;

pub use plot::plot;
pub use pretrained::Pretrained;
pub use questions::Questions;
pub use sets::{LabelledBehaviours, Overlap, Sets};

use murmuration_accuracy::Accuracy;
use murmuration_engine::queries::{by_uncertainty, in_random_order};
use murmuration_proto::{
    Invalid, Purpose, RandomStream, Strategy,
    training::{ArchitectureError, Recipe},
};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids,
    novelty::{self, Misfit},
};
use murmuration_trainer::{
    compared_pictures::ComparedPicturesError,
    labelled_pictures::{LabelledPictures, LabelledPicturesError},
    network::Network,
    pictures::PicturesError,
    training::{FineTuning, Teaching, Training, TrainingError},
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

/// What is measured after so many answers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// What was asked, and how it was chosen.
    pub questions: Questions,
    /// Number of answers.
    pub answers: usize,
    /// Those of them that say something: all names, and comparisons in which one behaviour was more alike.
    pub told: usize,
    /// Seed of dataset, embedder and fine-tuning.
    pub seed: u64,
    /// Correct triplets whose anchor is not random, percent; `None` if there is no such triplet.
    pub not_random: Option<f64>,
    /// Correct triplets, percent; `None` if there is none.
    pub every: Option<f64>,
    /// What the fine-tuning took.
    pub took: Duration,
}

/// Why there is no curve.
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
    /// A number is out of range, or the campaign trains no embedder.
    #[error("{0}")]
    Invalid(#[from] Invalid),
    /// The network does not fit the pictures.
    #[error("{0}")]
    Architecture(#[from] ArchitectureError),
    /// The dataset is none.
    #[error("{0}")]
    Pictures(#[from] PicturesError),
    /// The labelled pictures are nothing to learn from.
    #[error("{0}")]
    Labelled(#[from] LabelledPicturesError),
    /// The compared pictures are nothing to learn from.
    #[error("{0}")]
    Compared(#[from] ComparedPicturesError),
    /// The embedder cannot be trained.
    #[error("{0}")]
    Training(#[from] TrainingError),
    /// Controllers cannot be sampled.
    #[error("{0}")]
    Propose(#[from] murmuration_search::breeding::ProposeError),
    /// An embedding is no behaviour.
    #[error("{0}")]
    Misfit(#[from] Misfit),
    /// Nobody waits for the curve any more.
    #[error("{0}")]
    Interrupted(#[from] Interrupted),
}

/// What all curves have in common.
#[derive(Debug)]
pub struct Curves<'a> {
    /// What is labelled, and what judges.
    pub sets: &'a Sets,
    /// An embedder a seed.
    pub pretrained: &'a [Pretrained],
    /// How they are fine-tuned, a recipe for labels.
    pub recipe: &'a Recipe,
    /// Clusters that the strategy `medoids` begins with, 1 or more.
    pub medoids: usize,
}

impl Curves<'_> {
    /// The curve of a strategy from the embedder at `which`, at ascending numbers of labels; `told` hears of every point.
    ///
    /// As in a campaign, what to ask next is chosen with the embedder that has learned from the labels so far; unlike
    /// there, each number's embedder is fine-tuned from the pretrained one, so that it does not depend on the numbers
    /// before it.
    ///
    /// # Errors
    /// See [`CurveError`].
    pub fn curve(
        &self,
        strategy: Strategy,
        which: usize,
        counts: &[usize],
        mut told: impl FnMut(Point),
    ) -> Result<(), CurveError> {
        let pretrained = &self.pretrained[which];
        let seed = pretrained.seed;
        let mut embedder = pretrained.network.clone();
        let mut asked: Vec<usize> = Vec::new();
        for &count in counts {
            let begun = Instant::now();
            for index in self.ranking(strategy, &embedder, seed)? {
                if asked.len() < count && !asked.contains(&index) {
                    asked.push(index);
                }
            }
            if let Some(labelled) = self.labelled(&asked)? {
                embedder = self.fine_tuned(pretrained, labelled)?;
            }
            let took = begun.elapsed();
            let accuracy = self.accuracy(&embedder);
            told(Point {
                questions: Questions::Names(strategy),
                answers: asked.len(),
                told: asked.len(),
                seed,
                not_random: accuracy.anchor_not_random().percent(),
                every: accuracy.every_anchor().percent(),
                took,
            });
        }
        Ok(())
    }

    /// All behaviours of the set that is labelled, the first to ask about first.
    fn ranking(&self, strategy: Strategy, embedder: &Network, seed: u64) -> Result<Vec<usize>, CurveError> {
        let train = self.sets.train();
        let queries = match strategy {
            Strategy::Random => {
                in_random_order(train.count(), &mut RandomStream::derive(seed, Purpose::Query, 0))
            }
            Strategy::Medoids => {
                let points = points(embedder, train)?;
                let mut stream = RandomStream::derive(seed, Purpose::Medoids, 0);
                let clustering = medoids::cluster(&points, self.medoids, &mut stream, &Interrupt::default())?;
                by_uncertainty(&points, &clustering)
            }
        };
        Ok(queries.into_iter().map(|query| query.index).collect())
    }

    /// The classes of these behaviours, with their pictures; `None` if they are all of one.
    fn labelled(&self, asked: &[usize]) -> Result<Option<Teaching>, CurveError> {
        let train = self.sets.train();
        let (pictures, classes) = train.labelled_pictures(asked);
        match LabelledPictures::new(train.shape(), pictures, classes) {
            Err(LabelledPicturesError::TooFewClasses(_)) => Ok(None),
            labelled => Ok(Some(Arc::new(labelled?.of_labels(asked.len())).into())),
        }
    }

    /// The pretrained embedder after it has learned what was answered.
    fn fine_tuned(&self, pretrained: &Pretrained, teaching: Teaching) -> Result<Network, CurveError> {
        let fine_tuning = FineTuning {
            parent: pretrained.network.clone(),
            teaching,
        };
        let configuration = pretrained.configuration.with_recipe(self.recipe.clone())?;
        let mut training =
            Training::fine_tune(&configuration, Arc::clone(&pretrained.pictures), fine_tuning)?;
        while training.step().is_some() {}
        Ok(training.embedder())
    }

    fn accuracy(&self, embedder: &Network) -> Accuracy {
        let validation = self.sets.validation();
        let embedded = embeddings(embedder, validation);
        let vectors = embedded
            .chunks_exact(embedder.architecture().dimensions())
            .map(|embedding| embedding.iter().map(|&value| f64::from(value)).collect());
        Accuracy::measure(&validation.classes().zip(vectors).collect::<Vec<_>>())
    }
}

fn embeddings(embedder: &Network, behaviours: &LabelledBehaviours) -> Vec<f32> {
    let all: Vec<usize> = (0..behaviours.count()).collect();
    embedder.embed(&behaviours.pictures(&all))
}

fn points(embedder: &Network, behaviours: &LabelledBehaviours) -> Result<novelty::Behaviours, Misfit> {
    let dimensions = embedder.architecture().dimensions();
    let mut points = novelty::Behaviours::new(dimensions);
    for embedding in embeddings(embedder, behaviours).chunks_exact(dimensions) {
        points.push(
            &embedding
                .iter()
                .map(|&value| f64::from(value))
                .collect::<Vec<_>>(),
        )?;
    }
    Ok(points)
}
