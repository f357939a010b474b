//! Rows of the archive: individuals, their images, generations.

use super::{
    Provenance, Store, StoreError,
    campaigns::number_of,
    chunks::{self, EMBEDDINGS, IMAGES, INDIVIDUALS, Reader},
    hidden::HIDDEN,
    images::{Decompressor, StoredImage},
    individual::{ArchivedIndividual, Further, compressed, read},
    numbers::{clamped, floats_to_blob},
    provenance::{ResultKind, add_provenance},
};
use murmuration_model::{CampaignId, CampaignRecord};
use murmuration_proto::v1;
use murmuration_swarm::{BehaviourSpace, CapabilityModel, Scale};
use rusqlite::{Transaction, params};
use std::{collections::BTreeSet, ops::Range};

/// A stored generation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GenerationRecord {
    /// Number of the generation, from 0.
    pub generation: u32,
    /// Highest novelty among the generation's individuals.
    pub best_novelty: f64,
    /// Mean novelty of the generation's individuals.
    pub mean_novelty: f64,
    /// Number of proposals that the filter rejected while the generation was made.
    pub filtered: u64,
}

impl From<GenerationRecord> for v1::GenerationSummary {
    fn from(record: GenerationRecord) -> Self {
        Self {
            generation: record.generation,
            best_novelty: record.best_novelty,
            mean_novelty: record.mean_novelty,
            filtered: record.filtered,
        }
    }
}

impl GenerationRecord {
    /// The record of a generation whose individuals have this novelty.
    #[must_use]
    pub fn of(generation: u32, novelty: &[f64], filtered: u64) -> Self {
        Self {
            generation,
            best_novelty: novelty.iter().copied().fold(0.0, f64::max),
            mean_novelty: novelty.iter().sum::<f64>() / novelty.len().max(1) as f64,
            filtered,
        }
    }
}

impl Store {
    /// Number of individuals in the archives of all campaigns.
    pub fn count_individuals(&self) -> Result<u64, StoreError> {
        self.read(|connection| {
            // The last chunk gives the number, because places have no gaps. Counting would read every row.
            let individuals = "SELECT coalesce(sum((SELECT first + individuals FROM individual_chunks
                    WHERE campaign = number ORDER BY first DESC LIMIT 1)), 0)
                FROM campaigns WHERE state <> ?1";
            let count: i64 = connection.query_row(individuals, [HIDDEN], |row| row.get(0))?;
            Ok(count.unsigned_abs())
        })
    }

    /// Commits one complete generation in one transaction: its record, its provenance, and its individuals with their images and
    /// their embeddings (by the campaign's checkpoint).
    ///
    /// # Errors
    /// If the generation cannot be written; no part of it is written then.
    pub fn commit_generation<I: StoredImage>(
        &self,
        campaign: &CampaignId,
        record: &GenerationRecord,
        individuals: &[ArchivedIndividual<I>],
        provenance: &Provenance,
    ) -> Result<(), StoreError> {
        // The images are compressed before the connection is locked, so that no other write waits for the compression.
        let images = compressed(individuals)?;
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            insert_generation(transaction, number, record)?;
            let first = individuals.first().map_or(0, |individual| individual.index);
            add_provenance(transaction, number, ResultKind::Evaluation, first, provenance)?;
            insert_individuals(transaction, number, individuals, &images)
        })
    }

    /// The individuals whose index is in `range`, in order; fewer if the archive ends before.
    pub fn individuals(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        range: Range<u64>,
        with_images: bool,
    ) -> Result<Vec<ArchivedIndividual>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut rows = INDIVIDUALS.reader(connection, number, "TRUE")?;
            let mut embeddings = EMBEDDINGS.reader(connection, number, chunks::CURRENT)?;
            let mut images = match with_images {
                true => Some((
                    Decompressor::of_individuals(connection, number)?,
                    IMAGES.reader(connection, number, "TRUE")?,
                )),
                false => None,
            };
            let (mut range, mut individuals) = (range, Vec::new());
            while let Some(member) = rows.next(&mut range)? {
                let embeddings = embeddings.at(member.place)?;
                let images = images.as_mut().map(|(decompressor, images)| {
                    let found = images.at(member.place)?;
                    Ok::<_, StoreError>(found.map(|found| (decompressor, found.value(0))))
                });
                let further = Further {
                    images: images.transpose()?.flatten(),
                    embeddings: embeddings.map_or(&[], |found| found.value(0)),
                };
                individuals.push(read(member, model, further)?);
            }
            Ok(individuals)
        })
    }

    /// The scale of an archive's behaviour space, computed from the features and embeddings of the first generation.
    pub fn scale(&self, record: &CampaignRecord) -> Result<Scale, StoreError> {
        let spec = &record.spec;
        let len = match spec.space() {
            BehaviourSpace::Both => u64::from(spec.search().population()),
            BehaviourSpace::Features | BehaviourSpace::Embedding => 0,
        };
        let first = self.individuals(&record.id, spec.model(), 0..len, false)?;
        let first: Vec<_> = first
            .iter()
            .map(|one| (one.features(), one.embedding()))
            .collect();
        Ok(Scale::of(spec.space(), &first))
    }

    /// The individuals with these indices, in order, without images and embeddings. Indices beyond the archive are skipped.
    pub fn measured_individuals(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        indices: &BTreeSet<u64>,
    ) -> Result<Vec<ArchivedIndividual>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut rows = INDIVIDUALS.reader(connection, number, "TRUE")?;
            let mut individuals = Vec::new();
            for &index in indices {
                if let Some(member) = rows.at(index)? {
                    individuals.push(read(member, model, Further::default())?);
                }
            }
            Ok(individuals)
        })
    }

    /// One individual with its image.
    ///
    /// # Errors
    /// [`StoreError::NoIndividual`], or if the individual cannot be read.
    pub fn individual(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        index: u64,
    ) -> Result<ArchivedIndividual, StoreError> {
        self.one(campaign, model, index, true)
    }

    /// One individual, with its image or without.
    pub(super) fn one(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        index: u64,
        with_image: bool,
    ) -> Result<ArchivedIndividual, StoreError> {
        let range = index..index.saturating_add(1);
        match self.individuals(campaign, model, range, with_image)?.pop() {
            Some(found) => Ok(found),
            None => {
                let len = self.archive_len(campaign)?;
                Err(StoreError::NoIndividual {
                    campaign: campaign.as_str().to_owned(),
                    index,
                    len,
                })
            }
        }
    }

    /// Number of individuals in the archive.
    pub(crate) fn archive_len(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            chunks::archive_len(connection, number)
        })
    }

    /// Every complete generation, in order.
    pub fn generations(&self, campaign: &CampaignId) -> Result<Vec<GenerationRecord>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare(
                "SELECT generation, best_novelty, mean_novelty, filtered FROM generations
                 WHERE campaign = ?1 ORDER BY generation",
            )?;
            let rows = statement.query_map([number], |row| {
                Ok(GenerationRecord {
                    generation: row.get(0)?,
                    best_novelty: row.get(1)?,
                    mean_novelty: row.get(2)?,
                    filtered: row.get::<_, i64>(3)?.unsigned_abs(),
                })
            })?;
            rows.map(|row| Ok(row?)).collect()
        })
    }

    /// The most novel individuals of the `count` generations with the highest novelty when evaluated: one individual for each
    /// generation, with its index, generation and novelty.
    pub fn most_novel(&self, campaign: &CampaignId, count: u32) -> Result<Vec<(u64, u32, f64)>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let len = chunks::archive_len(connection, number)?;
            let mut generations = connection.prepare_cached(
                "SELECT generation, best_novelty, (SELECT max(generation) + 1 FROM generations WHERE campaign = ?1)
                 FROM generations WHERE campaign = ?1 ORDER BY best_novelty DESC, generation LIMIT ?2",
            )?;
            let mut individuals = INDIVIDUALS.reader(connection, number, "TRUE")?;
            let mut found = Vec::new();
            let mut rows = generations.query(params![number, count])?;
            while let Some(row) = rows.next()? {
                let (generation, novelty, generations): (u32, f64, u32) = row.try_into()?;
                let size = len / u64::from(generations).max(1);
                let first = u64::from(generation) * size;
                if let Some(place) = most_novel_in(&mut individuals, first..first + size)? {
                    found.push((place, generation, novelty));
                }
            }
            Ok(found)
        })
    }
}

/// The first of the most novel individuals in `range`, if the range has any.
fn most_novel_in(individuals: &mut Reader<'_>, range: Range<u64>) -> Result<Option<u64>, StoreError> {
    let (mut range, mut most) = (range, None);
    while let Some(member) = individuals.next(&mut range)? {
        let novelty = member.novelty()?;
        if most.is_none_or(|(_, other)| novelty > other) {
            most = Some((member.place, novelty));
        }
    }
    Ok(most.map(|(place, _)| place))
}

/// Adds the record of a generation.
pub(super) fn insert_generation(
    transaction: &Transaction<'_>,
    campaign: i64,
    record: &GenerationRecord,
) -> Result<(), StoreError> {
    transaction.execute(
        "INSERT INTO generations (campaign, generation, best_novelty, mean_novelty, filtered)
         VALUES (?1, ?2, ?3, ?4, ?5)",
        params![
            campaign,
            record.generation,
            record.best_novelty,
            record.mean_novelty,
            record.filtered as i64,
        ],
    )?;
    Ok(())
}

/// Adds individuals with their compressed images and their embeddings.
pub(super) fn insert_individuals<I>(
    transaction: &Transaction<'_>,
    campaign: i64,
    individuals: &[ArchivedIndividual<I>],
    images: &[Option<Vec<u8>>],
) -> Result<(), StoreError> {
    let checkpoint = "SELECT checkpoint FROM campaigns WHERE number = ?1";
    let checkpoint: Option<i64> = transaction.query_row(checkpoint, [campaign], |row| row.get(0))?;
    let mut rows = INDIVIDUALS.writer(transaction)?;
    let mut frames = IMAGES.writer(transaction)?;
    let mut further = EMBEDDINGS.writer(transaction)?;
    for (individual, images) in individuals.iter().zip(images) {
        let (place, generation) = (clamped(individual.index), Some(individual.generation.into()));
        let (features, embeddings) = individual.columns();
        let values = [
            individual.seed.to_le_bytes().to_vec(),
            floats_to_blob(individual.controller.genes()),
            features,
            individual.novelty.to_le_bytes().to_vec(),
            individual.verdict_column(),
        ];
        rows.add(campaign, generation, place, &values)?;
        if let Some(images) = images {
            frames.add(campaign, generation, place, &[images])?;
        }
        if !embeddings.is_empty() {
            further.add(campaign, checkpoint, place, &[embeddings])?;
        }
    }
    rows.finish()?;
    frames.finish()?;
    Ok(further.finish()?)
}
