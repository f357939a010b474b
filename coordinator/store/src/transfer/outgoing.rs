//! A campaign as it stands, read part by part while it may go on.
//!
//! Archives and logs only grow, so everything up to what is on disk at the beginning stays as it is, unless the campaign switches
//! to another checkpoint or is rolled back: [`Outgoing::next_part`] fails then.

use super::{Medoids, Member, PART_ENTRIES, Part, fill_part};
use crate::{ArchivedIndividual, CheckpointRecord, GenerationRecord, Store, StoreError, StoredTaxonomy};
use murmuration_model::{ArchiveVersion, CampaignId, CampaignState, ExportedCampaign};
use murmuration_proto::{CheckpointDigest, PART_BYTES, v1};
use prost::Message as _;
use std::{collections::VecDeque, ops::Range};

/// Bytes that are assumed for the numbers of a trial, embedding included, where individuals are read.
const NUMBERS: usize = 4096;

/// What is still to be read of a campaign, apart from the bytes of its checkpoints.
#[derive(Debug)]
pub struct Outgoing {
    store: Store,
    campaign: ExportedCampaign,
    version: ArchiveVersion,
    checkpoints: Vec<CheckpointRecord>,
    taxonomy: Option<StoredTaxonomy>,
    generations: VecDeque<GenerationRecord>,
    individuals: Range<u64>,
    /// Individuals that are read, and for which no part had room yet.
    read: VecDeque<Member>,
    labels: Range<u64>,
}

/// Why a part cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum OutgoingError {
    /// The store cannot be read.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The parts that were read are of an archive that the campaign has no more.
    #[error(
        "campaign {0} switched to another checkpoint, or was rolled back, while it was exported: export it again"
    )]
    Changed(CampaignId),
}

impl Outgoing {
    /// The campaign of that id (or `latest`) as it stands.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if it cannot be read.
    pub fn of(store: &Store, id: &str) -> Result<Self, StoreError> {
        let (record, label_entries) = store.campaign_and_label_entries(id)?;
        let mut generations: VecDeque<_> = store.generations(&record.id)?.into();
        generations.truncate(record.generations_done as usize);
        let taxonomy = match record.state {
            CampaignState::Completed => store.taxonomy(&record.id)?,
            _ => None,
        };
        let embedder = record.embedder;
        let mut checkpoints = Vec::new();
        for digest in [embedder.checkpoint(), embedder.next()].into_iter().flatten() {
            add_with_parents(store, digest, &mut checkpoints)?;
        }
        Ok(Self {
            store: store.clone(),
            version: record.archive_version(),
            checkpoints,
            taxonomy,
            generations,
            individuals: 0..0,
            read: VecDeque::new(),
            labels: 0..label_entries,
            campaign: ExportedCampaign {
                record,
                label_entries,
                digest: String::new(),
            },
        })
    }

    /// The campaign itself, the first part.
    #[must_use]
    pub const fn campaign(&self) -> &ExportedCampaign {
        &self.campaign
    }

    /// The checkpoints that the campaign has and moves to, with those that they were fine-tuned from; parents first.
    #[must_use]
    pub fn checkpoints(&self) -> &[CheckpointRecord] {
        &self.checkpoints
    }

    /// The next part after the checkpoints; `None` after the last.
    ///
    /// # Errors
    /// [`OutgoingError::Changed`] if the campaign has been rolled back or has switched to another checkpoint since the first part;
    /// otherwise if it cannot be read.
    pub fn next_part(&mut self) -> Result<Option<Part>, OutgoingError> {
        let part = self.read_part();
        // What is missing in an archive that was rolled back is no damage.
        let now = self.store.campaign(self.campaign.record.id.as_str())?;
        match now.archive_version() == self.version {
            true => Ok(part?),
            false => Err(OutgoingError::Changed(self.campaign.record.id.clone())),
        }
    }

    fn read_part(&mut self) -> Result<Option<Part>, StoreError> {
        if !self.labels.is_empty() {
            return self.next_labels().map(Some);
        }
        if !self.individuals.is_empty() || !self.read.is_empty() {
            return self.next_individuals().map(Some);
        }
        if let Some(generation) = self.generations.pop_front() {
            let population = u64::from(self.campaign.record.spec.search().population());
            let first = u64::from(generation.generation) * population;
            self.individuals = first..first + population;
            return Ok(Some(Part::Generation(generation)));
        }
        Ok(self.taxonomy.take().map(|taxonomy| {
            Part::Taxonomy(Medoids {
                medoids: taxonomy.medoids.into_iter().zip(taxonomy.measures).collect(),
                loss: taxonomy.loss,
            })
        }))
    }

    /// As many individuals as a part has room for.
    fn next_individuals(&mut self) -> Result<Part, StoreError> {
        let next = || {
            if self.read.is_empty() && !self.individuals.is_empty() {
                self.read_individuals()?;
            }
            Ok::<_, StoreError>(self.read.pop_front())
        };
        let bytes = |member: &Member| v1::ExportedIndividual::from(member.clone()).encoded_len();
        fill_part(next, bytes).map(Part::Individuals)
    }

    fn read_individuals(&mut self) -> Result<(), StoreError> {
        let record = &self.campaign.record;
        let bytes = record.spec.individual_bytes() + record.spec.starts().get() * NUMBERS;
        let most = (PART_BYTES / bytes).max(1) as u64;
        let range = self.individuals.start..self.individuals.end.min(self.individuals.start + most);
        let found = self
            .store
            .individuals(&record.id, record.spec.model(), range.clone(), true)?;
        if found.len() as u64 != range.end - range.start {
            let what = format!("campaign {}: individuals {range:?} are not all there", record.id);
            return Err(StoreError::damaged(what));
        }
        self.individuals.start = range.end;
        let taxonomy = self.taxonomy.as_ref();
        let member = |individual: ArchivedIndividual| Member {
            cluster: taxonomy.and_then(|all| all.clusters.get(individual.index as usize).copied()),
            robust_trials: taxonomy.and_then(|all| all.robust_trials.get(individual.index as usize).copied()),
            individual,
        };
        self.read.extend(found.into_iter().map(member));
        Ok(())
    }

    fn next_labels(&mut self) -> Result<Part, StoreError> {
        let end = self.labels.end.min(self.labels.start + PART_ENTRIES as u64);
        let range = self.labels.start..end;
        self.labels.start = end;
        let entries = self.store.requested_labels(&self.campaign.record.id, range)?;
        Ok(Part::Labels(entries))
    }
}

/// Adds a checkpoint behind its parents, where they are not among `checkpoints` yet.
fn add_with_parents(
    store: &Store,
    digest: CheckpointDigest,
    checkpoints: &mut Vec<CheckpointRecord>,
) -> Result<(), StoreError> {
    let mut chain = Vec::new();
    let mut next = Some(digest);
    while let Some(digest) = next.filter(|digest| checkpoints.iter().all(|known| known.digest != *digest)) {
        let record = store.checkpoint(digest)?;
        next = record.lineage.parent;
        chain.push(record);
    }
    checkpoints.extend(chain.into_iter().rev());
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DataDirectory, Provenance};
    use murmuration_model::Weight;
    use murmuration_proto::CampaignSpec;

    #[test]
    fn a_campaign_that_is_rolled_back_meanwhile_is_not_damaged_but_changed() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let text = "model = \"single-sensor\"\nmethod = \"random\"\n[search]\npopulation = 2\ngenerations = 3\n\
                    [taxonomy]\nmedoids = 1";
        let spec = CampaignSpec::from_toml(text).unwrap();
        let id = store.create_campaign(&spec, Weight::default(), 0).unwrap();
        for generation in 0..2 {
            let individuals = [0, 1].map(|place| {
                ArchivedIndividual::pictured(u64::from(generation) * 2 + place, generation, vec![7; 2500])
            });
            let record = GenerationRecord::of(generation, &[0.1, 0.1], 0);
            store
                .commit_generation(&id, &record, &individuals, &Provenance::default())
                .unwrap();
        }
        assert_eq!(store.count_individuals().unwrap(), 4);
        let mut outgoing = Outgoing::of(&store, id.as_str()).unwrap();
        assert!(matches!(outgoing.next_part(), Ok(Some(Part::Generation(_)))));
        assert!(matches!(outgoing.next_part(), Ok(Some(Part::Individuals(_)))));
        store.roll_back_generations(&id, 1, "as asked").unwrap();
        for _ in 0..3 {
            let changed = outgoing.next_part().unwrap_err();
            assert!(matches!(changed, OutgoingError::Changed(_)), "{changed}");
        }
        let mut again = Outgoing::of(&store, id.as_str()).unwrap();
        assert!(again.next_part().is_ok());
    }
}
