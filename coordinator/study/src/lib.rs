//! Studies: grids of campaigns with their measurements, and the report.
//!
//! A [`Study`] is read from a study file; its [`Cell`]s are whole specifications. The measurements of a completed cell are plain
//! data ([`Measured`]), which a coordinator keeps ([`KeptStudy`]). [`Outcome`] combines study and measurements into tables, and
//! [`write_report`] writes the report's page and files.
//!
//! The caller runs the campaigns. This crate uses neither the store nor the network.

mod behaviours;
mod contours;
mod corrections;
mod figure;
mod file;
mod identity;
mod judge_errors;
mod kept;
mod map_files;
mod maps;
mod measured;
mod outcome;
mod page;
mod phase;
mod phase_picture;
mod pictures;
mod plot;
mod recall;
mod recall_curve;
mod reference;
mod report;
mod richness;
mod second_judge;
mod share_bars;
mod shares;
mod study;
mod tables;
mod written;

#[cfg(test)]
mod sample;

pub use behaviours::{Individual, measure_behaviours};
pub use corrections::{Corrections, CorrectionsError, JUDGE};
pub use figure::{Figure, Measure};
pub use file::StudyError;
pub use identity::{cell_digest, embedder_spec, measures_digest};
pub use judge_errors::JudgeErrors;
pub use kept::{
    KeptError, KeptStudy, cell_record, classes_record, embedder_record, kept_classes, reference_record,
    shared_embedder,
};
pub use maps::{BehavioursError, MappedIndividual, Maps, measure_maps};
pub use measured::{AccuracyFigures, JudgedBehaviours, JudgedIndividual, Measured, MedoidsOf, SearchFigures};
pub use outcome::{MeasuredCell, Outcome};
pub use page::{TABLES_STYLE, tables_and_plots};
pub use phase::PhaseDiagram;
pub use pictures::ReportError;
pub use plot::wide;
pub use recall::{RecallCounts, RecallPlan, RecallStage, measure_recall};
pub use reference::{Judged, Niche, Reference, ReferenceError};
pub use report::{report_page, write_report};
pub use richness::Richness;
pub use second_judge::{second_judge, second_judge_by, second_judge_measures};
pub use shares::JudgedTrials;
pub use study::{Axis, Cell, LabelledSets, Measures, Phase, RandomBatches, Study};
pub use tables::{Entry, Resampled, Row, Table};
