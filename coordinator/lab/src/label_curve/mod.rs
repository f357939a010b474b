//! Measures the accuracy of an embedding against the number of labels, by query strategy.
//!
//! A labelled set takes the place of the annotator: it has the class of each behaviour that a strategy asks about. Another set
//! measures accuracy. [`Sets`] has both sets, and refuses sets that share a picture.

mod plot;
mod pretrained;
mod sets;

pub use plot::plot;
pub use pretrained::Pretrained;
pub use sets::{LabelledBehaviours, Overlap, Sets};

use murmuration_accuracy::Accuracy;
use murmuration_engine::queries::{by_uncertainty, in_random_order};
use murmuration_search::{
    interrupt::{Interrupt, Interrupted},
    medoids,
    novelty::{self, Misfit},
};
use murmuration_swarm::{
    Invalid, Purpose, RandomStream, Search, Strategy,
    training::{ArchitectureError, Recipe},
};
use murmuration_train::{
    labelled_pictures::{LabelledPictures, LabelledPicturesError},
    network::Network,
    pictures::PicturesError,
    training::{FineTuning, Training, TrainingError},
};
use std::{
    sync::Arc,
    time::{Duration, Instant},
};

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// The strategy that chose the labelled behaviours.
    pub strategy: Strategy,
    pub labels: usize,
    /// Seed of dataset, embedder and fine-tuning.
    pub seed: u64,
    /// Correct triplets, in percent of the triplets whose anchor is not `random`; `None` without such triplets.
    pub not_random: Option<f64>,
    /// Correct triplets, in percent of all triplets; `None` without triplets.
    pub every: Option<f64>,
    /// Duration of the fine-tuning.
    pub took: Duration,
}

/// Why a curve cannot be computed.
#[derive(Debug, thiserror::Error)]
pub enum CurveError {
    #[error(transparent)]
    Invalid(#[from] Invalid),
    #[error(transparent)]
    Architecture(#[from] ArchitectureError),
    #[error(transparent)]
    Pictures(#[from] PicturesError),
    #[error(transparent)]
    Labelled(#[from] LabelledPicturesError),
    #[error(transparent)]
    Training(#[from] TrainingError),
    #[error(transparent)]
    Propose(#[from] murmuration_search::breeding::ProposeError),
    #[error(transparent)]
    Misfit(#[from] Misfit),
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
}

/// The inputs that all curves share.
#[derive(Debug)]
pub struct Curves<'a> {
    /// The set that is labelled, and the set that measures accuracy.
    pub sets: &'a Sets,
    /// One embedder per seed.
    pub pretrained: &'a [Pretrained],
    /// The recipe for fine-tuning on labels.
    pub recipe: &'a Recipe,
    /// Number of clusters with which the strategy `medoids` begins, 1 or more.
    pub medoids: usize,
}

impl Curves<'_> {
    /// Computes the curve of a strategy at ascending numbers of labels, from the pretrained embedder with the index `which`.
    /// Calls `told` with every point.
    ///
    /// As in a campaign, the embedder that has learned from the labels so far chooses the next questions. Unlike in a campaign,
    /// each embedder is fine-tuned from the pretrained embedder, so that a point does not depend on earlier points.
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
                strategy,
                labels: asked.len(),
                seed,
                not_random: accuracy.anchor_not_random().percent(),
                every: accuracy.every_anchor().percent(),
                took,
            });
        }
        Ok(())
    }

    /// All behaviours of the set that is labelled, in the order of asking.
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
            Strategy::Coverage => {
                let points = points(embedder, train)?;
                let mut stream = RandomStream::derive(seed, Purpose::Medoids, 0);
                return Ok(medoids::order(
                    &points,
                    Vec::new(),
                    points.len(),
                    Search::default().neighbours() as usize,
                    &mut stream,
                    &Interrupt::default(),
                )?);
            }
        };
        Ok(queries.into_iter().map(|query| query.index).collect())
    }

    /// The classes and pictures of the behaviours `asked`; `None` if all behaviours are of one class.
    fn labelled(&self, asked: &[usize]) -> Result<Option<LabelledPictures>, CurveError> {
        let train = self.sets.train();
        let (pictures, classes) = train.labelled_pictures(asked);
        match LabelledPictures::new(train.shape(), pictures, classes) {
            Err(LabelledPicturesError::TooFewClasses(_)) => Ok(None),
            labelled => Ok(Some(labelled?.of_labels(asked.len()))),
        }
    }

    /// The pretrained embedder, fine-tuned on labels.
    fn fine_tuned(&self, pretrained: &Pretrained, labelled: LabelledPictures) -> Result<Network, CurveError> {
        let fine_tuning = FineTuning {
            parent: pretrained.network.clone(),
            labelled: Arc::new(labelled),
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
