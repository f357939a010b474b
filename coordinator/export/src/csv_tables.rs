//! The tables of an export as CSV: a header, numbers that can be read again exactly, and names that spreadsheets can open. Values
//! that do not fit in a cell are left out: the trials of individuals, and entries of the label log that are not standing answers.

use crate::{ExportError, IndividualTable};
use csv::Writer;
use murmuration_model::{
    labels::{ANSWER_COLUMNS, ClassName, answer_row},
    tables::{GENERATION_COLUMNS, generation_row},
};
use murmuration_store::transfer::{Member, ReceivedCampaign};
use murmuration_swarm::CampaignSpec;
use std::{
    collections::BTreeMap,
    fs::File,
    io,
    path::{Path, PathBuf},
};

const INDIVIDUALS: &str = "individuals.csv";
const GENERATIONS: &str = "generations.csv";
const LABELS: &str = "labels.csv";
const TAXONOMY: &str = "taxonomy.csv";

/// Tables that are being written.
pub(crate) struct CsvTables {
    path: PathBuf,
    individuals: IndividualTable<File>,
    names: Vec<String>,
}

impl CsvTables {
    /// New tables in a folder.
    pub(crate) fn create(folder: &Path, spec: &CampaignSpec) -> Result<Self, ExportError> {
        let path = folder.join(INDIVIDUALS);
        let file = File::create_new(&path).map_err(ExportError::file("write", &path))?;
        Ok(Self {
            path,
            individuals: IndividualTable::new(file, spec),
            names: vec![INDIVIDUALS.to_owned()],
        })
    }

    /// Adds individuals to the table; `classes` has the classes of those that were labelled.
    pub(crate) fn add_individuals(
        &mut self,
        members: &[Member],
        classes: &BTreeMap<u64, ClassName>,
    ) -> Result<(), ExportError> {
        for member in members {
            let class = classes.get(&member.individual.index);
            self.individuals
                .add(&member.individual, member.cluster, class)
                .map_err(ExportError::file("write", &self.path))?;
        }
        Ok(())
    }

    /// Writes every table except that of the individuals. The table of labels has the standing answers, with the columns that a
    /// label file must have; the columns that `murmuration labels --csv` adds are in the table of individuals.
    pub(crate) fn add_small_tables(
        &mut self,
        folder: &Path,
        campaign: &ReceivedCampaign,
    ) -> Result<(), ExportError> {
        let generations = campaign.generations().iter().map(|row| {
            generation_row(row.generation, row.best_novelty, row.mean_novelty, row.filtered).to_vec()
        });
        self.write(folder, GENERATIONS, &GENERATION_COLUMNS, generations)?;
        let standing = campaign.labels().standing().map(|label| {
            let (answer, annotator) = (label.answer.as_str(), label.annotator.as_str());
            answer_row(label.index, answer, annotator, label.time_ms).to_vec()
        });
        self.write(folder, LABELS, &ANSWER_COLUMNS, standing)?;
        let Some(taxonomy) = campaign.taxonomy() else {
            return Ok(());
        };
        let clusters = taxonomy
            .medoids
            .iter()
            .zip(taxonomy.sizes())
            .zip(&taxonomy.measures);
        let medoids = clusters.enumerate().map(|(place, ((index, size), cluster))| {
            vec![
                (place + 1).to_string(),
                index.to_string(),
                size.to_string(),
                cluster.mean_distance.to_string(),
                cluster.novelty.to_string(),
            ]
        });
        self.write(
            folder,
            TAXONOMY,
            &[
                "cluster",
                "index",
                "cluster_size",
                "mean_distance",
                "novelty_in_archive",
            ],
            medoids,
        )
    }

    fn write(
        &mut self,
        folder: &Path,
        name: &str,
        header: &[&str],
        rows: impl Iterator<Item = Vec<String>>,
    ) -> Result<(), ExportError> {
        let (path, mut table) = create(folder, name)?;
        table.write_record(header).map_err(unwritten(&path))?;
        for row in rows {
            table.write_record(row).map_err(unwritten(&path))?;
        }
        end(&path, table)?;
        self.names.push(name.to_owned());
        Ok(())
    }

    /// The names of the files. All files are on disk when this function returns.
    pub(crate) fn finish(self) -> Result<Vec<String>, ExportError> {
        let file = self.individuals.finish();
        file.and_then(|file| file.sync_all())
            .map_err(ExportError::file("write", &self.path))?;
        Ok(self.names)
    }
}

fn create(folder: &Path, name: &str) -> Result<(PathBuf, Writer<File>), ExportError> {
    let path = folder.join(name);
    let file = File::create_new(&path).map_err(ExportError::file("write", &path))?;
    Ok((path, Writer::from_writer(file)))
}

fn end(path: &Path, table: Writer<File>) -> Result<(), ExportError> {
    let file = table
        .into_inner()
        .map_err(|error| io::Error::other(error.to_string()));
    file.and_then(|file| file.sync_all())
        .map_err(ExportError::file("write", path))
}

fn unwritten(path: &Path) -> impl FnOnce(csv::Error) -> ExportError {
    let path = path.to_path_buf();
    move |error| ExportError::file("write", &path)(io::Error::other(error))
}
