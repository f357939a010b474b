//! Training further, from a trained network on, on what people have labelled.

use super::{Training, TrainingError};
use crate::{labelled_pictures::LabelledPictures, network::Network, onnx, pictures::Pictures};
use murmuration_proto::{CheckpointDigest, training::Configuration};
use std::sync::Arc;

/// What a training on labels depends on beside configuration and pictures.
#[derive(Debug, Clone)]
pub struct FineTuning {
    /// The network to go on from, of the configuration's architecture: a checkpoint, [imported](onnx::import).
    pub parent: Network,
    /// What was labelled, of the same side as the pictures.
    pub labelled: Arc<LabelledPictures>,
}

/// What a training keeps of it.
#[derive(Debug)]
pub(crate) struct Lesson {
    pub(crate) labelled: Arc<LabelledPictures>,
    pub(crate) parent: CheckpointDigest,
}

impl Training {
    /// A training on labels before its first epoch. `pictures` are behaviours that nobody need have labelled: by the
    /// `labelled` recipe some are learned from too; and those held out of them say how the embedding is, and how it
    /// is scaled.
    ///
    /// # Errors
    /// Where the recipe is not for labels, the network does not fit the pictures, the parent is of another
    /// architecture, or the labelled pictures have another side.
    pub fn fine_tune(
        configuration: &Configuration,
        pictures: Arc<Pictures>,
        fine_tuning: FineTuning,
    ) -> Result<Self, TrainingError> {
        let FineTuning { parent, labelled } = fine_tuning;
        if !configuration.recipe().is_labelled() {
            return Err(TrainingError::NoUseForLabels(configuration.recipe().name()));
        }
        if labelled.side() != pictures.side() {
            return Err(TrainingError::LabelledSide {
                side: pictures.side(),
                labelled: labelled.side(),
            });
        }
        let architecture = Self::architecture(configuration, &pictures)?;
        if *parent.architecture() != architecture {
            return Err(TrainingError::OtherParent);
        }
        let lesson = Lesson {
            labelled,
            parent: CheckpointDigest::of(&onnx::export(&parent)),
        };
        Ok(Self::starting_with(parent, configuration, pictures, Some(lesson)))
    }

    /// What it learns from labels, if its recipe does.
    pub(crate) const fn lesson(&self) -> Option<&Lesson> {
        self.lesson.as_ref()
    }
}

#[cfg(test)]
mod tests;
