//! The database of a campaign from another store, checked row by row.
//!
//! This module reads rows as a store reads its own rows, and then checks them like network messages and workers' results. The
//! module keeps in memory the current labels, the taxonomy, one checkpoint at a time, and some individuals of a generation at a
//! time.

use super::untrusted::{self, Unsound, expect_count, expect_individuals, expect_none, foreign};
use crate::{
    ArchivedIndividual, CheckpointRecord, GenerationRecord, Store, StoredTaxonomy, Trial,
    campaigns::number_of,
    chunks::{BYTES, MOST},
    digest::ArchiveHasher,
    labels::entries_with_requests,
};
use murmuration_model::{
    CampaignRecord, CampaignState, ExportedCampaign,
    labels::{Entry, Labels, RequestId},
};
use murmuration_onnx::EmbedderModel;
use murmuration_proto::PART_BYTES;
use murmuration_search::breeding::is_start_of;
use murmuration_sim::features::FeatureBounds;
use murmuration_swarm::{CheckpointDigest, Invalid, Lineage, check_embedding, in_full};
use std::{collections::HashSet, ops::Range, path::Path};

/// Maximum number of checkpoints in a campaign's database: the campaign's checkpoints, and the checkpoints that these were
/// fine-tuned from.
const MAX_CHECKPOINTS: usize = 1000;
/// Number of entries of a label log that are read at a time.
const ENTRIES: usize = 1000;
/// The campaign's checkpoint, in SQL.
const OWN: &str = "(SELECT checkpoint FROM campaigns)";
/// Assumed bytes of a trial's numbers, embedding included. The assumed size determines how many individuals are read at a time.
const NUMBERS: usize = 4096;

/// An individual, with its place in the taxonomy.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// The individual, with its pictures.
    pub individual: ArchivedIndividual,
    /// The place of the individual's medoid, from 0, if the campaign is completed.
    pub cluster: Option<u32>,
    /// The number of trials to which no medoid is nearer than the individual's own medoid, if the campaign is completed and has
    /// several starts.
    pub robust_trials: Option<u8>,
}

/// A campaign in a database of its own. Everything was checked except the archive, which [`ReceivedCampaign::archive`] checks
/// while reading.
#[derive(Debug)]
pub struct ReceivedCampaign {
    store: Store,
    campaign: ExportedCampaign,
    checkpoints: Vec<CheckpointRecord>,
    /// Length of the embeddings, if the archive has embeddings.
    dimensions: Option<usize>,
    labels: Labels,
    generations: Vec<GenerationRecord>,
    taxonomy: Option<StoredTaxonomy>,
}

impl ReceivedCampaign {
    /// Opens the file at `path` and checks everything but the archive. The file must not change while it is open.
    ///
    /// # Errors
    /// [`Unsound`] names what is wrong with the file.
    pub fn open(path: &Path) -> Result<Self, Unsound> {
        let store = untrusted::open(path)?;
        let id = store.campaign_ids()?.pop();
        let id = id.ok_or_else(|| foreign("its campaign has no state"))?;
        let (record, label_entries) = store.campaign_and_label_entries(id.as_str())?;
        let digest = store.read(|connection| {
            Ok(connection.query_row("SELECT digest FROM exported", [], |row| row.get(0))?)
        })?;
        let mut received = Self {
            campaign: ExportedCampaign::new(record, label_entries, digest)?,
            store,
            checkpoints: Vec::new(),
            dimensions: None,
            labels: Labels::default(),
            generations: Vec::new(),
            taxonomy: None,
        };
        received.read_checkpoints()?;
        received.check_rows()?;
        received.read_labels()?;
        received.read_generations()?;
        received.read_taxonomy()?;
        Ok(received)
    }

    #[must_use]
    pub const fn campaign(&self) -> &ExportedCampaign {
        &self.campaign
    }

    /// The campaign's checkpoint, its next checkpoint, and the checkpoints that these were fine-tuned from; parents first.
    #[must_use]
    pub fn checkpoints(&self) -> &[CheckpointRecord] {
        &self.checkpoints
    }

    #[must_use]
    pub const fn labels(&self) -> &Labels {
        &self.labels
    }

    #[must_use]
    pub fn generations(&self) -> &[GenerationRecord] {
        &self.generations
    }

    /// The taxonomy; `None` if the campaign is not completed.
    #[must_use]
    pub const fn taxonomy(&self) -> Option<&StoredTaxonomy> {
        self.taxonomy.as_ref()
    }

    pub(super) const fn store(&self) -> &Store {
        &self.store
    }

    /// The bytes of a checkpoint.
    ///
    /// # Errors
    /// [`Unsound`] if the bytes do not have the checkpoint's digest and size.
    pub fn model(&self, checkpoint: &CheckpointRecord) -> Result<Vec<u8>, Unsound> {
        let digest = checkpoint.digest;
        let model: Vec<u8> = self.store.read(|connection| {
            let model =
                "SELECT model FROM embedders JOIN checkpoints ON number = checkpoint WHERE digest = ?1";
            Ok(connection.query_row(model, [digest.to_string()], |row| row.get(0))?)
        })?;
        let found = CheckpointDigest::of(&model);
        if found != digest || model.len() as u64 != checkpoint.size {
            let found = format!("{} bytes of digest {found}", model.len());
            let allowed = format!("{} of {digest}", checkpoint.size);
            return Err(Invalid::new("embedders.model", found, allowed).into());
        }
        Ok(model)
    }

    /// The label log, some entries at a time, each with the request that it came with.
    pub fn log(&self) -> impl Iterator<Item = Result<Vec<(RequestId, Entry)>, Unsound>> {
        let starts = (0..self.campaign.label_entries).step_by(ENTRIES);
        starts.map(|start| self.entries(start..start + ENTRIES as u64))
    }

    /// Reads and checks the archive, and passes its individuals to `each` in order, some at a time. At the end, checks that the
    /// archive has the digest that it was exported with.
    ///
    /// # Errors
    /// [`Unsound`] names the individual and what is wrong with it; or an error of `each`.
    pub fn archive<E: From<Unsound>>(
        &self,
        mut each: impl FnMut(Vec<Member>) -> Result<(), E>,
    ) -> Result<(), E> {
        let spec = &self.campaign.record.spec;
        let population = u64::from(spec.search().population());
        let bytes = spec.individual_bytes() + spec.starts().get() * NUMBERS;
        let at_once = (PART_BYTES / bytes).max(1);
        let mut hasher = ArchiveHasher::default();
        for generation in &self.generations {
            let first = u64::from(generation.generation) * population;
            let mut novelty = Vec::new();
            for start in (first..first + population).step_by(at_once) {
                let members = self.members(start..(start + at_once as u64).min(first + population))?;
                for member in &members {
                    hasher.add(&member.individual);
                    novelty.push(member.individual.novelty);
                }
                each(members)?;
            }
            check_summary(generation, &novelty)?;
        }
        let (wanted, found) = (self.campaign.digest.clone(), hasher.digest());
        match found == wanted {
            true => Ok(()),
            false => Err(Unsound::Digest { wanted, found }.into()),
        }
    }

    fn read_checkpoints(&mut self) -> Result<(), Unsound> {
        let embedder = self.campaign.record.embedder;
        let records = self.store.checkpoints()?;
        if records.len() > MAX_CHECKPOINTS {
            let allowed = format!("at most {MAX_CHECKPOINTS}");
            return Err(Invalid::new("checkpoints", records.len(), allowed).into());
        }
        expect_count(&self.store, "embedders", records.len() as u64)?;
        let mut needed: HashSet<CheckpointDigest> = [embedder.checkpoint(), embedder.next()]
            .into_iter()
            .flatten()
            .collect();
        for record in records.iter().rev() {
            if !needed.remove(&record.digest) {
                let allowed =
                    "checkpoints that the campaign has, moves to or was fine-tuned from, parents first";
                return Err(Invalid::new("checkpoints", record.digest, allowed).into());
            }
            Lineage::try_from(record.lineage.describe(record.digest, record.size, 0))
                .map_err(|error| error.within("checkpoints"))?;
            needed.extend(record.lineage.parent);
            let model = self.model(record)?;
            let model = EmbedderModel::read(&model)
                .map_err(|error| Invalid::new("embedders.model", error, "an embedder in the format ONNX"))?;
            if embedder.checkpoint() == Some(record.digest) {
                let (embedded, pictures) = (model.images(), self.campaign.record.spec.image().shape());
                if !embedded.takes(pictures.into()) {
                    let allowed = format!("an embedder of pictures of {pictures}");
                    return Err(
                        Invalid::new("embedders.model", format!("one of {embedded}"), allowed).into(),
                    );
                }
                self.dimensions = Some(model.dimensions());
            }
        }
        if let Some(missing) = needed.iter().next() {
            return Err(foreign(format!("checkpoint {missing} is missing")));
        }
        self.checkpoints = records;
        Ok(())
    }

    /// Checks the number of rows of each table and the lengths of their values, before the rows are read. Also checks that rows
    /// which are copied unchanged contain no other values than an export's rows.
    fn check_rows(&self) -> Result<(), Unsound> {
        let record = &self.campaign.record;
        let (individuals, starts) = (record.individuals(), record.spec.starts().get());
        let (genes, image) = (record.spec.model().genes(), record.spec.individual_bytes());
        let judged = if record.spec.judges() { starts } else { 0 };
        let population = record.spec.search().population();
        let (dimensions, embedded) = match self.dimensions {
            Some(dimensions) => (dimensions, individuals),
            None => (0, 0),
        };
        for (table, individuals, unfit) in [
            (
                "individual_chunks",
                individuals,
                format!(
                    "octet_length(seeds) <> 8 * individuals OR octet_length(controllers) <> 8 * {genes} * individuals
                        OR octet_length(features) <> 40 * {starts} * individuals OR octet_length(novelty) <> 8 * individuals
                        OR octet_length(verdicts) <> {judged} * individuals
                        OR individuals > 1 AND octet_length(seeds) + octet_length(controllers) + octet_length(features)
                            + octet_length(novelty) + octet_length(verdicts) > {BYTES}"
                ),
            ),
            // zstd adds only a few bytes to an image that it cannot compress.
            (
                "image_chunks",
                individuals,
                format!(
                    "octet_length(ends) <> 4 * individuals OR octet_length(images) > iif(individuals > 1, {BYTES},
                        {image} + {image} / 64 + 1024)
                        OR first / {population} <> (first + individuals - 1) / {population}"
                ),
            ),
            (
                "embedding_chunks",
                embedded,
                format!(
                    "checkpoint IS NOT {OWN} OR octet_length(embeddings) <> 4 * {dimensions} * {starts} * individuals
                        OR individuals > 1 AND octet_length(embeddings) > {BYTES}"
                ),
            ),
        ] {
            expect_individuals(&self.store, table, individuals)?;
            let outside = format!("first < 0 OR individuals NOT BETWEEN 1 AND {MOST}");
            expect_none(&self.store, table, &format!("{outside} OR {unfit}"))?;
        }
        self.check_other_rows()
    }

    fn check_other_rows(&self) -> Result<(), Unsound> {
        let record = &self.campaign.record;
        let (individuals, starts) = (record.sampled(), record.spec.starts().get());
        for (table, rows, unfit) in [
            (
                "generations",
                record.generations_done.into(),
                "filtered < 0 OR filtered > 1000000000000".to_owned(),
            ),
            (
                "taxonomies",
                (record.state == CampaignState::Completed).into(),
                format!(
                    "version <> 1 OR stands <> 1 OR made_ms IS NOT NULL OR checkpoint IS NOT {OWN} OR rounds <> {}
                        OR generations <> {} OR octet_length(medoids) > 8 * {}
                        OR octet_length(measures) <> 2 * octet_length(medoids) OR octet_length(clusters) <> 4 * {individuals}
                        OR octet_length(robust_trials) <> {} OR octet_length(points) <> 0",
                    record.rounds.done,
                    record.generations_done,
                    record.spec.medoids(),
                    if starts > 1 { individuals } else { 0 },
                ),
            ),
            ("labels", self.campaign.label_entries, "FALSE".to_owned()),
        ] {
            expect_count(&self.store, table, rows)?;
            expect_none(&self.store, table, &unfit)?;
        }
        Ok(())
    }

    fn entries(&self, range: Range<u64>) -> Result<Vec<(RequestId, Entry)>, Unsound> {
        let id = &self.campaign.record.id;
        let entries = self
            .store
            .read(|connection| entries_with_requests(connection, number_of(connection, id)?, range))?;
        Ok(entries)
    }

    fn read_labels(&mut self) -> Result<(), Unsound> {
        let mut labels = Labels::default();
        for entries in self.log() {
            let log: Vec<Entry> = entries?.into_iter().map(|(_, entry)| entry).collect();
            labels.follow(log).map_err(|error| {
                Invalid::new("labels", error, "a log whose entries follow from each other")
            })?;
        }
        let entries = self.campaign.label_entries;
        if labels.entries() != entries {
            return Err(Invalid::new("labels", labels.entries(), format!("{entries} entries")).into());
        }
        let individuals = self.campaign.record.individuals();
        if let Some(label) = labels.standing().find(|label| label.index >= individuals) {
            let field = format!("labels[{}].index", label.entry);
            let allowed = format!("below {individuals}, the individuals");
            return Err(Invalid::new(&field, label.index, allowed).into());
        }
        self.labels = labels;
        Ok(())
    }

    fn read_generations(&mut self) -> Result<(), Unsound> {
        self.generations = self.store.generations(&self.campaign.record.id)?;
        for (place, generation) in (0..).zip(&self.generations) {
            if generation.generation != place {
                return Err(Invalid::new("generation", generation.generation, place.to_string()).into());
            }
            let within = |error: Invalid| error.within(&format!("generations[{place}]"));
            measure("best_novelty", generation.best_novelty).map_err(within)?;
            measure("mean_novelty", generation.mean_novelty).map_err(within)?;
        }
        Ok(())
    }

    fn read_taxonomy(&mut self) -> Result<(), Unsound> {
        let record = &self.campaign.record;
        self.taxonomy = self.store.taxonomy(&record.id)?;
        if let Some(taxonomy) = &self.taxonomy {
            check_taxonomy(taxonomy, record.spec.starts().get())?;
        }
        Ok(())
    }

    /// The individuals with these indices, checked.
    fn members(&self, range: Range<u64>) -> Result<Vec<Member>, Unsound> {
        let record = &self.campaign.record;
        let found = self
            .store
            .individuals(&record.id, record.spec.model(), range.clone(), true)?;
        let bounds = FeatureBounds::of(record.spec.model(), record.spec.world());
        let mut members = Vec::with_capacity(found.len());
        for (index, individual) in range.clone().zip(found) {
            let within = |error: Invalid| error.within(&format!("individuals[{index}]"));
            let individual = checked(individual, index, record, &bounds, self.dimensions).map_err(within)?;
            let taxonomy = self.taxonomy.as_ref();
            members.push(Member {
                cluster: taxonomy.and_then(|all| all.clusters.get(index as usize).copied()),
                robust_trials: taxonomy.and_then(|all| all.robust_trials.get(index as usize).copied()),
                individual,
            });
        }
        match members.len() as u64 == range.end - range.start {
            true => Ok(members),
            false => Err(foreign(format!("individuals {range:?} are not all there"))),
        }
    }
}

/// Largest valid distance, novelty or sum of distances: far larger than valid features and embeddings can give.
const MAX_MEASURE: f64 = 1e30;

/// Checks a number that cannot be negative, such as a distance.
fn measure(field: &str, value: f64) -> Result<(), Invalid> {
    match (0.0..=MAX_MEASURE).contains(&value) {
        true => Ok(()),
        false => Err(Invalid::new(
            field,
            in_full(value),
            format!("0 or more, and at most {MAX_MEASURE:e}"),
        )),
    }
}

/// The individual, if it is valid at this index of the campaign.
fn checked(
    individual: ArchivedIndividual,
    index: u64,
    record: &CampaignRecord,
    bounds: &FeatureBounds,
    dimensions: Option<usize>,
) -> Result<ArchivedIndividual, Invalid> {
    let spec = &record.spec;
    if individual.index != index {
        return Err(Invalid::new("index", individual.index, index.to_string()));
    }
    let generation = index / u64::from(spec.search().population());
    if u64::from(individual.generation) != generation {
        return Err(Invalid::new(
            "generation",
            individual.generation,
            generation.to_string(),
        ));
    }
    measure("novelty", individual.novelty)?;
    if !is_start_of(spec, index, &individual.controller, individual.seed) {
        let allowed = "the seed that the specification's seed and the index determine";
        return Err(Invalid::new("seed", individual.seed, allowed));
    }
    let trial = |trial: Trial| {
        bounds.check(&trial.features)?;
        if trial.image.is_none() {
            return Err(Invalid::missing("image", "a picture"));
        }
        check_embedding(&trial.embedding, dimensions.unwrap_or(0))?;
        match (spec.judges(), trial.verdict) {
            (true, Some(_)) | (false, None) => Ok(trial),
            (true, None) => Err(Invalid::missing("verdict", "the judge's verdict")),
            (false, Some(_)) => Err(Invalid::new(
                "verdict",
                "present",
                "absent: the campaign has no judge",
            )),
        }
    };
    let trials: Result<_, Invalid> = individual.trials.into_iter().map(trial).collect();
    Ok(ArchivedIndividual {
        trials: trials?,
        ..individual
    })
}

/// Checks that the record of a generation follows from its individuals.
fn check_summary(generation: &GenerationRecord, novelty: &[f64]) -> Result<(), Unsound> {
    let number = generation.generation;
    let found = GenerationRecord::of(number, novelty, generation.filtered);
    for (name, message, found) in [
        ("best_novelty", generation.best_novelty, found.best_novelty),
        ("mean_novelty", generation.mean_novelty, found.mean_novelty),
    ] {
        if message != found {
            let field = format!("generations[{number}].{name}");
            return Err(Invalid::new(
                &field,
                in_full(message),
                format!("{found}, that of its individuals"),
            )
            .into());
        }
    }
    Ok(())
}

/// Checks the measures and the robustness, that each medoid is a member of its own cluster, and that larger clusters come first.
fn check_taxonomy(taxonomy: &StoredTaxonomy, starts: usize) -> Result<(), Invalid> {
    measure("loss", taxonomy.loss)?;
    for (place, (&index, measures)) in taxonomy.medoids.iter().zip(&taxonomy.measures).enumerate() {
        let within = |error: Invalid| error.within(&format!("medoids[{place}]"));
        measure("mean_distance", measures.mean_distance).map_err(within)?;
        measure("novelty", measures.novelty).map_err(within)?;
        let cluster = usize::try_from(index)
            .ok()
            .and_then(|index| taxonomy.clusters.get(index));
        if cluster.is_none_or(|&cluster| cluster as usize != place) {
            let allowed = format!("an individual of cluster {place}");
            return Err(within(Invalid::new("index", index, allowed)));
        }
    }
    if !taxonomy.sizes().is_sorted_by(|one, next| one >= next) {
        return Err(Invalid::new(
            "medoids",
            "another order",
            "the largest cluster first",
        ));
    }
    match taxonomy
        .robust_trials
        .iter()
        .find(|&&trials| usize::from(trials) > starts)
    {
        None => Ok(()),
        Some(trials) => {
            let allowed = format!("at most {starts}, the starts");
            Err(Invalid::new("robust_trials", trials, allowed))
        }
    }
}
