//! Pictures that a round learns from: the pictures of labelled individuals, and pictures of their controllers from further
//! starts. The pictures from further starts are in the dataset's table, after the dataset.

use super::{
    ArchivedIndividual, Store, StoreError,
    campaigns::number_of,
    numbers::{clamped, floats_to_blob},
};
use murmuration_model::{CampaignRecord, TrainingPictures};
use murmuration_swarm::Controller;
use rusqlite::params;
use std::collections::BTreeMap;

/// A picture that a round learns from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoundPicture {
    /// The picture of the labelled individual with this index.
    Individual(u64),
    /// A picture of a labelled individual's controller from another start, at this place in the dataset's table.
    Further(u64),
}

#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoundPictures {
    /// The pictures, each with the number of its class.
    pub pictures: Vec<(RoundPicture, u32)>,
    /// Number of labels that the pictures come from.
    pub labels: u32,
    /// Further starts that have no picture yet.
    pub missing: Vec<FurtherStart>,
}

/// A labelled controller to be simulated from another start.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherStart {
    pub controller: Controller,
    pub seed: u64,
    /// Seed of the start that was labelled.
    pub labelled: u64,
}

impl Store {
    /// The pictures that a round with the label cutoff `cutoff` learns from.
    pub fn round_pictures(&self, record: &CampaignRecord, cutoff: u64) -> Result<RoundPictures, StoreError> {
        let labels = self.labels_until(&record.id, cutoff)?.numbered_classes();
        let mut round = RoundPictures {
            labels: labels.len() as u32,
            ..RoundPictures::default()
        };
        let Some(feedback) = record.spec.feedback() else {
            return Ok(round);
        };
        let further = self.further_pictures(record)?;
        for (index, class) in labels {
            round.pictures.push((RoundPicture::Individual(index), class));
            let ArchivedIndividual {
                controller,
                seed: labelled,
                ..
            } = self.one(&record.id, record.spec.model(), index, false)?;
            for seed in feedback.further_starts(record.spec.seed(), index) {
                match further.get(&(seed, floats_to_blob(controller.genes()))) {
                    Some(&place) => round.pictures.push((RoundPicture::Further(place), class)),
                    None => round.missing.push(FurtherStart {
                        controller: controller.clone(),
                        seed,
                        labelled,
                    }),
                }
            }
        }
        Ok(round)
    }

    /// The image of a picture that a round learns from.
    pub fn round_image(&self, record: &CampaignRecord, picture: RoundPicture) -> Result<Vec<u8>, StoreError> {
        let model = record.spec.model();
        match picture {
            RoundPicture::Individual(index) => {
                let individual = self.individual(&record.id, model, index)?;
                Ok(individual.into_image().unwrap_or_default())
            }
            RoundPicture::Further(place) => Ok(self.picture(&record.id, model, place)?.image),
        }
    }

    /// Places of the pictures of further starts, by seed and controller.
    fn further_pictures(&self, record: &CampaignRecord) -> Result<BTreeMap<(u64, Vec<u8>), u64>, StoreError> {
        let first = TrainingPictures::of(record).in_dataset();
        self.read(|connection| {
            let number = number_of(connection, &record.id)?;
            let mut statement = connection.prepare_cached(
                "SELECT seed, controller, place FROM pictures WHERE campaign = ?1 AND place >= ?2",
            )?;
            let rows = statement.query_map(params![number, clamped(first)], |row| {
                let (seed, place): (i64, i64) = (row.get(0)?, row.get(2)?);
                Ok(((seed.cast_unsigned(), row.get(1)?), place.unsigned_abs()))
            })?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
    }
}

#[cfg(test)]
mod tests;
