//! Studies: grids of campaigns with what is measured of each, and the report.
//!
//! A [`Study`] is read from a study file; its [`Cell`]s are whole specifications. What is measured of a completed cell is plain
//! data ([`Measured`]), which a [`StudyFolder`] keeps. [`Outcome`] brings study and measures together as tables, and
//! [`write_report`] writes its pages and files.
//!
//! Runs no campaign: that is the caller's work. Knows neither the store nor the network.
#![deny(missing_docs)]

mod behaviours;
mod corrections;
mod figure;
mod file;
mod folder;
mod identity;
mod judge_errors;
mod measured;
mod outcome;
mod overlay;
mod page;
mod pictures;
mod plot;
mod report;
mod study;
mod tables;
mod written;

#[cfg(test)]
mod sample;

pub use behaviours::{BehavioursError, Individual, measure_behaviours};
pub use corrections::{Corrections, CorrectionsError};
pub use figure::{Figure, Measure};
pub use file::StudyError;
pub use folder::{FolderError, KeptStudy, StudyFolder, studies};
pub use identity::{cell_digest, embedder_spec, measures_digest, with_checkpoint};
pub use judge_errors::JudgeErrors;
pub use measured::{AccuracyFigures, JudgedBehaviours, JudgedIndividual, Measured, MedoidsOf, SearchFigures};
pub use outcome::{MeasuredCell, Outcome};
pub use report::{ReportError, ReportFiles, write_report};
pub use study::{Axis, Cell, LabelledSets, Measures, Published, RandomBatches, Study};
pub use tables::{Entry, Resampled, Row, Table};
