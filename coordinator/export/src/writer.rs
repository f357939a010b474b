//! Writes the folder around the database of a campaign, and gives the folder its name once all its files are on disk.

use crate::{
    CAMPAIGN, CHECKPOINTS, DATABASE, DATASHEET, ExportError, GENERATIONS, INDIVIDUALS, LABELS, PICTURES,
    README, SPEC, TAXONOMY, about,
    columns::TableWriter,
    csv_tables::CsvTables,
    datasheet,
    description::{self, Description},
    digests::{self, Digests},
    individuals, labels,
    pictures::PictureWriter,
    placing::{self, place},
    small_tables,
};
use murmuration_files::UnfinishedFolder;
use murmuration_model::ExportedCampaign;
use murmuration_store::transfer::ReceivedCampaign;
use std::{
    fs::{self, File},
    io::Write as _,
    path::{Path, PathBuf},
};

/// An export that has been written.
#[derive(Debug)]
pub struct Exported {
    /// The folder.
    pub folder: PathBuf,
    pub campaign: ExportedCampaign,
    /// The paths of the files within the folder, in alphabetical order.
    pub files: Vec<String>,
}

/// The folder of an export that is being written, under a temporary name.
pub struct NewFolder {
    target: PathBuf,
    folder: UnfinishedFolder,
    database: File,
    with_csv: bool,
    replaces: bool,
}

impl NewFolder {
    /// Makes an empty folder that will become `target`. `target` must be an empty folder or not exist, unless `replaces` allows
    /// an export in it. `with_csv` adds every table as CSV.
    ///
    /// # Errors
    /// [`ExportError::NotEmpty`], [`ExportError::NoExport`], [`ExportError::WorkingFolder`], or if the folder cannot be made.
    pub fn create(target: &Path, with_csv: bool, replaces: bool) -> Result<Self, ExportError> {
        let target = placing::target(target, replaces)?;
        let folder = placing::new_folder(&target)?;
        let database = folder.path().join(DATABASE);
        Ok(Self {
            target,
            database: File::create_new(&database).map_err(ExportError::file("write", &database))?,
            folder,
            with_csv,
            replaces,
        })
    }

    /// Writes the next bytes of the campaign's database.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub fn add(&mut self, bytes: &[u8]) -> Result<(), ExportError> {
        let written = self.database.write_all(bytes);
        written.map_err(ExportError::file("write", &self.folder.path().join(DATABASE)))
    }

    /// Checks the database, writes the other files from it, and gives the folder its name.
    ///
    /// # Errors
    /// [`ExportError::Answer`] if the bytes are no database of a campaign, or an error if a file cannot be written. Except for
    /// [`ExportError::Aside`], an error leaves `target` unchanged.
    pub fn finish(self) -> Result<Exported, ExportError> {
        let folder = self.folder.path();
        let database = folder.join(DATABASE);
        self.database
            .sync_all()
            .map_err(ExportError::file("write", &database))?;
        let campaign = ReceivedCampaign::open(&database)?;
        let mut names = write_archive(folder, &campaign, self.with_csv)?;
        names.extend(write_small_tables(folder, &campaign)?);
        names.extend(write_checkpoints(folder, &campaign)?);
        names.extend(write_texts(folder, &campaign, self.with_csv)?);
        names.push(DATABASE.to_owned());
        let mut listed = Digests::default();
        for name in &names {
            listed.add(folder, name)?;
        }
        write_text(folder, digests::FILE, &listed.to_text())?;
        place(self.folder, &self.target, self.replaces)?;
        let mut files: Vec<String> = listed.names().map(str::to_owned).collect();
        files.push(digests::FILE.to_owned());
        files.sort();
        Ok(Exported {
            folder: self.target,
            campaign: campaign.campaign().clone(),
            files,
        })
    }
}

/// Writes the table of individuals and their pictures and, if `with_csv` is set, every table as CSV. Returns the names of the
/// files.
fn write_archive(
    folder: &Path,
    campaign: &ReceivedCampaign,
    with_csv: bool,
) -> Result<Vec<String>, ExportError> {
    let record = &campaign.campaign().record;
    let mut table = TableWriter::create(&folder.join(INDIVIDUALS), individuals::columns(&record.spec))?;
    let mut pictures = PictureWriter::create(&folder.join(PICTURES), &record.spec, record.individuals())?;
    let mut csv = with_csv
        .then(|| CsvTables::create(folder, &record.spec))
        .transpose()?;
    let classes = campaign.labels().by_individual();
    campaign.archive(|members| {
        individuals::write(&mut table, &members, &classes)?;
        for trial in members.iter().flat_map(|member| &member.individual.trials) {
            pictures.add(trial.image.as_deref().unwrap_or_default())?;
        }
        csv.as_mut()
            .map_or(Ok(()), |csv| csv.add_individuals(&members, &classes))
    })?;
    table.finish()?;
    pictures.finish()?;
    let mut names = [INDIVIDUALS, PICTURES].map(str::to_owned).to_vec();
    if let Some(mut csv) = csv {
        csv.add_small_tables(folder, campaign)?;
        names.extend(csv.finish()?);
    }
    Ok(names)
}

fn write_small_tables(folder: &Path, campaign: &ReceivedCampaign) -> Result<Vec<String>, ExportError> {
    small_tables::write_generations(&folder.join(GENERATIONS), campaign.generations())?;
    labels::write(&folder.join(LABELS), campaign)?;
    let mut names = [GENERATIONS, LABELS].map(str::to_owned).to_vec();
    if let Some(taxonomy) = campaign.taxonomy() {
        small_tables::write_taxonomy(&folder.join(TAXONOMY), taxonomy)?;
        names.push(TAXONOMY.to_owned());
    }
    Ok(names)
}

fn write_checkpoints(folder: &Path, campaign: &ReceivedCampaign) -> Result<Vec<String>, ExportError> {
    let mut names = Vec::new();
    for record in campaign.checkpoints() {
        let checkpoints = folder.join(CHECKPOINTS);
        fs::create_dir_all(&checkpoints).map_err(ExportError::file("make", &checkpoints))?;
        let (onnx, lineage) = (
            description::onnx(record.digest),
            description::lineage(record.digest),
        );
        write(folder, &onnx, &campaign.model(record)?)?;
        write_text(folder, &lineage, &description::checkpoint_to_json(record))?;
        names.extend([onnx, lineage]);
    }
    Ok(names)
}

/// Writes the text files, and returns their names.
fn write_texts(
    folder: &Path,
    received: &ReceivedCampaign,
    with_csv: bool,
) -> Result<Vec<String>, ExportError> {
    let (campaign, checkpoints) = (received.campaign(), received.checkpoints());
    let texts = [
        (SPEC, campaign.record.spec.to_toml()),
        (CAMPAIGN, description::to_json(&Description::of(received))),
        (README, about::page(campaign, with_csv, checkpoints)),
        (
            DATASHEET,
            datasheet::page(campaign, received.labels(), checkpoints),
        ),
    ];
    for (name, text) in &texts {
        write_text(folder, name, text)?;
    }
    Ok(texts.map(|(name, _)| name.to_owned()).into())
}

/// Writes a text file. The file is on disk when this function returns.
fn write_text(folder: &Path, name: &str, text: &str) -> Result<(), ExportError> {
    write(folder, name, text.as_bytes())
}

fn write(folder: &Path, name: &str, bytes: &[u8]) -> Result<(), ExportError> {
    let path = folder.join(name);
    let written = File::create_new(&path).and_then(|mut file| {
        file.write_all(bytes)?;
        file.sync_all()
    });
    written.map_err(ExportError::file("write", &path))
}
