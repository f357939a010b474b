//! Rows of the archive: individuals, their images, generations, taxonomies.

use super::{
    Provenance, Store, StoreError,
    campaigns::number_of,
    compression::Decompressor,
    individual::{ArchivedIndividual, compressed, read},
    numbers::{blob_to_floats, clamped, floats_to_blob},
    provenance::{ResultKind, add_provenance, suspects},
};
use murmuration_model::{CampaignId, CampaignState};
use murmuration_proto::CapabilityModel;
use murmuration_search::medoids::Clustering;
use rusqlite::{OptionalExtension as _, Row, params};
use std::ops::Range;

/// What a generation did, as it is stored.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GenerationRecord {
    /// From 0.
    pub generation: u32,
    /// Highest novelty among its individuals.
    pub best_novelty: f64,
    /// Their mean novelty.
    pub mean_novelty: f64,
    /// Proposals that the filter turned away while it was made.
    pub filtered: u64,
}

impl GenerationRecord {
    /// The record of a generation whose individuals are of this novelty.
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

/// A taxonomy as it is stored; everything else about it follows from the archive.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredTaxonomy {
    /// Archive indices of the medoids, largest cluster first.
    pub medoids: Vec<u64>,
    /// For each individual, the place in `medoids` of the nearest.
    pub clusters: Vec<u32>,
    /// Sum of the distances to the nearest medoids.
    pub loss: f64,
    /// What was measured of each cluster when the taxonomy was made, as many as there are medoids.
    pub measures: Vec<ClusterMeasures>,
    /// For each individual, the number of its trials to which no other medoid is nearer than its own; empty if individuals
    /// have one trial.
    pub robust_trials: Vec<u8>,
}

/// What is measured of a cluster when its taxonomy is made, in units of the behaviour space.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ClusterMeasures {
    /// Mean distance of its members, the medoid included, to the medoid.
    pub mean_distance: f64,
    /// Mean distance of the medoid to its nearest neighbours in the whole archive.
    pub novelty: f64,
}

impl StoredTaxonomy {
    /// Whether every cluster that is named has a medoid, and every medoid its measures.
    fn is_whole(&self) -> bool {
        let medoids = self.medoids.len();
        let robust = self.robust_trials.len();
        self.measures.len() == medoids
            && (robust == 0 || robust == self.clusters.len())
            && self.clusters.iter().all(|&cluster| (cluster as usize) < medoids)
    }
}

impl From<StoredTaxonomy> for Clustering {
    fn from(stored: StoredTaxonomy) -> Self {
        Self {
            medoids: stored.medoids.into_iter().map(|index| index as usize).collect(),
            clusters: stored.clusters,
            loss: stored.loss,
        }
    }
}

impl Store {
    /// Commits one complete generation: its record and its individuals, images, embeddings (by the campaign's checkpoint)
    /// and provenance included, in one transaction.
    ///
    /// # Errors
    /// If it cannot be written; then none of it was.
    pub fn commit_generation(
        &self,
        campaign: &CampaignId,
        record: &GenerationRecord,
        individuals: &[ArchivedIndividual],
        provenance: &Provenance,
    ) -> Result<(), StoreError> {
        // Before the connection is taken, so that nobody waits for it.
        let images = compressed(individuals)?;
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            transaction.execute(
                "INSERT INTO generations (campaign, generation, best_novelty, mean_novelty, filtered)
                 VALUES (?1, ?2, ?3, ?4, ?5)",
                params![
                    number,
                    record.generation,
                    record.best_novelty,
                    record.mean_novelty,
                    record.filtered as i64,
                ],
            )?;
            let first = individuals.first().map_or(0, |individual| individual.index);
            add_provenance(transaction, number, (ResultKind::Evaluation, first), provenance)?;
            let mut individual = transaction.prepare(
                "INSERT INTO individuals (campaign, place, generation, controller, seed, features, novelty, verdicts)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
            )?;
            let mut image =
                transaction.prepare("INSERT INTO images (campaign, place, image) VALUES (?1, ?2, ?3)")?;
            let mut embedding = transaction.prepare(
                "INSERT INTO embeddings (campaign, checkpoint, place, embedding)
                 VALUES (?1, (SELECT checkpoint FROM campaigns WHERE number = ?1), ?2, ?3)",
            )?;
            for (row, images) in individuals.iter().zip(&images) {
                let index = row.index as i64;
                let (features, embeddings) = row.columns();
                individual.execute(params![
                    number,
                    index,
                    row.generation,
                    floats_to_blob(row.controller.genes()),
                    row.seed.cast_signed(),
                    features,
                    row.novelty,
                    row.verdict_column(),
                ])?;
                if let Some(images) = images {
                    image.execute(params![number, index, images])?;
                }
                if !embeddings.is_empty() {
                    embedding.execute(params![number, index, embeddings])?;
                }
            }
            Ok(())
        })
    }

    /// Individuals whose index is in `range`, in order, as far as there are any.
    ///
    /// # Errors
    /// If they cannot be read.
    pub fn individuals(
        &self,
        campaign: &CampaignId,
        model: &CapabilityModel,
        range: Range<u64>,
        with_images: bool,
    ) -> Result<Vec<ArchivedIndividual>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT i.place, i.generation, i.controller, i.seed, i.features, i.novelty, m.image, e.embedding, i.verdicts
                 FROM individuals i JOIN campaigns c ON c.number = i.campaign
                 LEFT JOIN images m ON ?4 AND m.campaign = i.campaign AND m.place = i.place
                 LEFT JOIN embeddings e
                    ON e.campaign = i.campaign AND e.checkpoint = c.checkpoint AND e.place = i.place
                 WHERE i.campaign = ?1 AND i.place >= ?2 AND i.place < ?3 ORDER BY i.place",
            )?;
            let bounds = params![number, clamped(range.start), clamped(range.end), with_images];
            let mut images = match with_images {
                true => Some(Decompressor::of_individuals(connection, number)?),
                false => None,
            };
            let mut rows = statement.query(bounds)?;
            let mut individuals = Vec::new();
            while let Some(row) = rows.next()? {
                individuals.push(read(row, model, images.as_mut())?);
            }
            Ok(individuals)
        })
    }

    /// One individual with its image.
    ///
    /// # Errors
    /// [`StoreError::NoIndividual`], or if it cannot be read.
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
    ///
    /// # Errors
    /// If it cannot be read.
    pub(crate) fn archive_len(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let count: i64 = connection.query_row(
                "SELECT coalesce(max(place) + 1, 0) FROM individuals WHERE campaign = ?1",
                [number],
                |row| row.get(0),
            )?;
            Ok(count.unsigned_abs())
        })
    }

    /// Every complete generation, in order.
    ///
    /// # Errors
    /// If they cannot be read.
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

    /// Stores the taxonomy, with what was measured of its clusters and individuals, and completes the campaign, in one transaction; whether it
    /// did: not while something of the campaign rests on the word of workers that were found wrong.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn complete(
        &self,
        campaign: &CampaignId,
        taxonomy: &Clustering,
        measures: &[ClusterMeasures],
        robust_trials: &[u8],
    ) -> Result<bool, StoreError> {
        let medoids: Vec<u8> = taxonomy
            .medoids
            .iter()
            .flat_map(|&index| (index as u64).to_le_bytes())
            .collect();
        let clusters: Vec<u8> = taxonomy
            .clusters
            .iter()
            .flat_map(|place| place.to_le_bytes())
            .collect();
        let measures: Vec<f64> = measures
            .iter()
            .flat_map(|cluster| [cluster.mean_distance, cluster.novelty])
            .collect();
        let measures = floats_to_blob(&measures);
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            if !suspects(transaction, number)?.is_empty() {
                return Ok(false);
            }
            transaction.execute(
                "INSERT OR REPLACE INTO taxonomies (campaign, medoids, clusters, loss, measures, robust_trials)
                 VALUES (?1, ?2, ?3, ?4, ?5, ?6)",
                params![number, medoids, clusters, taxonomy.loss, measures, robust_trials],
            )?;
            transaction.execute(
                "UPDATE campaigns SET state = ?2, error = '' WHERE number = ?1",
                params![number, CampaignState::Completed.name()],
            )?;
            Ok(true)
        })
    }

    /// The taxonomy of a completed campaign; `None` before that.
    ///
    /// # Errors
    /// If it cannot be read, or its parts do not fit each other.
    pub fn taxonomy(&self, campaign: &CampaignId) -> Result<Option<StoredTaxonomy>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let query = "SELECT medoids, clusters, loss, measures, robust_trials FROM taxonomies WHERE campaign = ?1";
            let stored = connection.query_row(query, [number], stored_taxonomy).optional()?;
            match stored {
                Some(stored) if !stored.is_whole() => Err(StoreError::damaged(format!(
                    "the taxonomy of campaign {campaign}: its clusters, medoids and measures do not fit each other"
                ))),
                stored => Ok(stored),
            }
        })
    }
}

fn stored_taxonomy(row: &Row<'_>) -> rusqlite::Result<StoredTaxonomy> {
    let blob = |column| row.get::<_, Vec<u8>>(column);
    let measures = blob_to_floats(&blob(3)?);
    let measured = |&[mean_distance, novelty]: &[f64; 2]| ClusterMeasures {
        mean_distance,
        novelty,
    };
    let (medoids, clusters) = (blob(0)?, blob(1)?);
    let medoids = medoids.as_chunks().0.iter();
    let clusters = clusters.as_chunks().0.iter();
    Ok(StoredTaxonomy {
        medoids: medoids.map(|bytes| u64::from_le_bytes(*bytes)).collect(),
        clusters: clusters.map(|bytes| u32::from_le_bytes(*bytes)).collect(),
        loss: row.get(2)?,
        measures: measures.as_chunks().0.iter().map(measured).collect(),
        robust_trials: blob(4)?,
    })
}
