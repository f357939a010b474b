//! Fine-tuning: training a trained network further, on labels and comparisons.

use super::{Teaching, Training, TrainingError};
use crate::{network::Network, onnx, pictures::Pictures};
use murmuration_proto::{CheckpointDigest, training::Configuration};
use std::sync::Arc;

/// The inputs of fine-tuning besides configuration and pictures.
#[derive(Debug, Clone)]
pub struct FineTuning {
    /// The network to train further, of the configuration's architecture: an [imported](onnx::import) checkpoint.
    pub parent: Network,
    /// What people said, about pictures of the same shape as the other pictures.
    pub teaching: Teaching,
}

/// The part that a training keeps.
#[derive(Debug)]
pub(crate) struct FineTuned {
    pub(crate) teaching: Teaching,
    pub(crate) parent: CheckpointDigest,
}

impl Training {
    /// A training on labels, comparisons or both before its first epoch. `pictures` are behaviours without labels. The `labelled` recipe learns
    /// from some of them too, and held-out ones measure the quality of the embedding and determine its scale.
    ///
    /// # Errors
    /// If the recipe is not for labels, the network does not fit the pictures, the parent is of another
    /// architecture, nobody has said anything, or the labelled or compared pictures have another shape.
    pub fn fine_tune(
        configuration: &Configuration,
        pictures: Arc<Pictures>,
        fine_tuning: FineTuning,
    ) -> Result<Self, TrainingError> {
        let FineTuning { parent, teaching } = fine_tuning;
        if !configuration.recipe().is_labelled() {
            return Err(TrainingError::NoUseForLabels(configuration.recipe().name()));
        }
        if teaching.answers() == 0 {
            return Err(TrainingError::NothingTaught);
        }
        if let Some(labelled) = teaching.shapes().find(|&shape| shape != pictures.shape()) {
            return Err(TrainingError::LabelledShape {
                shape: pictures.shape(),
                labelled,
            });
        }
        let architecture = Self::architecture(configuration, &pictures)?;
        if *parent.architecture() != architecture {
            return Err(TrainingError::OtherParent);
        }
        let fine_tuned = FineTuned {
            teaching,
            parent: CheckpointDigest::of(&onnx::export(&parent)),
        };
        Ok(Self::starting_with(
            parent,
            configuration,
            pictures,
            Some(fine_tuned),
        ))
    }

    /// The fine-tuning, if the recipe learns from labels.
    pub(crate) const fn fine_tuned(&self) -> Option<&FineTuned> {
        self.fine_tuned.as_ref()
    }
}

#[cfg(test)]
mod tests;
