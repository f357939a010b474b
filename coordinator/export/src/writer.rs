//! Writes the folder, part by part, and gives it its name once all of it is on disk.

use crate::{
    CAMPAIGN, CHECKPOINTS, DATASHEET, ExportError, GENERATIONS, INDIVIDUALS, LABELS, PICTURES, README, SPEC,
    TAXONOMY, about,
    cluster_sizes::ClusterSizes,
    columns::TableWriter,
    csv_tables::CsvTables,
    datasheet,
    description::{self, Description},
    digests::{self, Digests},
    individuals, labels,
    pictures::PictureWriter,
    placing::{self, Filled, place},
    small_tables,
};
use murmuration_model::{
    ExportedCampaign,
    labels::{ClassName, Entry, Labels, RequestId},
};
use murmuration_store::{
    CheckpointRecord, GenerationRecord,
    digest::ArchiveHasher,
    transfer::{Medoids, Member, Part},
};
use std::{
    collections::BTreeMap,
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

/// What was written.
#[derive(Debug)]
pub struct Exported {
    /// The folder.
    pub folder: PathBuf,
    /// The campaign, with the digest of its archive.
    pub campaign: ExportedCampaign,
    /// The files, by path within the folder, in alphabetical order.
    pub files: Vec<String>,
}

/// A folder that is being filled, beside the place that it will have.
pub struct NewFolder {
    target: PathBuf,
    folder: Filled,
    campaign: ExportedCampaign,
    checkpoints: Vec<CheckpointRecord>,
    checkpoint: Option<File>,
    log: Vec<(RequestId, Entry)>,
    /// What the log comes to, once it has come.
    labels: Labels,
    /// The class of each individual, once the first individuals come: after the whole log.
    classes: Option<BTreeMap<u64, ClassName>>,
    generations: Vec<GenerationRecord>,
    table: TableWriter,
    pictures: PictureWriter,
    csv: Option<CsvTables>,
    hasher: ArchiveHasher,
    sizes: ClusterSizes,
    taxonomy: Option<Medoids>,
}

impl NewFolder {
    /// An empty folder, to become `target`: it must be empty or not exist, unless an export in it is to be replaced. `with_csv`
    /// adds every table as CSV.
    ///
    /// # Errors
    /// [`ExportError::NotEmpty`], [`ExportError::NoExport`], or if it cannot be made.
    pub fn create(
        target: &Path,
        campaign: ExportedCampaign,
        with_csv: bool,
        replaces: bool,
    ) -> Result<Self, ExportError> {
        let target = placing::target(target, replaces)?;
        let folder = placing::new_folder(&target)?;
        let path = folder.path();
        let record = &campaign.record;
        let individuals = record.individuals();
        Ok(Self {
            target,
            table: TableWriter::create(&path.join(INDIVIDUALS), individuals::columns(&record.spec))?,
            pictures: PictureWriter::create(&path.join(PICTURES), &record.spec, individuals)?,
            csv: with_csv
                .then(|| CsvTables::create(path, &record.spec))
                .transpose()?,
            folder,
            campaign,
            checkpoints: Vec::new(),
            checkpoint: None,
            log: Vec::new(),
            labels: Labels::default(),
            classes: None,
            generations: Vec::new(),
            hasher: ArchiveHasher::default(),
            sizes: ClusterSizes::default(),
            taxonomy: None,
        })
    }

    /// Writes the next part, as a [`Sequence`](murmuration_store::transfer::Sequence) returned it.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, part: Part) -> Result<(), ExportError> {
        match part {
            Part::Campaign(_) => Ok(()),
            Part::Checkpoint(record) => self.add_checkpoint(record),
            Part::Chunk(bytes) => self.add_bytes(&bytes),
            Part::Labels(entries) => self.add_labels(entries),
            Part::Generation(record) => {
                self.generations.push(record);
                Ok(())
            }
            Part::Individuals(members) => self.add_individuals(&members),
            Part::Taxonomy(taxonomy) => {
                self.taxonomy = Some(taxonomy);
                Ok(())
            }
        }
    }

    /// Writes what follows from all parts, and gives the folder its name.
    ///
    /// # Errors
    /// If it cannot be written; there is nothing new at its place then.
    pub fn finish(mut self) -> Result<Exported, ExportError> {
        let folder = self.folder.path().to_path_buf();
        self.finish_checkpoint()?;
        self.campaign.digest = self.hasher.digest();
        small_tables::write_generations(&folder.join(GENERATIONS), &self.generations)?;
        labels::write(&folder.join(LABELS), &self.log, &self.labels)?;
        if let Some(taxonomy) = &self.taxonomy {
            small_tables::write_taxonomy(&folder.join(TAXONOMY), taxonomy, self.sizes.as_slice())?;
        }
        let mut names = self.write_texts()?;
        self.table.finish()?;
        self.pictures.finish()?;
        if let Some(mut csv) = self.csv {
            let taxonomy = self
                .taxonomy
                .as_ref()
                .map(|taxonomy| (taxonomy, self.sizes.as_slice()));
            csv.add_small_tables(&folder, &self.generations, &self.labels, taxonomy)?;
            names.extend(csv.finish()?);
        }
        names.extend([INDIVIDUALS, PICTURES, GENERATIONS, LABELS].map(str::to_owned));
        names.extend(self.taxonomy.is_some().then(|| TAXONOMY.to_owned()));
        for record in &self.checkpoints {
            names.extend([
                description::onnx(record.digest),
                description::lineage(record.digest),
            ]);
        }
        let mut listed = Digests::default();
        for name in &names {
            listed.add(&folder, name)?;
        }
        write_text(&folder, digests::FILE, &listed.to_text())?;
        place(self.folder, &self.target)?;
        let mut files: Vec<String> = listed.names().map(str::to_owned).collect();
        files.push(digests::FILE.to_owned());
        files.sort();
        Ok(Exported {
            folder: self.target,
            campaign: self.campaign,
            files,
        })
    }

    /// Writes the files of text; their names.
    fn write_texts(&self) -> Result<Vec<String>, ExportError> {
        let loss = self.taxonomy.as_ref().map(|taxonomy| taxonomy.loss);
        let described = Description::of(
            &self.campaign,
            self.campaign.digest.clone(),
            self.labels.digest().to_string(),
            loss,
            &self.checkpoints,
        );
        let texts = [
            (SPEC, self.campaign.record.spec.to_toml()),
            (CAMPAIGN, description::to_json(&described)),
            (
                README,
                about::page(&self.campaign, self.csv.is_some(), &self.checkpoints),
            ),
            (
                DATASHEET,
                datasheet::page(&self.campaign, &self.labels, &self.checkpoints),
            ),
        ];
        for (name, text) in &texts {
            write_text(self.folder.path(), name, text)?;
        }
        Ok(texts.map(|(name, _)| name.to_owned()).into())
    }

    fn add_checkpoint(&mut self, record: CheckpointRecord) -> Result<(), ExportError> {
        self.finish_checkpoint()?;
        let folder = self.folder.path();
        let checkpoints = folder.join(CHECKPOINTS);
        fs::create_dir_all(&checkpoints).map_err(ExportError::file("make", &checkpoints))?;
        let described = description::checkpoint_to_json(&record);
        write_text(folder, &description::lineage(record.digest), &described)?;
        let path = folder.join(description::onnx(record.digest));
        self.checkpoint = Some(File::create_new(&path).map_err(ExportError::file("write", &path))?);
        self.checkpoints.push(record);
        Ok(())
    }

    fn add_bytes(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        let Some(file) = &mut self.checkpoint else {
            return Ok(());
        };
        file.write_all(bytes)
            .map_err(ExportError::file("write", self.folder.path()))
    }

    /// Has the bytes of the last checkpoint on disk.
    fn finish_checkpoint(&mut self) -> Result<(), ExportError> {
        let synced = self.checkpoint.take().map_or(Ok(()), |file| file.sync_all());
        synced.map_err(ExportError::file("write", self.folder.path()))
    }

    fn add_labels(&mut self, entries: Vec<(RequestId, Entry)>) -> Result<(), ExportError> {
        let log = entries.iter().map(|(_, entry)| entry.clone()).collect();
        self.labels
            .follow(log)
            .map_err(|error| ExportError::damaged(&self.folder.path().join(LABELS), error))?;
        self.classes = None;
        self.log.extend(entries);
        Ok(())
    }

    fn add_individuals(&mut self, members: &[Member]) -> Result<(), ExportError> {
        let classes = self.classes.get_or_insert_with(|| self.labels.by_individual());
        individuals::write(&mut self.table, members, classes)?;
        for member in members {
            self.hasher.add(&member.individual);
            for trial in &member.individual.trials {
                self.pictures.add(trial.image.as_deref().unwrap_or_default())?;
            }
            self.sizes.add(member.cluster);
        }
        match &mut self.csv {
            Some(csv) => csv.add_individuals(members, classes),
            None => Ok(()),
        }
    }
}

/// Writes a file of text; it is on disk then.
pub(crate) fn write_text(folder: &Path, name: &str, text: &str) -> Result<(), ExportError> {
    let path = folder.join(name);
    let written = File::create_new(&path).and_then(|mut file| {
        file.write_all(text.as_bytes())?;
        file.sync_all()
    });
    written.map_err(ExportError::file("write", &path))
}
