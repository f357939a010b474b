//! The labelled sets that measure the embeddings of a study.

use crate::accuracy;
use murmuration_accuracy::{Accuracy, LabelledSet};
use murmuration_cli::{CliError, files::read};
use murmuration_embed::{Embedder, Runtime};
use murmuration_files::InputKind;
use murmuration_onnx::{EmbedderModel, ImageShape};
use murmuration_study::{Measure, Study};
use murmuration_swarm::{CampaignSpec, SeenPictures};
use std::{
    collections::BTreeMap,
    sync::{Mutex, PoisonError},
};

/// The labelled sets of each robot, by the robot's name.
#[derive(Debug, Default)]
pub(super) struct Labelled {
    sets: BTreeMap<String, Vec<LabelledSet>>,
    /// Pictures of the labelled sets. The first use simulates the pictures, because the simulation takes seconds.
    images: Mutex<BTreeMap<String, Vec<Vec<u8>>>>,
}

impl Labelled {
    /// Reads the sets of a study, and returns them with the bytes of their files.
    pub(super) fn read(study: &Study) -> Result<(Self, Vec<Vec<u8>>), CliError> {
        let (mut sets, mut contents) = (BTreeMap::new(), Vec::new());
        if !study.measures.which.contains(&Measure::Accuracy) {
            return Ok((Self::default(), contents));
        }
        for (model, files) in &study.measures.labelled {
            for file in files {
                contents.push(read(file, InputKind::Labels)?);
            }
            let read = files.iter().map(LabelledSet::read).collect::<Result<_, _>>()?;
            sets.insert(model.clone(), read);
        }
        let labelled = Self {
            sets,
            images: Mutex::default(),
        };
        Ok((labelled, contents))
    }

    /// The sets for the robots of a cell, with the robots' name; `None` if the study has no such sets.
    fn of(&self, spec: &CampaignSpec) -> Option<(&str, &[LabelledSet])> {
        let model = spec.model().preset()?.name();
        let (model, sets) = self.sets.get_key_value(model)?;
        Some((model, sets))
    }

    /// The accuracy of the hand-crafted features; `None` without sets for the robots of the cell.
    pub(super) fn of_features(&self, spec: &CampaignSpec) -> Result<Option<Accuracy>, CliError> {
        let Some((_, sets)) = self.of(spec) else {
            return Ok(None);
        };
        Ok(Some(accuracy::measure(sets, accuracy::features(sets)?)))
    }

    /// The accuracy of a checkpoint with the bytes `file`; `None` without sets for the robots of the cell.
    pub(super) fn of_checkpoint(
        &self,
        spec: &CampaignSpec,
        file: &[u8],
        seen: &SeenPictures,
    ) -> Result<Option<Accuracy>, CliError> {
        let Some((model, sets)) = self.of(spec) else {
            return Ok(None);
        };
        let invalid = |error: &dyn std::fmt::Display| CliError::Failed(format!("the checkpoint: {error}"));
        let checkpoint = EmbedderModel::read(file).map_err(|error| invalid(&error))?;
        let mut embedder = Embedder::open(&Runtime::load()?, checkpoint)?;
        let shape = embedder.model().images();
        let mut made = self.images.lock().unwrap_or_else(PoisonError::into_inner);
        let images = match made.entry(format!("{model} {shape}")) {
            std::collections::btree_map::Entry::Occupied(known) => known.into_mut(),
            std::collections::btree_map::Entry::Vacant(room) => room.insert(images(sets, shape)?),
        };
        let vectors = accuracy::embeddings(&mut embedder, images, seen)?;
        Ok(Some(accuracy::measure(sets, vectors)))
    }
}

/// The pictures of the labelled behaviours of several sets.
fn images(sets: &[LabelledSet], shape: ImageShape) -> Result<Vec<Vec<u8>>, CliError> {
    let images = sets.iter().map(|set| accuracy::images_beside(set, shape));
    Ok(images.collect::<Result<Vec<_>, _>>()?.concat())
}
