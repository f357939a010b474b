//! Whether parts follow from those before them, as they come from a network or from files.

use super::{Member, Part, messages};
use crate::{CheckpointRecord, GenerationRecord};
use murmuration_model::{CampaignState, ExportedCampaign, labels::Labels};
use murmuration_proto::{
    CheckpointDigest, Invalid, Lineage, PART_BYTES, counted,
    onnx::{EmbedderModel, MAX_MODEL_BYTES},
    v1::{self, campaign_part::Part as Message},
};
use std::sync::Arc;

/// Most checkpoints that a campaign can come with: its own and what they were fine-tuned from.
const MAX_CHECKPOINTS: usize = 1000;

/// Takes the parts of one campaign, in order, and refuses one that cannot follow. It has the checkpoint in memory whose bytes are
/// coming, what the label log comes to, and the place of each individual's medoid.
#[derive(Debug, Default)]
pub struct Sequence {
    campaign: Option<Arc<ExportedCampaign>>,
    /// The checkpoints so far.
    checkpoints: Vec<CheckpointDigest>,
    /// The checkpoint whose bytes are coming, and those that came.
    arriving: Option<(CheckpointRecord, Vec<u8>)>,
    /// The checkpoint whose last bytes came with the last part.
    arrived: Option<(CheckpointRecord, Vec<u8>)>,
    /// Length of the embeddings, if the archive has some.
    dimensions: Option<usize>,
    /// Generations that have begun.
    generations: u32,
    /// The last of them.
    generation: Option<GenerationRecord>,
    /// The novelty of its individuals so far.
    novelty: Vec<f64>,
    individuals: u64,
    /// What the log comes to so far.
    labels: Labels,
    /// The place of each individual's medoid, if the campaign is completed.
    clusters: Vec<u32>,
    has_taxonomy: bool,
}

impl Sequence {
    /// The next part as a value of the domain.
    ///
    /// # Errors
    /// [`Invalid`] names what is wrong with it, or says what should come in its place.
    pub fn next(&mut self, part: v1::CampaignPart) -> Result<Part, Invalid> {
        self.arrived = None;
        let message = part
            .part
            .ok_or_else(|| Invalid::new("part", "nothing", "a part of a campaign"))?;
        match (message, self.campaign.clone()) {
            (Message::Campaign(message), None) => self.begin(message),
            (Message::Campaign(_), Some(_)) => Err(out_of_turn("one campaign alone")),
            (_, None) => Err(out_of_turn("the campaign, in the first part")),
            (Message::Checkpoint(message), Some(_)) => self.checkpoint(message),
            (Message::Chunk(chunk), Some(campaign)) => self.chunk(&campaign, chunk.data),
            (Message::Generation(message), Some(campaign)) => self.generation(&campaign, &message),
            (Message::Individuals(message), Some(campaign)) => {
                let members = message.individuals.into_iter();
                let members: Result<Vec<Member>, Invalid> =
                    members.map(|member| self.member(&campaign, member)).collect();
                members.map(Part::Individuals)
            }
            (Message::Labels(message), Some(campaign)) => self.follow(&campaign, message),
            (Message::Taxonomy(message), Some(campaign)) => self.taxonomy(&campaign, message),
        }
    }

    /// The campaign, once everything of it has come.
    ///
    /// # Errors
    /// [`Invalid`] names what is missing.
    pub fn end(&self) -> Result<&ExportedCampaign, Invalid> {
        let campaign = self
            .campaign
            .as_deref()
            .ok_or_else(|| out_of_turn("the campaign, in the first part"))?;
        self.checkpoints_are_whole(campaign)?;
        self.labels_are_whole(campaign)?;
        if self.individuals != campaign.record.individuals() {
            let allowed = format!("{}, as the campaign says", campaign.record.individuals());
            return Err(Invalid::new("individuals", self.individuals, allowed));
        }
        self.answers_are_of_the_archive()?;
        match self.has_taxonomy {
            false if is_completed(campaign) => Err(out_of_turn("the taxonomy of a completed campaign")),
            _ => Ok(campaign),
        }
    }

    /// The checkpoint with all its bytes, if the last of them came with the last part.
    pub fn take_checkpoint(&mut self) -> Option<(CheckpointRecord, Vec<u8>)> {
        self.arrived.take()
    }

    /// What the label log comes to, as far as it has come.
    #[must_use]
    pub const fn labels(&self) -> &Labels {
        &self.labels
    }

    fn begin(&mut self, message: v1::ExportedCampaign) -> Result<Part, Invalid> {
        let campaign: ExportedCampaign = message.try_into()?;
        self.campaign = Some(Arc::new(campaign.clone()));
        Ok(Part::Campaign(Box::new(campaign)))
    }

    fn checkpoint(&mut self, message: v1::Checkpoint) -> Result<Part, Invalid> {
        if self.generations > 0 || self.labels.entries() > 0 || self.arriving.is_some() {
            return Err(out_of_turn(
                "checkpoints, each with all its bytes, before the generations",
            ));
        }
        if self.checkpoints.len() == MAX_CHECKPOINTS {
            return Err(Invalid::new(
                "checkpoint",
                "one more",
                format!("at most {MAX_CHECKPOINTS}"),
            ));
        }
        let (digest, size, created_ms) = (message.digest.parse()?, message.size, message.created_ms);
        if !(1..=MAX_MODEL_BYTES as u64).contains(&size) {
            return Err(Invalid::new(
                "checkpoint.size",
                size,
                format!("1 to {MAX_MODEL_BYTES}"),
            ));
        }
        if created_ms > i64::MAX.unsigned_abs() {
            return Err(Invalid::new(
                "checkpoint.created_ms",
                created_ms,
                "at most 2^63 - 1",
            ));
        }
        let lineage = Lineage::try_from(message)?;
        if let Some(parent) = lineage.parent.filter(|parent| !self.checkpoints.contains(parent)) {
            return Err(Invalid::new(
                "checkpoint.parent",
                parent,
                "a checkpoint that came before it",
            ));
        }
        let record = CheckpointRecord {
            digest,
            size,
            lineage,
            created_ms,
        };
        self.arriving = Some((record.clone(), Vec::new()));
        Ok(Part::Checkpoint(record))
    }

    fn chunk(&mut self, campaign: &ExportedCampaign, data: Vec<u8>) -> Result<Part, Invalid> {
        let Some((record, mut bytes)) = self.arriving.take() else {
            return Err(out_of_turn("the description of a checkpoint before its bytes"));
        };
        if data.is_empty() || data.len() > PART_BYTES || (bytes.len() + data.len()) as u64 > record.size {
            let allowed = format!("parts of up to {PART_BYTES} bytes, {} in all", record.size);
            return Err(Invalid::new("chunk", counted(data.len() as u64, "byte"), allowed));
        }
        bytes.extend_from_slice(&data);
        if (bytes.len() as u64) < record.size {
            self.arriving = Some((record, bytes));
            return Ok(Part::Chunk(data));
        }
        let found = CheckpointDigest::of(&bytes);
        if found != record.digest {
            let allowed = format!("those of {}", record.digest);
            return Err(Invalid::new(
                "checkpoint",
                format!("bytes of digest {found}"),
                allowed,
            ));
        }
        let model = EmbedderModel::read(&bytes)
            .map_err(|error| Invalid::new("checkpoint", error, "an embedder in the format ONNX"))?;
        if campaign.record.embedder.checkpoint() == Some(record.digest) {
            let (embedded, pictures) = (model.images(), campaign.record.spec.image().shape());
            if embedded != pictures.into() {
                let allowed = format!("an embedder of pictures of {pictures}");
                return Err(Invalid::new("checkpoint", format!("one of {embedded}"), allowed));
            }
            self.dimensions = Some(model.dimensions());
        }
        self.checkpoints.push(record.digest);
        self.arrived = Some((record, bytes));
        Ok(Part::Chunk(data))
    }

    /// Whether all checkpoints are there that the campaign names.
    fn checkpoints_are_whole(&self, campaign: &ExportedCampaign) -> Result<(), Invalid> {
        let embedder = campaign.record.embedder;
        let mut named = [embedder.checkpoint(), embedder.next()].into_iter().flatten();
        if self.arriving.is_some() {
            return Err(out_of_turn("the rest of a checkpoint's bytes"));
        }
        match named.find(|digest| !self.checkpoints.contains(digest)) {
            Some(digest) => Err(out_of_turn(format!(
                "checkpoint {digest}, which the campaign names"
            ))),
            None => Ok(()),
        }
    }

    fn generation(
        &mut self,
        campaign: &ExportedCampaign,
        message: &v1::GenerationSummary,
    ) -> Result<Part, Invalid> {
        self.checkpoints_are_whole(campaign)?;
        self.labels_are_whole(campaign)?;
        self.generation_is_whole(campaign)?;
        let generation = messages::generation(message)?;
        if generation.generation != self.generations || self.generations == campaign.record.generations_done {
            let allowed = match self.generations < campaign.record.generations_done {
                true => self.generations.to_string(),
                false => format!("none after {}", self.generations),
            };
            return Err(Invalid::new("generation", generation.generation, allowed));
        }
        if self.has_taxonomy {
            return Err(out_of_turn("generations before the taxonomy"));
        }
        self.generations += 1;
        self.generation = Some(generation);
        self.novelty.clear();
        Ok(Part::Generation(generation))
    }

    /// Whether the whole label log has come.
    fn labels_are_whole(&self, campaign: &ExportedCampaign) -> Result<(), Invalid> {
        match self.labels.entries() == campaign.label_entries {
            true => Ok(()),
            false => {
                let allowed = format!("{}, as the campaign says", campaign.label_entries);
                Err(Invalid::new("labels", self.labels.entries(), allowed))
            }
        }
    }

    /// Whether every answer that stands is about an individual of the archive.
    fn answers_are_of_the_archive(&self) -> Result<(), Invalid> {
        let individuals = self.individuals;
        let compared = self.labels.comparisons().flat_map(|comparison| {
            let about = comparison.triple.individuals();
            about.map(|index| (comparison.entry, index))
        });
        let answered = self.labels.standing().map(|label| (label.entry, label.index));
        match answered.chain(compared).find(|(_, index)| *index >= individuals) {
            None => Ok(()),
            Some((entry, index)) => {
                let field = format!("labels[{entry}].index");
                let allowed = format!("below {individuals}, the individuals");
                Err(Invalid::new(&field, index, allowed))
            }
        }
    }

    /// Whether all individuals of the generations so far have come.
    fn generation_is_whole(&self, campaign: &ExportedCampaign) -> Result<(), Invalid> {
        match self.has_all_of_generation(campaign) {
            true => Ok(()),
            false => {
                let allowed = format!(
                    "{} after {}",
                    self.individuals_of_generations(campaign),
                    counted(self.generations.into(), "generation")
                );
                Err(Invalid::new("individuals", self.individuals, allowed))
            }
        }
    }

    fn has_all_of_generation(&self, campaign: &ExportedCampaign) -> bool {
        self.individuals == self.individuals_of_generations(campaign)
    }

    fn individuals_of_generations(&self, campaign: &ExportedCampaign) -> u64 {
        u64::from(self.generations) * u64::from(campaign.record.spec.search().population())
    }

    fn member(
        &mut self,
        campaign: &ExportedCampaign,
        message: v1::ExportedIndividual,
    ) -> Result<Member, Invalid> {
        let (index, spec) = (self.individuals, &campaign.record.spec);
        if self.has_all_of_generation(campaign) {
            return Err(out_of_turn("a generation before its individuals"));
        }
        if message.index != index {
            return Err(Invalid::new(
                "index",
                message.index,
                format!("{index}, as no index is left out"),
            ));
        }
        let within = |error: Invalid| error.within(&format!("individuals[{index}]"));
        let member = messages::member(message, spec, self.dimensions).map_err(within)?;
        let is_completed = is_completed(campaign);
        let counted = is_completed && spec.starts().get() > 1;
        if member.cluster.is_some() != is_completed || member.robust_trials.is_some() != counted {
            let allowed =
                "there if the campaign is completed, its robustness if it has several starts as well";
            return Err(within(Invalid::new("cluster", "something else", allowed)));
        }
        if let Some(cluster) = member.cluster.filter(|cluster| *cluster >= spec.medoids()) {
            let allowed = format!("below {}, the medoids of the specification", spec.medoids());
            return Err(within(Invalid::new("cluster", cluster, allowed)));
        }
        self.clusters.extend(member.cluster);
        self.individuals += 1;
        self.novelty.push(member.individual.novelty);
        if self.has_all_of_generation(campaign) {
            self.summary_is_of_the_individuals()?;
        }
        Ok(member)
    }

    /// Whether a generation that has come whole is what its individuals come to.
    fn summary_is_of_the_individuals(&self) -> Result<(), Invalid> {
        let Some(said) = self.generation else {
            return Ok(());
        };
        let found = GenerationRecord::of(said.generation, &self.novelty, said.filtered);
        let figures = [
            ("best_novelty", said.best_novelty, found.best_novelty),
            ("mean_novelty", said.mean_novelty, found.mean_novelty),
        ];
        match figures.into_iter().find(|(_, said, found)| said != found) {
            None => Ok(()),
            Some((name, said_of_it, found)) => {
                let field = format!("generations[{}].{name}", said.generation);
                Err(Invalid::new(
                    &field,
                    said_of_it,
                    format!("{found}, that of its individuals"),
                ))
            }
        }
    }

    /// Takes in entries of the label log.
    fn follow(&mut self, campaign: &ExportedCampaign, message: v1::ExportedLabels) -> Result<Part, Invalid> {
        self.checkpoints_are_whole(campaign)?;
        let entries = messages::labels(message)?;
        for (place, (_, entry)) in (self.labels.entries()..).zip(&entries) {
            if entry.number != place || place >= campaign.label_entries {
                let allowed = format!("{place}, of {}", counted(campaign.label_entries, "entry"));
                return Err(Invalid::new("labels.number", entry.number, allowed));
            }
        }
        let log = entries.iter().map(|(_, entry)| entry.clone()).collect();
        let followed = self.labels.follow(log);
        followed
            .map_err(|error| Invalid::new("labels", error, "a log whose entries follow from each other"))?;
        Ok(Part::Labels(entries))
    }

    fn taxonomy(
        &mut self,
        campaign: &ExportedCampaign,
        message: v1::ExportedTaxonomy,
    ) -> Result<Part, Invalid> {
        self.labels_are_whole(campaign)?;
        self.generation_is_whole(campaign)?;
        if !is_completed(campaign) || self.has_taxonomy {
            return Err(out_of_turn("one taxonomy, of a completed campaign"));
        }
        let most = campaign.record.spec.medoids() as usize;
        let taxonomy = messages::taxonomy(message, &self.clusters, most)?;
        self.has_taxonomy = true;
        Ok(Part::Taxonomy(taxonomy))
    }
}

fn is_completed(campaign: &ExportedCampaign) -> bool {
    campaign.record.state == CampaignState::Completed
}

fn out_of_turn(allowed: impl Into<String>) -> Invalid {
    Invalid::new("part", "something else", allowed)
}
