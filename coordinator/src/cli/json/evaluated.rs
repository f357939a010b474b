//! Documents about controllers of searches that run elsewhere.

use murmuration_proto::{Controller, Features, Invalid, mean_embedding, mean_features, v1};
use schemars::JsonSchema;
use serde::Serialize;

/// What an evaluation of a controller came to.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Evaluated {
    /// Place of the controller in the file, from 0.
    pub(in crate::cli) index: u64,
    /// The genes, in the order in which `murmuration robot` names them.
    pub(in crate::cli) controller: Vec<f64>,
    /// Seed of the start, the first one if there are several.
    pub(in crate::cli) seed: u64,
    /// Average speed, angular momentum, radial variance, scatter, group rotation: means over the starts.
    pub(in crate::cli) features: Features,
    /// Embedding by the checkpoint, the mean over the starts; empty if there is none.
    pub(in crate::cli) embedding: Vec<f32>,
}

impl Evaluated {
    /// What the trials of a controller come to.
    ///
    /// # Errors
    /// If a trial has not five features.
    pub(in crate::cli) fn new(
        index: u64,
        (controller, seed): (&Controller, u64),
        trials: &[v1::Evaluation],
    ) -> Result<Self, Invalid> {
        let features = trials.iter().map(|trial| {
            Features::try_from(trial.features.as_slice())
                .map_err(|_| Invalid::new("features", trial.features.len(), "5 values"))
        });
        let features: Vec<Features> = features.collect::<Result<_, _>>()?;
        Ok(Self {
            index,
            controller: controller.genes().to_vec(),
            seed,
            features: mean_features(features.iter()),
            embedding: mean_embedding(trials.iter().map(|trial| trial.embedding.as_slice())),
        })
    }
}
