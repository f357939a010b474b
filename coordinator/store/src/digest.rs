//! The digest of an archive, which two runs of one specification must have in common.

use crate::{ArchivedIndividual, Store, StoreError};
use murmuration_model::CampaignId;
use murmuration_search::interrupt::Interrupt;
use murmuration_swarm::CapabilityModel;

/// Number of individuals that are hashed at a time.
const CHUNK: u64 = 1024;

/// The digest of an archive, and the number of evaluations that it covers.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ArchiveDigest {
    /// BLAKE3, 64 hexadecimal digits.
    pub digest: String,
    /// Number of individuals that the digest covers, from index 0.
    pub evaluations: u64,
}

/// Digests an archive whose individuals are added in index order, with their pictures.
#[derive(Debug)]
pub struct ArchiveHasher(blake3::Hasher);

impl Default for ArchiveHasher {
    fn default() -> Self {
        Self(blake3::Hasher::new_derive_key("murmuration archive v1"))
    }
}

impl ArchiveHasher {
    pub fn add(&mut self, individual: &ArchivedIndividual) {
        let Self(hasher) = self;
        for value in individual.controller.genes() {
            hasher.update(&value.to_le_bytes());
        }
        for trial in &individual.trials {
            for value in trial.features {
                hasher.update(&value.to_le_bytes());
            }
            hasher.update(trial.image.as_deref().unwrap_or_default());
            for value in &trial.embedding {
                hasher.update(&value.to_le_bytes());
            }
            if let Some(verdict) = trial.verdict {
                hasher.update(&[verdict.number()]);
            }
        }
    }

    /// BLAKE3 of the added individuals, 64 hexadecimal digits.
    #[must_use]
    pub fn digest(&self) -> String {
        self.0.finalize().to_hex().to_string()
    }
}

/// Digests the individuals of an archive in index order. The digest covers each individual's genes (f64), and for each trial the
/// features (f64), the image, the embedding (f32) if any, and the verdict (one byte, its number in messages) if any. Numbers are
/// little-endian. The digest does not cover names, times, seeds and novelty: they follow from the specification, or do not matter
/// to the outcome.
///
/// # Errors
/// If the archive cannot be read, or `interrupt` was raised.
pub fn digest(
    store: &Store,
    campaign: &CampaignId,
    model: &CapabilityModel,
    interrupt: &Interrupt,
) -> Result<ArchiveDigest, StoreError> {
    let mut hasher = ArchiveHasher::default();
    let mut evaluations = 0;
    loop {
        interrupt.check()?;
        let chunk = store.individuals(campaign, model, evaluations..evaluations + CHUNK, true)?;
        if chunk.is_empty() {
            return Ok(ArchiveDigest {
                digest: hasher.digest(),
                evaluations,
            });
        }
        chunk.iter().for_each(|individual| hasher.add(individual));
        evaluations += chunk.len() as u64;
    }
}
