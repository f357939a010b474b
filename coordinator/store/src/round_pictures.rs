//! What a round learns from: labelled and compared individuals, and pictures of their controllers from further starts, which
//! lie in the table of the dataset, behind it.

use super::{
    ArchivedIndividual, Store, StoreError,
    campaigns::number_of,
    numbers::{clamped, floats_to_blob},
};
use murmuration_model::{
    CampaignRecord, TrainingPictures,
    labels::{ComparedTriplet, Labels},
};
use murmuration_proto::Controller;
use rusqlite::params;
use std::collections::{BTreeMap, BTreeSet};

/// A picture that is learned from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RoundPicture {
    /// That of an individual, which was labelled.
    Individual(u64),
    /// That of its controller from another start, at this place of the dataset's table.
    Further(u64),
}

/// What a round learns from.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RoundPictures {
    /// Each with its class.
    pub pictures: Vec<(RoundPicture, u32)>,
    /// Number of labels that they come from.
    pub labels: u32,
    /// What comparisons say.
    pub compared: RoundComparisons,
    /// Further starts that have no picture yet.
    pub missing: Vec<FurtherStart>,
}

/// The comparisons that a round learns from.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RoundComparisons {
    /// The pictures of one compared individual after the other.
    pub pictures: Vec<RoundPicture>,
    /// Number of compared individuals.
    pub individuals: u32,
    /// Pictures of each of them.
    pub views: u32,
    /// Places of anchor, nearer and farther individual among the compared ones.
    pub triplets: Vec<[u32; 3]>,
}

/// A labelled controller to be simulated from another start.
#[derive(Debug, Clone, PartialEq)]
pub struct FurtherStart {
    /// The controller.
    pub controller: Controller,
    /// Seed of the start.
    pub seed: u64,
    /// Seed of the start that was labelled.
    pub labelled: u64,
}

/// What an embedder learns from: individuals with the numbers of their classes, and what comparisons say.
pub(super) fn learnable(said: &Labels) -> (Vec<(u64, u32)>, Vec<ComparedTriplet>) {
    let (mut labels, triplets) = (said.numbered_classes(), said.compared_triplets());
    // One class says nothing by itself; beside comparisons it need not.
    if !triplets.is_empty() && labels.iter().all(|(_, class)| *class == labels[0].1) {
        labels.clear();
    }
    (labels, triplets)
}

impl Store {
    /// What a campaign learns from by the first `cutoff` entries of its label log.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn round_pictures(&self, record: &CampaignRecord, cutoff: u64) -> Result<RoundPictures, StoreError> {
        let said = self.labels_until(&record.id, cutoff)?;
        let (labels, triplets) = learnable(&said);
        let mut round = RoundPictures {
            labels: labels.len() as u32,
            ..RoundPictures::default()
        };
        if record.spec.feedback().is_none() {
            return Ok(round);
        }
        let named = triplets
            .iter()
            .flat_map(|told| [told.anchor, told.nearer, told.farther]);
        let compared: BTreeSet<u64> = named.collect();
        let labelled = labels.iter().map(|(index, _)| *index);
        let needed: BTreeSet<u64> = labelled.chain(compared.iter().copied()).collect();
        let pictures = self.pictures_of(record, &needed, &mut round.missing)?;
        for (index, class) in labels {
            let own = pictures[&index].iter();
            round.pictures.extend(own.map(|picture| (*picture, class)));
        }
        let views = compared.iter().map(|index| pictures[index].len()).min();
        let views = views.unwrap_or_default();
        let places: BTreeMap<u64, u32> = compared.into_iter().zip(0..).collect();
        let own = places.keys().flat_map(|index| &pictures[index][..views]);
        round.compared = RoundComparisons {
            pictures: own.copied().collect(),
            individuals: places.len() as u32,
            views: views as u32,
            triplets: triplets
                .iter()
                .map(|told| [told.anchor, told.nearer, told.farther].map(|index| places[&index]))
                .collect(),
        };
        Ok(round)
    }

    /// The pictures of individuals: the archived one, and those from further starts that are there. Those that are not are added to
    /// `missing`.
    fn pictures_of(
        &self,
        record: &CampaignRecord,
        individuals: &BTreeSet<u64>,
        missing: &mut Vec<FurtherStart>,
    ) -> Result<BTreeMap<u64, Vec<RoundPicture>>, StoreError> {
        let further = self.further_pictures(record)?;
        let mut pictures = BTreeMap::new();
        for &index in individuals {
            let own: &mut Vec<RoundPicture> = pictures.entry(index).or_default();
            own.push(RoundPicture::Individual(index));
            let ArchivedIndividual {
                controller,
                seed: labelled,
                ..
            } = self.one(&record.id, record.spec.model(), index, false)?;
            let feedback = record.spec.feedback().into_iter();
            for seed in feedback.flat_map(|feedback| feedback.further_starts(record.spec.seed(), index)) {
                match further.get(&(seed, floats_to_blob(controller.genes()))) {
                    Some(&place) => own.push(RoundPicture::Further(place)),
                    None => missing.push(FurtherStart {
                        controller: controller.clone(),
                        seed,
                        labelled,
                    }),
                }
            }
        }
        Ok(pictures)
    }

    /// The image of a picture that is learned from.
    ///
    /// # Errors
    /// If it cannot be read.
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

    /// Where the pictures of further starts are, by seed and controller.
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
