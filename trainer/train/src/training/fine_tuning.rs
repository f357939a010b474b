//! Fine-tuning: training a trained network further, on labels.

use super::{Training, TrainingError};
use crate::{labelled_pictures::LabelledPictures, network::Network, onnx, pictures::Pictures};
use murmuration_swarm::{CheckpointDigest, training::Configuration};
use std::sync::Arc;

/// The inputs of fine-tuning besides configuration and pictures.
#[derive(Debug, Clone)]
pub struct FineTuning {
    /// The network to train further: an [imported](onnx::import) checkpoint of the configuration's architecture.
    pub parent: Network,
    /// Labelled pictures, of the same shape as the other pictures.
    pub labelled: Arc<LabelledPictures>,
}

/// The part of the inputs that a training keeps.
#[derive(Debug)]
pub struct FineTuned {
    pub labelled: Arc<LabelledPictures>,
    pub parent: CheckpointDigest,
}

impl Training {
    /// A training on labels before its first epoch. `pictures` are pictures without labels. The `labelled` recipe learns from
    /// some of these pictures too; the held-out pictures measure the quality of the embedding and determine its scale.
    ///
    /// # Errors
    /// If the recipe is not for labels, the network does not fit the pictures, the parent is of another
    /// architecture, or the labelled pictures have another shape.
    pub fn fine_tune(
        configuration: &Configuration,
        pictures: Arc<Pictures>,
        fine_tuning: FineTuning,
    ) -> Result<Self, TrainingError> {
        let FineTuning { parent, labelled } = fine_tuning;
        if !configuration.recipe().is_labelled() {
            return Err(TrainingError::NoUseForLabels(configuration.recipe().name()));
        }
        if labelled.shape() != pictures.shape() {
            return Err(TrainingError::LabelledShape {
                shape: pictures.shape(),
                labelled: labelled.shape(),
            });
        }
        let architecture = Self::architecture(configuration, &pictures)?;
        if *parent.architecture() != architecture {
            return Err(TrainingError::OtherParent);
        }
        let fine_tuned = FineTuned {
            labelled,
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
    #[must_use]
    pub const fn fine_tuned(&self) -> Option<&FineTuned> {
        self.fine_tuned.as_ref()
    }
}

#[cfg(test)]
mod tests;
