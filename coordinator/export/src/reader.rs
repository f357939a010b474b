//! Reads the folder back: every file against its digest first, then every value as one from a network.

use crate::{
    CAMPAIGN, ExportError, GENERATIONS, INDIVIDUALS, LABELS, PICTURES, README, SPEC, TAXONOMY,
    cluster_sizes::ClusterSizes,
    columns,
    description::{self, Description},
    digests::{self, Digests},
    individuals::{self, DerivedColumns},
    labels,
    pictures::{self, PictureReader},
    small_tables,
};
use murmuration_model::{ExportedCampaign, labels::ClassName};
use murmuration_proto::{CampaignSpec, CheckpointDigest, Invalid, PART_BYTES, v1};
use murmuration_store::{
    digest::ArchiveHasher,
    transfer::{Member, PART_ENTRIES, Part, Sequence, fill_part},
};
use prost::Message as _;
use std::{
    collections::{BTreeMap, BTreeSet},
    path::{Path, PathBuf},
};
use v1::campaign_part::Part as Message;

/// Gets the parts in their order; false if it takes no more.
pub type PartSink<'a> = &'a mut dyn FnMut(Part) -> bool;

/// The folder of an export whose files all have their digests.
#[derive(Debug)]
pub struct ReadFolder {
    folder: PathBuf,
    description: Description,
    message: v1::ExportedCampaign,
}

/// The state of reading a folder.
struct Reading<'a> {
    folder: &'a Path,
    sequence: Sequence,
    sink: PartSink<'a>,
    classes: BTreeMap<u64, ClassName>,
    sizes: ClusterSizes,
    hasher: ArchiveHasher,
}

impl ReadFolder {
    /// Checks every file of a folder against its digest, and reads what the campaign is.
    ///
    /// # Errors
    /// [`ExportError::Damaged`] names the file that is missing or was changed.
    pub fn open(folder: &Path) -> Result<Self, ExportError> {
        let digests = Digests::check(folder)?;
        let description = Description::read(folder)?;
        let files = [SPEC, CAMPAIGN, README, INDIVIDUALS, PICTURES, GENERATIONS, LABELS];
        if let Some(missing) = files.into_iter().find(|name| !digests.has(name)) {
            let reason = format!("{missing} is not listed");
            return Err(ExportError::damaged(&folder.join(digests::FILE), reason));
        }
        let checkpoints = description
            .checkpoints
            .iter()
            .flat_map(|digest| [description::onnx_of(digest), description::lineage_of(digest)]);
        let taxonomy = description.loss.map(|_| TAXONOMY.to_owned());
        if let Some(missing) = taxonomy
            .into_iter()
            .chain(checkpoints)
            .find(|name| !digests.has(name))
        {
            let reason = format!("{missing} is not listed");
            return Err(ExportError::damaged(&folder.join(digests::FILE), reason));
        }
        let message = description.campaign(folder)?;
        Ok(Self {
            folder: folder.to_path_buf(),
            description,
            message,
        })
    }

    /// The id of the campaign, as the folder says it.
    #[must_use]
    pub fn campaign(&self) -> &str {
        &self.message.id
    }

    /// Reads everything into `sink`, and returns the campaign.
    ///
    /// # Errors
    /// [`ExportError::Damaged`] names the file and what is wrong in it; [`ExportError::Ended`] if the sink takes no more.
    pub fn read(&self, sink: PartSink<'_>) -> Result<ExportedCampaign, ExportError> {
        let mut reading = Reading {
            folder: &self.folder,
            sequence: Sequence::default(),
            sink,
            classes: BTreeMap::new(),
            sizes: ClusterSizes::default(),
            hasher: ArchiveHasher::default(),
        };
        let part = Message::Campaign(self.message.clone());
        let Part::Campaign(campaign) = reading.checked(part, CAMPAIGN)? else {
            return Err(ExportError::damaged(&self.folder, "it begins with no campaign"));
        };
        reading.pass_on(Part::Campaign(campaign.clone()))?;
        for digest in &self.description.checkpoints {
            let digest = digest
                .parse()
                .map_err(|error: Invalid| ExportError::damaged(&self.folder.join(CAMPAIGN), error))?;
            reading.checkpoint(digest)?;
        }
        reading.labels(&campaign, &self.description)?;
        reading.archive(&campaign, &self.description)?;
        if let Some(loss) = self.description.loss {
            let path = self.folder.join(TAXONOMY);
            let taxonomy = small_tables::read_taxonomy(&path, loss, reading.sizes.as_slice())?;
            let part = reading.checked(Message::Taxonomy(taxonomy), TAXONOMY)?;
            reading.pass_on(part)?;
        }
        reading
            .sequence
            .end()
            .map_err(|error| ExportError::damaged(&self.folder, error))?;
        Ok(*campaign)
    }
}

/// Reads a file as each of the tables, of so many rows, for tests that give it any bytes: it must be read or refused.
///
/// # Errors
/// Why it is no table of individuals.
pub fn read_any_table(path: &Path, rows: u64, spec: &CampaignSpec) -> Result<(), ExportError> {
    // Whatever they say: the file is one of the tables at most.
    let _ = small_tables::read_generations(path, rows);
    let _ = labels::read(path, rows, &mut |_| Ok(()));
    let sizes = vec![1; rows.min(1000) as usize];
    let _ = small_tables::read_taxonomy(path, 0.0, &sizes);
    for rows in columns::open(path, digests::open(path)?, &individuals::columns(spec), rows)? {
        let rows = rows.map_err(|error| ExportError::damaged(path, error))?;
        individuals::read(path, &rows)?;
    }
    Ok(())
}

impl Reading<'_> {
    /// A part that follows from those before it.
    fn checked(&mut self, part: Message, file: &str) -> Result<Part, ExportError> {
        let part = v1::CampaignPart { part: Some(part) };
        let next = self.sequence.next(part);
        next.map_err(|error| ExportError::damaged(&self.folder.join(file), error))
    }

    fn pass_on(&mut self, part: Part) -> Result<(), ExportError> {
        match (self.sink)(part) {
            true => Ok(()),
            false => Err(ExportError::Ended),
        }
    }

    fn checkpoint(&mut self, digest: CheckpointDigest) -> Result<(), ExportError> {
        let described = description::read_checkpoint(self.folder, digest)?;
        let part = self.checked(Message::Checkpoint(described), &description::lineage(digest))?;
        self.pass_on(part)?;
        let bytes = description::read_onnx(self.folder, digest)?;
        for chunk in bytes.chunks(PART_BYTES) {
            let chunk = v1::CheckpointChunk { data: chunk.to_vec() };
            let part = self.checked(Message::Chunk(chunk), &description::onnx(digest))?;
            self.pass_on(part)?;
        }
        Ok(())
    }

    fn labels(&mut self, campaign: &ExportedCampaign, description: &Description) -> Result<(), ExportError> {
        let path = self.folder.join(LABELS);
        let mut stand = BTreeSet::new();
        labels::read(&path, campaign.label_entries, &mut |log| {
            let entry = |label: &v1::ExportedLabel| label.entry.as_ref().map(|entry| entry.number);
            let standing = log.iter().filter(|(_, stands)| *stands);
            stand.extend(standing.filter_map(|(label, _)| entry(label)));
            let mut log = log.into_iter().map(|(label, _)| label).peekable();
            while log.peek().is_some() {
                let labels = log.by_ref().take(PART_ENTRIES).collect();
                let part = self.checked(Message::Labels(v1::ExportedLabels { labels }), LABELS)?;
                self.pass_on(part)?;
            }
            Ok(())
        })?;
        let labels = self.sequence.labels();
        labels::check_standing(&path, labels, &stand)?;
        if labels.digest().to_string() != description.label_digest {
            return Err(ExportError::damaged(
                &path,
                "its labels have another digest than the campaign says",
            ));
        }
        self.classes = labels.by_individual();
        Ok(())
    }

    /// The generations and their individuals, whose pictures are in another file.
    fn archive(&mut self, campaign: &ExportedCampaign, description: &Description) -> Result<(), ExportError> {
        let spec = &campaign.record.spec;
        let generations_done = campaign.record.generations_done.into();
        let generations = small_tables::read_generations(&self.folder.join(GENERATIONS), generations_done)?;
        let mut generations = generations.into_iter();
        let (path, pictures_path) = (self.folder.join(INDIVIDUALS), self.folder.join(PICTURES));
        let mut archive = pictures::open(&pictures_path, digests::open(&pictures_path)?)?;
        let count = campaign.record.individuals();
        let mut pictures = PictureReader::of(&mut archive, &pictures_path, spec, count)?;
        let population = spec.search().population() as usize;
        let mut left = 0;
        for rows in columns::open(&path, digests::open(&path)?, &individuals::columns(spec), count)? {
            let rows = rows.map_err(|error| ExportError::damaged(&path, error))?;
            let mut rows = individuals::read(&path, &rows)?.into_iter().peekable();
            while rows.peek().is_some() {
                if left == 0 {
                    self.generation(generations.next())?;
                    left = population;
                }
                let mut of_generation = rows.by_ref().take(left);
                let next = || {
                    let Some((mut individual, derived)) = of_generation.next() else {
                        return Ok::<_, ExportError>(None);
                    };
                    for trial in &mut individual.trials {
                        trial.image = pictures.next()?;
                    }
                    Ok(Some((individual, derived)))
                };
                let bytes =
                    |(individual, _): &(v1::ExportedIndividual, DerivedColumns)| individual.encoded_len();
                let part = fill_part(next, bytes)?;
                left -= part.len();
                let (part, derived): (Vec<_>, Vec<_>) = part.into_iter().unzip();
                self.individuals(part, &derived)?;
            }
        }
        if generations.next().is_some() {
            let reason = format!("it has more generations than {INDIVIDUALS} has individuals of");
            return Err(ExportError::damaged(&self.folder.join(GENERATIONS), reason));
        }
        pictures.end()?;
        let found = self.hasher.digest();
        let wanted = &description.digest;
        if found != *wanted {
            let reason = format!("its archive has digest {found}, and {CAMPAIGN} says {wanted}");
            return Err(ExportError::damaged(self.folder, reason));
        }
        if description.individuals != count {
            let said = description.individuals;
            let reason = format!("individuals = {said}: must be {count}, the individuals of its generations");
            return Err(ExportError::damaged(&self.folder.join(CAMPAIGN), reason));
        }
        Ok(())
    }

    fn generation(&mut self, generation: Option<v1::GenerationSummary>) -> Result<(), ExportError> {
        let generation = generation.ok_or_else(|| {
            let reason = format!("it has fewer generations than {INDIVIDUALS} has individuals of");
            ExportError::damaged(&self.folder.join(GENERATIONS), reason)
        })?;
        let part = self.checked(Message::Generation(generation), GENERATIONS)?;
        self.pass_on(part)
    }

    fn individuals(
        &mut self,
        individuals: Vec<v1::ExportedIndividual>,
        derived: &[DerivedColumns],
    ) -> Result<(), ExportError> {
        let message = v1::ExportedIndividuals { individuals };
        let part = self.checked(Message::Individuals(message), INDIVIDUALS)?;
        if let Part::Individuals(members) = &part {
            let path = self.folder.join(INDIVIDUALS);
            for (member, derived) in members.iter().zip(derived) {
                derived.check(&path, member, &self.classes)?;
                self.count(member);
            }
        }
        self.pass_on(part)
    }

    fn count(&mut self, member: &Member) {
        self.hasher.add(&member.individual);
        self.sizes.add(member.cluster);
    }
}
