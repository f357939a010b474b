//! Individuals as values of columns. A value has the measurements of all trials of an individual, one after the other.

use super::{
    StoreError,
    chunks::Member,
    images::{Decompressor, StoredImage, columns},
    numbers::{blob_to_floats, blob_to_numbers, floats_to_blob, numbers_to_blob},
};
use murmuration_proto::v1;
use murmuration_swarm::{
    CapabilityModel, Controller, Features, Scale, Starts, Verdict, mean_embedding, mean_features,
};

/// One evaluated controller, with its images if the caller asked for images.
#[derive(Debug, Clone, PartialEq)]
pub struct ArchivedIndividual<I = Vec<u8>> {
    /// Place in the archive, from 0.
    pub index: u64,
    /// Generation, from 0.
    pub generation: u32,
    pub controller: Controller,
    /// Seed of the individual's first start. The seeds of the other starts follow from this seed ([`Starts::seeds`]).
    pub seed: u64,
    /// One trial for each start; at least one trial.
    pub trials: Vec<Trial<I>>,
    /// Novelty when evaluated: the individual's mean distance to its nearest neighbours in the archive as it was after the
    /// individual's generation.
    pub novelty: f64,
}

/// Result of one simulation of an individual.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Trial<I = Vec<u8>> {
    /// Hand-crafted features.
    pub features: Features,
    /// Embedding of the picture by the campaign's checkpoint; empty without a checkpoint.
    pub embedding: Vec<f32>,
    /// Grey values of the picture, at index x * resolution + y; `None` if the caller did not ask for images.
    pub image: Option<I>,
    /// The judge's verdict, if the campaign has a judge.
    pub verdict: Option<Verdict>,
}

impl ArchivedIndividual {
    /// The individual's picture: the picture of its first trial.
    #[must_use]
    pub fn image(&self) -> Option<&[u8]> {
        self.trials.first()?.image.as_deref()
    }

    /// Consumes the individual, and returns its picture (see [`ArchivedIndividual::image`]).
    #[must_use]
    pub fn into_image(mut self) -> Option<Vec<u8>> {
        self.trials.first_mut()?.image.take()
    }

    /// The pictures of the individual's trials; empty if the individual was read without images.
    #[must_use]
    pub fn into_images(self) -> Vec<Vec<u8>> {
        self.trials.into_iter().filter_map(|trial| trial.image).collect()
    }

    /// An individual without measurements: one trial with zeros, no embedding and no picture.
    #[must_use]
    pub fn unmeasured(index: u64, generation: u32, controller: Controller) -> Self {
        Self {
            index,
            generation,
            controller,
            seed: 0,
            trials: vec![Trial::default()],
            novelty: 0.0,
        }
    }

    /// An individual whose swarm never moved.
    #[cfg(test)]
    pub(crate) fn still(index: u64, generation: u32) -> Self {
        let controller = Controller::new(murmuration_swarm::Preset::SingleSensor, &[0.0; 4]).unwrap();
        Self::unmeasured(index, generation, controller)
    }

    /// An individual whose swarm never moved, with `image` as its picture.
    #[cfg(test)]
    pub(crate) fn pictured(index: u64, generation: u32, image: Vec<u8>) -> Self {
        Self::still(index, generation).with_trial(Trial {
            image: Some(image),
            ..Trial::default()
        })
    }

    #[must_use]
    pub fn with_trial(self, trial: Trial) -> Self {
        Self {
            trials: vec![trial],
            ..self
        }
    }
}

impl<I> ArchivedIndividual<I> {
    /// The individual's hand-crafted features: means over its trials.
    #[must_use]
    pub fn features(&self) -> Features {
        mean_features(self.trials.iter().map(|trial| &trial.features))
    }

    /// The individual's embedding: the mean over its trials; empty if the trials have no embeddings.
    #[must_use]
    pub fn embedding(&self) -> Vec<f32> {
        mean_embedding(self.trials.iter().map(|trial| trial.embedding.as_slice()))
    }

    /// Its behaviour vector, on which novelty and clusters are measured.
    #[must_use]
    pub fn behaviour(&self, scale: &Scale) -> Vec<f64> {
        scale.behaviour(&self.features(), &self.embedding())
    }

    /// The values of the columns for features and embeddings.
    pub(super) fn columns(&self) -> (Vec<u8>, Vec<u8>) {
        let trials = self.trials.iter();
        let features: Vec<f64> = trials.clone().flat_map(|trial| trial.features).collect();
        let embeddings: Vec<f32> = trials.flat_map(|trial| trial.embedding.iter().copied()).collect();
        (floats_to_blob(&features), numbers_to_blob(&embeddings))
    }

    /// The judge's verdicts on the individual's trials; empty if the campaign has no judge.
    pub fn verdicts(&self) -> impl Iterator<Item = Verdict> {
        self.trials.iter().filter_map(|trial| trial.verdict)
    }

    pub(super) fn verdict_column(&self) -> Vec<u8> {
        self.verdicts().map(Verdict::number).collect()
    }
}

/// For each individual, the value of the column for images; `None` for an individual without images.
pub(super) fn compressed<I: StoredImage>(
    individuals: &[ArchivedIndividual<I>],
) -> Result<Vec<Option<Vec<u8>>>, StoreError> {
    columns(individuals.iter().map(|individual| {
        let images = individual.trials.iter().map(|trial| trial.image.as_ref());
        images.collect::<Option<Vec<_>>>()
    }))
}

/// The pictures and embeddings of an individual, as values of their columns, as far as they exist and the caller asked for them.
#[derive(Default)]
pub(super) struct Further<'a> {
    pub(super) images: Option<(&'a mut Decompressor, &'a [u8])>,
    pub(super) embeddings: &'a [u8],
}

/// Decodes an individual, and the pictures and embeddings that belong to it.
pub(super) fn read(
    member: Member<'_>,
    model: &CapabilityModel,
    further: Further<'_>,
) -> Result<ArchivedIndividual, StoreError> {
    let index = member.place;
    let damaged = |what: &dyn std::fmt::Display| StoreError::damaged(format!("individual {index}: {what}"));
    let [seed, controller, features, _, verdicts] = member.values();
    let images = further.images.map(|(images, column)| images.decompress(column));
    let images = images
        .transpose()
        .map_err(|error| damaged(&format_args!("its picture is {error}")))?;
    let embeddings = blob_to_numbers(further.embeddings);
    let trials = trials(&blob_to_floats(features), &embeddings, images.as_deref());
    let trials = trials.and_then(|trials| judged(trials, verdicts));
    Ok(ArchivedIndividual {
        index,
        generation: u32::try_from(member.common()).map_err(|_| damaged(&"its generation is no number"))?,
        controller: Controller::new(model, &blob_to_floats(controller)).map_err(|error| damaged(&error))?,
        seed: u64::from_le_bytes(
            seed.try_into()
                .map_err(|_| damaged(&"its seed is not of eight bytes"))?,
        ),
        trials: trials.map_err(|error| damaged(&error))?,
        novelty: member.novelty()?,
    })
}

/// Decodes the trials from the values of their columns.
fn trials(features: &[f64], embeddings: &[f32], images: Option<&[u8]>) -> Result<Vec<Trial>, &'static str> {
    let (features, rest) = features.as_chunks();
    let count = features.len();
    if !(1..=Starts::MAX as usize).contains(&count) || !rest.is_empty() {
        return Err("not five features");
    }
    if !embeddings.len().is_multiple_of(count) {
        return Err("its features and embeddings are for different numbers of trials");
    }
    if images.is_some_and(|images| !images.len().is_multiple_of(count)) {
        return Err("its features and pictures are for different numbers of trials");
    }
    let dimensions = embeddings.len() / count;
    let trial = |(place, features): (usize, &Features)| Trial {
        features: *features,
        embedding: embeddings[place * dimensions..(place + 1) * dimensions].to_vec(),
        image: images.map(|images| {
            let pixels = images.len() / count;
            images[place * pixels..(place + 1) * pixels].to_vec()
        }),
        verdict: None,
    };
    Ok(features.iter().enumerate().map(trial).collect())
}

/// Adds the verdicts from a column's value to the trials.
fn judged(trials: Vec<Trial>, verdicts: &[u8]) -> Result<Vec<Trial>, &'static str> {
    if verdicts.is_empty() {
        return Ok(trials);
    }
    if verdicts.len() != trials.len() {
        return Err("its features and verdicts are for different numbers of trials");
    }
    let judged = |(trial, &number): (Trial, &u8)| {
        let verdict = Verdict::try_from(i32::from(number)).map_err(|_| "an unknown verdict")?;
        Ok(Trial {
            verdict: Some(verdict),
            ..trial
        })
    };
    trials.into_iter().zip(verdicts).map(judged).collect()
}

impl From<ArchivedIndividual> for v1::Individual {
    fn from(individual: ArchivedIndividual) -> Self {
        let starts = individual.trials.len();
        let seeds = Starts::new("trials", starts as u32).unwrap_or_default();
        let trial = |(seed, trial): (u64, &Trial)| v1::Trial {
            seed,
            features: trial.features.to_vec(),
            embedding: trial.embedding.clone(),
        };
        let trials = seeds.seeds(individual.seed).zip(&individual.trials);
        Self {
            index: individual.index,
            generation: individual.generation,
            controller: individual.controller.genes().to_vec(),
            seed: individual.seed,
            features: individual.features().to_vec(),
            novelty: individual.novelty,
            embedding: individual.embedding(),
            trials: trials.filter(|_| starts > 1).map(trial).collect(),
            verdicts: individual
                .verdicts()
                .map(|verdict| verdict.number().into())
                .collect(),
            image: individual.into_image(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_swarm::BehaviourSpace;

    #[test]
    fn what_is_measured_of_an_individual_is_the_mean_over_its_trials() {
        let trial = |value: f32, grey| Trial {
            features: [f64::from(value); 5],
            embedding: vec![value, -value],
            image: Some(vec![grey; 4]),
            verdict: None,
        };
        let individual = ArchivedIndividual {
            trials: vec![trial(1.0, 10), trial(2.0, 20), trial(6.0, 30)],
            ..ArchivedIndividual::still(0, 0)
        };
        assert_eq!(individual.features(), [3.0; 5]);
        assert_eq!(individual.embedding(), [3.0, -3.0]);
        assert_eq!(individual.image(), Some([10; 4].as_slice()));
        assert_eq!(
            individual.behaviour(&Scale::unscaled(BehaviourSpace::Embedding)),
            [3.0, -3.0]
        );
        assert_eq!(
            individual.behaviour(&Scale::unscaled(BehaviourSpace::Features)),
            [3.0; 5]
        );
    }

    #[test]
    fn columns_that_do_not_fit_each_other_are_damaged() {
        assert_eq!(trials(&[0.0; 10], &[0.0; 6], Some(&[0; 8])).unwrap().len(), 2);
        assert!(trials(&[], &[], None).is_err());
        assert!(trials(&[0.0; 7], &[], None).is_err());
        assert!(trials(&[0.0; 85], &[], None).is_err());
        assert!(trials(&[0.0; 10], &[0.0; 5], None).is_err());
        assert!(trials(&[0.0; 10], &[], Some(&[0; 3])).is_err());
        let two = || trials(&[0.0; 10], &[], None).unwrap();
        assert_eq!(judged(two(), &[]).unwrap(), two());
        assert_eq!(
            judged(two(), &[2, 11]).unwrap()[1].verdict.map(Verdict::number),
            Some(11)
        );
        assert!(judged(two(), &[2]).is_err() && judged(two(), &[2, 16]).is_err());
    }
}
