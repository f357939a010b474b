//! Rows of taxonomies. A campaign gets a new taxonomy each time it learns from labels; former taxonomies stay as versions.

use super::{
    Store, StoreError,
    campaigns::{ended_ms, number_of},
    chunks,
    numbers::{blob_to_floats, blob_to_numbers, clamped, floats_to_blob, now_ms, numbers_to_blob},
    provenance::suspects,
};
use murmuration_model::{CampaignId, CampaignState};
use murmuration_search::medoids::Clustering;
use murmuration_swarm::CheckpointDigest;
use rusqlite::{Connection, OptionalExtension as _, Row, Transaction, params};

/// A taxonomy as it is stored; everything else about it follows from the archive.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredTaxonomy {
    /// Archive indices of the medoids, largest cluster first.
    pub medoids: Vec<u64>,
    /// For each individual, the place of its nearest medoid in `medoids`.
    pub clusters: Vec<u32>,
    /// Sum of the individuals' distances to their nearest medoids.
    pub loss: f64,
    /// Measures of the clusters at the time when the taxonomy was made, one entry for each medoid.
    pub measures: Vec<ClusterMeasures>,
    /// For each individual, the number of its trials to which no medoid is nearer than the individual's own medoid; empty if
    /// individuals have one trial.
    pub robust_trials: Vec<u8>,
}

/// Measures of a cluster at the time when its taxonomy was made, in units of the behaviour space.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct ClusterMeasures {
    /// Mean distance of the cluster's members, the medoid included, to the medoid.
    pub mean_distance: f64,
    /// Mean distance of the medoid to its nearest neighbours in the whole archive.
    pub novelty: f64,
}

/// A version of a campaign's taxonomy: the state of the archive that it was made from, and its time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaxonomyVersion {
    /// Number of the version, from 1; later versions have larger numbers.
    pub version: u32,
    /// Whether this is the current version, made from the archive's current embeddings.
    pub stands: bool,
    /// When the taxonomy was made, milliseconds since 1970-01-01 UTC; `None` for an imported taxonomy.
    pub made_ms: Option<u64>,
    /// The checkpoint whose embeddings were clustered, if the archive had embeddings.
    pub checkpoint: Option<CheckpointDigest>,
    /// Number of rounds of feedback before the taxonomy was made.
    pub rounds: u32,
    /// Number of complete generations that were clustered.
    pub generations: u32,
    pub individuals: u64,
}

impl StoredTaxonomy {
    /// Number of individuals in each cluster.
    #[must_use]
    pub fn sizes(&self) -> Vec<u64> {
        let mut sizes = vec![0; self.medoids.len()];
        for &cluster in &self.clusters {
            if let Some(size) = sizes.get_mut(cluster as usize) {
                *size += 1;
            }
        }
        sizes
    }

    /// Whether every named cluster has a medoid, every medoid has measures, and `robust_trials` is empty or covers every
    /// individual.
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
    /// Stores the taxonomy as a new version, with the measures of its clusters and individuals, and completes the campaign, in
    /// one transaction. Changes nothing and returns false while the campaign has results that only quarantined machines computed.
    /// `points` are the individuals' positions on the map, in units of the behaviour space; `points` can be empty.
    pub fn complete(
        &self,
        campaign: &CampaignId,
        taxonomy: &Clustering,
        measures: &[ClusterMeasures],
        robust_trials: &[u8],
        points: &[[f32; 2]],
    ) -> Result<bool, StoreError> {
        let stored = StoredTaxonomy {
            medoids: taxonomy.medoids.iter().map(|&index| index as u64).collect(),
            clusters: taxonomy.clusters.clone(),
            loss: taxonomy.loss,
            measures: measures.to_vec(),
            robust_trials: robust_trials.to_vec(),
        };
        self.write(|transaction| {
            let number = number_of(transaction, campaign)?;
            if !suspects(transaction, number)?.is_empty() {
                return Ok(false);
            }
            insert_taxonomy(transaction, number, &stored, points, Some(now_ms()))?;
            transaction.execute(
                "UPDATE campaigns SET state = ?2, error = '', ended_ms = ?3 WHERE number = ?1",
                params![
                    number,
                    CampaignState::Completed.name(),
                    ended_ms(CampaignState::Completed)
                ],
            )?;
            Ok(true)
        })
    }

    /// The taxonomy of a completed campaign; `None` before completion.
    ///
    /// # Errors
    /// If the taxonomy cannot be read, or its parts do not fit each other.
    pub fn taxonomy(&self, campaign: &CampaignId) -> Result<Option<StoredTaxonomy>, StoreError> {
        self.read(|connection| whole_taxonomy(connection, campaign, "stands"))
    }

    /// A version of a campaign's taxonomy, current or former; `None` if no version has that number.
    ///
    /// # Errors
    /// The errors of [`Store::taxonomy`].
    pub fn taxonomy_of_version(
        &self,
        campaign: &CampaignId,
        version: u32,
    ) -> Result<Option<StoredTaxonomy>, StoreError> {
        self.read(|connection| whole_taxonomy(connection, campaign, &format!("version = {version}")))
    }

    /// The versions of a campaign's taxonomy, oldest first; only the last version can be current.
    pub fn taxonomy_versions(&self, campaign: &CampaignId) -> Result<Vec<TaxonomyVersion>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut statement = connection.prepare_cached(
                "SELECT t.version, t.stands, t.made_ms, c.digest, t.rounds, t.generations, length(t.clusters) / 4
                 FROM taxonomies t LEFT JOIN checkpoints c ON c.number = t.checkpoint
                 WHERE t.campaign = ?1 ORDER BY t.version",
            )?;
            let rows = statement.query_map([number], |row| {
                let digest: Option<String> = row.get(3)?;
                let version = TaxonomyVersion {
                    version: row.get(0)?,
                    stands: row.get(1)?,
                    made_ms: row.get::<_, Option<i64>>(2)?.map(i64::unsigned_abs),
                    checkpoint: None,
                    rounds: row.get(4)?,
                    generations: row.get(5)?,
                    individuals: row.get::<_, i64>(6)?.unsigned_abs(),
                };
                Ok((version, digest))
            })?;
            rows.map(|row| {
                let (version, digest) = row?;
                let checkpoint = digest.map(|digest| digest.parse()).transpose();
                let damaged = |error: murmuration_swarm::Invalid| StoreError::damaged(error.to_string());
                Ok(TaxonomyVersion {
                    checkpoint: checkpoint.map_err(damaged)?,
                    ..version
                })
            })
            .collect()
        })
    }

    /// Position of each individual on a version's map, by index: coordinates along the principal axes of the behaviour space, in
    /// units of that space. Empty for an imported version.
    pub fn taxonomy_points(&self, campaign: &CampaignId, version: u32) -> Result<Vec<[f32; 2]>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let query = "SELECT points FROM taxonomies WHERE campaign = ?1 AND version = ?2";
            let points: Option<Vec<u8>> = connection
                .query_row(query, params![number, version], |row| row.get(0))
                .optional()?;
            Ok(blob_to_numbers(&points.unwrap_or_default())
                .as_chunks()
                .0
                .to_vec())
        })
    }
}

/// The version of a campaign's taxonomy for which the SQL expression `which` is true.
fn whole_taxonomy(
    connection: &Connection,
    campaign: &CampaignId,
    which: &str,
) -> Result<Option<StoredTaxonomy>, StoreError> {
    let number = number_of(connection, campaign)?;
    let query = format!(
        "SELECT medoids, clusters, loss, measures, robust_trials FROM taxonomies WHERE campaign = ?1 AND {which}"
    );
    let stored = connection
        .query_row(&query, [number], stored_taxonomy)
        .optional()?;
    match stored {
        Some(stored) if !stored.is_whole() => Err(StoreError::damaged(format!(
            "the taxonomy of campaign {campaign}: its clusters, medoids and measures do not fit each other"
        ))),
        stored => Ok(stored),
    }
}

/// Makes the current version of a campaign's taxonomy a former version.
pub(super) fn retire_taxonomy(transaction: &Transaction<'_>, campaign: i64) -> Result<(), StoreError> {
    transaction.execute("UPDATE taxonomies SET stands = 0 WHERE campaign = ?1", [campaign])?;
    Ok(())
}

/// Deletes the current version of a campaign's taxonomy, because it is wrong, and all versions with individuals that no longer
/// exist.
pub(super) fn withdraw_taxonomies(transaction: &Transaction<'_>, campaign: i64) -> Result<(), StoreError> {
    let individuals = clamped(chunks::archive_len(transaction, campaign)?);
    transaction.execute(
        "DELETE FROM taxonomies WHERE campaign = ?1 AND (stands OR length(clusters) / 4 > ?2)",
        [campaign, individuals],
    )?;
    Ok(())
}

/// Stores a taxonomy as the current version, made at `made_ms` if the time is known. The new version replaces a current version
/// with the same number of individuals and the same checkpoint.
pub(super) fn insert_taxonomy(
    transaction: &Transaction<'_>,
    campaign: i64,
    taxonomy: &StoredTaxonomy,
    points: &[[f32; 2]],
    made_ms: Option<i64>,
) -> Result<(), StoreError> {
    let medoids = taxonomy.medoids.iter().flat_map(|index| index.to_le_bytes());
    let clusters = taxonomy.clusters.iter().flat_map(|place| place.to_le_bytes());
    let measures = taxonomy.measures.iter();
    let measures: Vec<f64> = measures
        .flat_map(|cluster| [cluster.mean_distance, cluster.novelty])
        .collect();
    let clusters: Vec<u8> = clusters.collect();
    transaction.execute(
        "DELETE FROM taxonomies WHERE campaign = ?1 AND stands AND length(clusters) = ?2
            AND checkpoint IS (SELECT checkpoint FROM campaigns WHERE number = ?1)",
        params![campaign, clusters.len() as i64],
    )?;
    retire_taxonomy(transaction, campaign)?;
    transaction.execute(
        "INSERT INTO taxonomies (campaign, version, stands, made_ms, checkpoint, rounds, generations, medoids, clusters, loss,
            measures, robust_trials, points)
         SELECT number, (SELECT coalesce(max(version), 0) + 1 FROM taxonomies WHERE campaign = ?1), 1, ?2, checkpoint, rounds,
            (SELECT coalesce(max(generation) + 1, 0) FROM generations WHERE campaign = ?1), ?3, ?4, ?5, ?6, ?7, ?8
         FROM campaigns WHERE number = ?1",
        params![
            campaign,
            made_ms,
            medoids.collect::<Vec<u8>>(),
            clusters,
            taxonomy.loss,
            floats_to_blob(&measures),
            taxonomy.robust_trials,
            numbers_to_blob(points.as_flattened()),
        ],
    )?;
    Ok(())
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
