//! An embedder without labels, as the dataset and pretrain stages of a campaign produce it.

use super::CurveError;
use murmuration_engine::campaign::dataset_tasks;
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{CampaignSpec, EmbedderSource, Invalid, training::Configuration};
use murmuration_train::{network::Network, pictures::Pictures, training::Training};
use rayon::prelude::*;
use std::sync::Arc;

/// A pretrained embedder, and its dataset.
#[derive(Debug)]
pub struct Pretrained {
    /// Seed of the campaign that would train this embedder.
    pub seed: u64,
    pub configuration: Configuration,
    pub network: Network,
    /// The campaign's dataset.
    pub pictures: Arc<Pictures>,
}

impl Pretrained {
    /// Simulates the dataset and trains on all cores, as a campaign of this specification does.
    ///
    /// # Errors
    /// Fails if the campaign trains no embedder, or training fails.
    pub fn of(spec: &CampaignSpec) -> Result<Self, CurveError> {
        let Some(EmbedderSource::Trained { dataset, training }) = spec.embedder() else {
            let allowed = "a campaign that trains an embedder of its own";
            return Err(Invalid::new("method", format!("\"{}\"", spec.method()), allowed).into());
        };
        let tasks = dataset_tasks(spec, dataset, 0..u64::from(dataset.controllers()))?;
        let images = tasks.par_iter().map(|(controller, seed)| {
            let mut evaluator = Evaluator::new(spec.world(), spec.image())?;
            let evaluation = evaluator.evaluate(controller, &Start::seeded(*seed))?;
            Ok((*evaluation.features(), evaluation.into_image()))
        });
        let evaluated = images.collect::<Result<Vec<_>, Invalid>>()?;
        let (features, images): (Vec<_>, Vec<_>) = evaluated.into_iter().unzip();
        let starts = dataset.starts() as usize;
        let pictures = Pictures::new(spec.image().shape(), starts, images.concat())?;
        let first = features.into_iter().step_by(starts).collect();
        let pictures = Arc::new(match training.recipe().flattening() {
            0 => pictures,
            _ => pictures.with_features(first)?,
        });
        let mut training_to_do = Training::new(training, Arc::clone(&pictures))?;
        while training_to_do.step().is_some() {}
        Ok(Self {
            seed: spec.seed(),
            configuration: (**training).clone(),
            network: training_to_do.embedder(),
            pictures,
        })
    }
}
