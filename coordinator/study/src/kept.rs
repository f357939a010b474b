//! A study as a coordinator stores it: the study's file, and records of embedders, measurements, the atlas and the
//! classes that people gave.

use crate::{
    corrections::{Corrections, CorrectionsError},
    file::StudyError,
    identity::cell_digest,
    maps::Maps,
    measured::Measured,
    outcome::Outcome,
    reference::Reference,
    study::Study,
};
use murmuration_model::study_records::{StudyFile, StudyRecord, StudyRecordKind};
use murmuration_swarm::{CheckpointDigest, Invalid};
use serde::Serialize;
use std::{collections::BTreeMap, path::Path};

/// Why a kept study cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum KeptError {
    #[error("the study's file: {0}")]
    Study(#[from] StudyError),
    #[error("the classes that people gave: {0}")]
    Classes(#[from] CorrectionsError),
    #[error(transparent)]
    Cell(#[from] Invalid),
}

/// A study as it was last run, with its records.
#[derive(Debug, Clone)]
pub struct KeptStudy {
    pub study: Study,
    /// Digest of the measures of the study's cells ([`measures_digest`](crate::measures_digest)).
    pub measures: String,
    records: Vec<StudyRecord>,
}

impl KeptStudy {
    /// # Errors
    /// Fails if the file is not a study file.
    pub fn new(file: &StudyFile, records: Vec<StudyRecord>) -> Result<Self, KeptError> {
        let study = Study::from_toml(&file.toml, Path::new(&file.folder), file.quick)?;
        Ok(Self {
            study,
            measures: file.measures.clone(),
            records,
        })
    }

    fn of_kind(&self, kind: StudyRecordKind) -> impl Iterator<Item = &StudyRecord> {
        self.records.iter().filter(move |record| record.kind == kind)
    }

    /// The checkpoints that cells share, by the digest of the campaign that trains the checkpoint.
    ///
    /// # Errors
    /// Fails if a record is not a checkpoint's digest.
    pub fn embedders(&self) -> Result<BTreeMap<String, CheckpointDigest>, Invalid> {
        self.of_kind(StudyRecordKind::Embedder)
            .map(shared_embedder)
            .collect()
    }

    /// The atlas by which recall is measured. `None` if the atlas was made for other measures, or if its record is damaged: the
    /// atlas is then made again.
    #[must_use]
    pub fn reference(&self) -> Option<Reference> {
        let record = self.of_kind(StudyRecordKind::Reference).next()?;
        let reference: Reference = serde_json::from_slice(&record.content).ok()?;
        (reference.measures == self.measures && reference.is_sound()).then_some(reference)
    }

    /// The classes that people gave on the page of the study.
    ///
    /// # Errors
    /// The error names the line that cannot be read.
    pub fn classes(&self) -> Result<Corrections, KeptError> {
        match self.of_kind(StudyRecordKind::Classes).next() {
            Some(record) => Ok(kept_classes(&record.content)?),
            None => Ok(Corrections::default()),
        }
    }

    /// Measurements of the cell with this digest. `None` if the cell was measured in another way, or if its record is damaged:
    /// the cell is then measured again.
    fn measured(&self, cell: &str) -> Option<Measured> {
        let mut cells = self.of_kind(StudyRecordKind::Cell);
        let record = cells.find(|record| record.key == cell && record.measures == self.measures)?;
        let measured: Measured = serde_json::from_slice(&record.content).ok()?;
        let is_this = measured.cell == cell && measured.measures == self.measures;
        let is_sound = measured.maps.as_ref().is_none_or(Maps::is_sound);
        (is_this && is_sound).then_some(measured)
    }

    /// The measurements of each cell, in the order of the cells.
    ///
    /// # Errors
    /// Fails as [`embedders`](Self::embedders) does.
    pub fn all_measured(&self) -> Result<Vec<Option<Measured>>, Invalid> {
        let embedders = self.embedders()?;
        let measured = |cell| {
            let spec = self.study.campaign_of(cell, &embedders)?;
            Ok(spec.and_then(|spec| self.measured(&cell_digest(&spec))))
        };
        self.study.cells.iter().map(measured).collect()
    }

    /// The study with its measurements, and with the classes in `corrections` instead of the judge's classes.
    ///
    /// # Errors
    /// Fails as [`embedders`](Self::embedders) does.
    pub fn outcome(self, corrections: Corrections) -> Result<Outcome, Invalid> {
        let (measured, reference) = (self.all_measured()?, self.reference());
        Ok(Outcome::new(self.study, measured, corrections).with_reference(reference))
    }
}

/// A checkpoint that cells share, and the digest of the campaign that trains it.
///
/// # Errors
/// Fails if the record is not a checkpoint's digest.
pub fn shared_embedder(record: &StudyRecord) -> Result<(String, CheckpointDigest), Invalid> {
    let digest = String::from_utf8_lossy(&record.content);
    Ok((record.key.clone(), digest.parse()?))
}

/// The classes in the content of a record.
///
/// # Errors
/// The error names the line that cannot be read.
pub fn kept_classes(content: &[u8]) -> Result<Corrections, CorrectionsError> {
    Corrections::parse(&String::from_utf8_lossy(content))
}

/// The record of a cell's measurements.
#[must_use]
pub fn cell_record(measured: &Measured) -> StudyRecord {
    record(
        StudyRecordKind::Cell,
        &measured.cell,
        &measured.measures,
        json(measured),
    )
}

/// The record of the checkpoint that the campaign with the digest `cell` trained.
#[must_use]
pub fn embedder_record(cell: &str, checkpoint: CheckpointDigest) -> StudyRecord {
    record(
        StudyRecordKind::Embedder,
        cell,
        "",
        checkpoint.to_string().into_bytes(),
    )
}

/// The record of the atlas that recall is measured by.
#[must_use]
pub fn reference_record(reference: &Reference) -> StudyRecord {
    record(
        StudyRecordKind::Reference,
        "",
        &reference.measures,
        json(reference),
    )
}

/// The record of the classes that people gave.
#[must_use]
pub fn classes_record(classes: &Corrections) -> StudyRecord {
    record(StudyRecordKind::Classes, "", "", classes.to_csv().into_bytes())
}

fn record(kind: StudyRecordKind, key: &str, measures: &str, content: Vec<u8>) -> StudyRecord {
    StudyRecord {
        kind,
        key: key.to_owned(),
        measures: measures.to_owned(),
        content,
    }
}

fn json(value: &impl Serialize) -> Vec<u8> {
    // Every key is a text or a number, so that the conversion cannot fail.
    serde_json::to_vec(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{maps::MappedIndividual, sample};

    #[test]
    fn a_cell_is_measured_if_its_record_says_so_and_can_be_drawn() {
        let study = sample::study();
        let mut measured = sample::measured(&study, 0, &[&["milling"]]);
        let kept = |measures: &str, records| KeptStudy {
            study: study.clone(),
            measures: measures.to_owned(),
            records,
        };
        let first = |kept: KeptStudy| kept.all_measured().unwrap().swap_remove(0);
        assert_eq!(first(kept("so", Vec::new())), None);
        assert_eq!(
            first(kept("so", vec![cell_record(&measured)])),
            Some(measured.clone())
        );
        assert_eq!(first(kept("otherwise", vec![cell_record(&measured)])), None);
        let damaged = StudyRecord {
            content: b"{".to_vec(),
            ..cell_record(&measured)
        };
        assert_eq!(first(kept("so", vec![damaged])), None);
        let individuals = vec![MappedIndividual {
            index: 0,
            class: "milling".to_owned(),
            score: 1e300,
            controller: [0.0; 2],
            behaviour: [0.0; 2],
        }];
        measured.maps = Some(Maps { individuals });
        assert_eq!(first(kept("so", vec![cell_record(&measured)])), None);
    }
}
