//! The report of a campaign: one self-contained page with the taxonomy, and the files that papers are made from.
//!
//! The input is plain data ([`Report`]), the output a folder of files ([`write()`]). The caller simulates, projects and clusters
//! the behaviours.

mod again;
pub mod atlas;
pub mod axes;
pub mod card;
pub mod class_map;
mod contact_sheet;
mod document;
mod figure;
mod findings;
mod judged;
mod names;
mod numbers;
mod page;
pub mod paper;
pub mod picture;
mod pictured;
mod plots;
pub mod point_map;
mod purity;
pub mod score_histogram;
pub mod scripts;
pub mod svg;
mod tables;

#[cfg(test)]
mod sample;

pub use document::Document;
pub use findings::{Shown, answer, folded, folding};
pub use judged::{Candidate, Judged};
pub use names::{CarriedName, Names};
pub use numbers::sample_in_words;
pub use pictured::{PictureSheets, Pictured};
pub use plots::condensed;
pub use purity::Purity;

use crate::picture::{Bodies, Paper, PictureError};
use murmuration_files::{Folder, FolderError};
use murmuration_model::Repetition;
use murmuration_swarm::{CampaignSpec, Controller, Features, Replay, Starts};
use rayon::prelude::*;
use std::path::PathBuf;

/// Everything that a report shows of one campaign.
#[derive(Debug, Clone)]
pub struct Report {
    /// The campaign's id.
    pub campaign: String,
    pub spec: CampaignSpec,
    /// Digest of the campaign's archive, to compare with that of a repeated campaign.
    pub digest: String,
    /// Digest of the checkpoint whose embeddings the archive has; empty if the archive has no embeddings.
    pub checkpoint: String,
    /// Time at which the campaign was created, in milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// Version of the simulator that evaluated the campaign.
    pub simulator_version: String,
    /// The campaign's generations, in order.
    pub generations: Vec<GenerationSummary>,
    /// The archive, by index.
    pub individuals: Vec<Entry>,
    /// The taxonomy, largest cluster first; at least one.
    pub medoids: Vec<MedoidEntry>,
    /// Position in `medoids` of each individual's nearest medoid.
    pub clusters: Vec<u32>,
    /// Individuals shown besides the medoids. Each is the individual farthest from the medoids and from the further individuals
    /// before it.
    pub further: Vec<FurtherEntry>,
    pub map: Map,
    /// Pictures of individuals, for the map.
    pub pictured: Pictured,
    /// Sum of the distances of all individuals to their nearest medoids, in units of the behaviour space.
    pub loss: f64,
    /// The names of behaviours, and who gave them.
    pub names: Names,
    /// The rule-based judge's verdicts on the medoids, and on a sample of the archive.
    pub judged: Judged,
    /// The labels, rounds and checkpoints that determined the archive, besides the specification.
    pub repetition: Repetition,
}

impl Report {
    /// Number of values in an embedding; 0 if the archive has no embeddings.
    fn embedding_dimensions(&self) -> usize {
        self.individuals.first().map_or(0, |entry| entry.embedding.len())
    }

    /// Number of evaluated controllers. The taxonomy and the report cover fewer if the campaign has a sample.
    fn evaluated(&self) -> u64 {
        self.generations.len() as u64 * u64::from(self.spec.search().population())
    }

    /// The number of a medoid's robust trials, and of all its trials; `None` if individuals have one trial.
    fn robust_trials(&self, medoid: &MedoidEntry) -> Option<(usize, usize)> {
        let starts = self.spec.starts().get();
        let robustness = self.individuals[medoid.index as usize].robustness?;
        Some(((robustness * starts as f64).round() as usize, starts))
    }

    /// Mean robustness of the individuals of a cluster; `None` if individuals have one trial.
    fn robustness_of_cluster(&self, place: usize) -> Option<f64> {
        let members = self.individuals.iter().zip(&self.clusters);
        let members = members.filter(|(_, cluster)| **cluster as usize == place);
        let robustness: Option<Vec<f64>> = members.map(|(entry, _)| entry.robustness).collect();
        let robustness = robustness.filter(|robustness| !robustness.is_empty())?;
        Some(robustness.iter().sum::<f64>() / robustness.len() as f64)
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GenerationSummary {
    /// Number of the generation, from 0.
    pub generation: u32,
    /// Highest novelty when evaluated among the generation's individuals, in the behaviour space of the report.
    pub best_novelty: f64,
    pub mean_novelty: f64,
    /// Number of proposals that the heuristic filter rejected.
    pub filtered: u64,
}

/// One evaluated controller.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// Generation of the individual, from 0.
    pub generation: u32,
    pub controller: Controller,
    /// Seed of the individual's start, or of the first start if there are several.
    pub seed: u64,
    /// The individual's hand-crafted features: means over its trials.
    pub features: Features,
    /// The embedding of the individual's picture by the report's checkpoint, the mean over its trials; empty if there is none.
    pub embedding: Vec<f32>,
    /// The individual's trials; empty if the individual has only one trial.
    pub trials: Vec<TrialEntry>,
    /// The individual's robustness, 0 to 1; `None` if the individual has only one trial.
    pub robustness: Option<f64>,
    /// The individual's novelty when evaluated, in the behaviour space of the report.
    pub novelty_when_evaluated: f64,
}

impl Entry {
    /// This individual with its index, for the judge.
    #[must_use]
    pub const fn candidate(&self, index: u64) -> Candidate<'_> {
        Candidate {
            index,
            controller: &self.controller,
            seed: self.seed,
        }
    }

    /// Features and embedding, which place the individual in the behaviour space.
    #[must_use]
    pub fn measured(&self) -> (Features, Vec<f32>) {
        (self.features, self.embedding.clone())
    }
}

/// One trial of an individual that has several trials.
#[derive(Debug, Clone, PartialEq)]
pub struct TrialEntry {
    /// Seed of the trial's start.
    pub seed: u64,
    /// The trial's hand-crafted features.
    pub features: Features,
    /// The embedding of the trial's picture; empty if there is none.
    pub embedding: Vec<f32>,
}

/// One behaviour of the taxonomy.
#[derive(Debug, Clone)]
pub struct MedoidEntry {
    /// Index of the medoid in the archive.
    pub index: u64,
    /// Its image, in the specification's format.
    pub image: Vec<u8>,
    /// Number of individuals in the cluster, the medoid included.
    pub cluster_size: u64,
    /// Mean distance of the cluster's members to the medoid, in units of the behaviour space.
    pub mean_distance: f64,
    /// Mean distance of the medoid to its nearest neighbours in the whole archive, in units of the behaviour space.
    pub novelty: f64,
    /// Its motion from the start to the horizon.
    pub replay: Replay,
    /// Other members of the cluster, which show how alike its members are; `None` if the medoid is the only member.
    pub spread: Option<Spread>,
    /// Name of the cluster, if it was inherited from an earlier version of the taxonomy.
    pub carried: Option<CarriedName>,
}

/// An individual that is shown beside the taxonomy.
#[derive(Debug, Clone)]
pub struct FurtherEntry {
    /// Index of the individual.
    pub index: u64,
    /// Its motion from the start to the horizon.
    pub replay: Replay,
}

/// How far a cluster reaches from its medoid.
#[derive(Debug, Clone, PartialEq)]
pub struct Spread {
    /// The member that is nearest to the medoid.
    pub nearest: Member,
    /// The member at the median distance; of an even number of members, the farther of the two in the middle.
    pub median: Member,
    /// The member that is farthest from the medoid.
    pub farthest: Member,
}

impl Spread {
    /// The members with their labels.
    fn members(&self) -> [(&'static str, &Member); 3] {
        [
            ("nearest", &self.nearest),
            ("median", &self.median),
            ("farthest", &self.farthest),
        ]
    }
}

/// An individual of a cluster that is not its medoid.
#[derive(Debug, Clone, PartialEq)]
pub struct Member {
    /// Index of the individual.
    pub index: u64,
    /// Distance to the medoid, in units of the behaviour space.
    pub distance: f64,
    /// Its image, in the specification's format.
    pub image: Vec<u8>,
}

/// The behaviour space, projected to two dimensions.
#[derive(Debug, Clone)]
pub struct Map {
    /// One point for each individual, by index.
    pub points: Vec<[f64; 2]>,
    /// The titles of the axes: across, then up.
    pub axis_titles: [String; 2],
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    /// The page to open.
    pub page: PathBuf,
    /// The files besides the page, in the order in which they were written.
    pub others: Vec<PathBuf>,
}

impl ReportFiles {
    /// Takes the last of the written files as the page.
    fn of(mut written: Vec<PathBuf>) -> Self {
        let page = written.pop().unwrap_or_default();
        Self {
            page,
            others: written,
        }
    }
}

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    #[error("the report does not fit together: {0}")]
    Inconsistent(String),
    #[error("cannot draw individual {index}: {source}")]
    Picture {
        /// Index of the individual.
        index: u64,
        source: PictureError,
    },
    #[error("cannot draw {file}: {source}")]
    Drawing {
        /// Name of the drawing's file or folder.
        file: &'static str,
        source: PictureError,
    },
    #[error(transparent)]
    Folder(#[from] FolderError),
}

/// Writes a report into the folder `files`, where it replaces an earlier report.
///
/// `report.html` needs no other file and no network. The other files are `spec.toml`, `archive.csv`, `taxonomy.csv`, `trials.csv`
/// (if individuals have several trials), `classes.csv`, `generations.csv`, `map.svg`, `novelty.svg`, `contact-sheet.svg` and
/// `medoids/NN-image.png`, `medoids/NN-trajectory.png`, `medoids/NN-trajectory.svg` (NN is the position in the taxonomy, from
/// 01).
///
/// # Errors
/// [`ReportError::Inconsistent`], [`ReportError::Picture`] or [`ReportError::Drawing`] before any file is written;
/// [`ReportError::Folder`] for the errors of [`Folder::finish`].
pub fn write(report: &Report, mut files: Folder) -> Result<ReportFiles, ReportError> {
    check(report)?;
    let (pictures, further) = (draw_medoids(report)?, draw_further(report)?);
    let novelty = plots::novelty(&report.generations, plots::WIDE).svg;
    let map = plots::map(report);
    let page = page::render(report, &pictures, &further, Files::Beside);

    files.text("spec.toml", &again::specification(report))?;
    files.write("archive.csv", |file| tables::archive(report, file))?;
    files.write("taxonomy.csv", |file| tables::taxonomy(report, file))?;
    if report.spec.starts() != Starts::ONE {
        files.write("trials.csv", |file| tables::trials(report, file))?;
    }
    files.write("classes.csv", |file| tables::classes(report, file))?;
    files.write("generations.csv", |file| tables::generations(report, file))?;
    files.text("novelty.svg", &novelty)?;
    files.text("map.svg", &map)?;
    files.text("contact-sheet.svg", &contact_sheet::svg(report))?;
    for (place, picture) in pictures.iter().enumerate() {
        let number = place + 1;
        files.bytes(&format!("medoids/{number:02}-image.png"), &picture.image_large)?;
        files.bytes(
            &format!("medoids/{number:02}-trajectory.png"),
            &picture.trajectory_large,
        )?;
        let paths = contact_sheet::paths(report, &report.medoids[place]);
        files.text(&format!("medoids/{number:02}-trajectory.svg"), &paths)?;
    }
    files.text("report.html", &page)?;
    Ok(ReportFiles::of(files.finish()?))
}

/// The page of a report without the other files of the report. The page of [`write()`] refers to those files; this page does not.
pub fn page(report: &Report) -> Result<String, ReportError> {
    check(report)?;
    let (pictures, further) = (draw_medoids(report)?, draw_further(report)?);
    Ok(page::render(report, &pictures, &further, Files::Absent))
}

/// The contact sheet alone, as SVG: the paths of all behaviours in one figure. The `report` needs no pictures of individuals for
/// it.
pub fn contact_sheet(report: &Report) -> Result<String, ReportError> {
    check(report)?;
    Ok(contact_sheet::svg(report))
}

/// Whether the other files of a report are written with its page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Files {
    /// The other files are in the folder of the page.
    Beside,
    /// The page has no other files beside it.
    Absent,
}

fn check(report: &Report) -> Result<(), ReportError> {
    let count = report.individuals.len();
    let fail = |what: String| Err(ReportError::Inconsistent(what));
    if report.medoids.is_empty() {
        return fail("there is no medoid".into());
    }
    if report.clusters.len() != count || report.map.points.len() != count {
        let (clusters, points) = (report.clusters.len(), report.map.points.len());
        return fail(format!(
            "{count} individuals, {clusters} of them in clusters, {points} on the map"
        ));
    }
    if let Some(place) = report
        .clusters
        .iter()
        .find(|&&place| place as usize >= report.medoids.len())
    {
        return fail(format!("cluster {place} of {}", report.medoids.len()));
    }
    let dimensions = report.embedding_dimensions();
    if report
        .individuals
        .iter()
        .any(|entry| entry.embedding.len() != dimensions)
    {
        return fail("embeddings are of different lengths".into());
    }
    if let Some(index) = report
        .pictured
        .indices
        .iter()
        .find(|&&index| index >= count as u64)
    {
        return fail(format!("a picture of individual {index} among {count}"));
    }
    let further = report.further.iter().map(|further| further.index);
    for index in report.medoids.iter().map(|medoid| medoid.index).chain(further) {
        if index >= count as u64 {
            return fail(format!("individual {index} among {count}"));
        }
    }
    if report
        .map
        .points
        .iter()
        .flatten()
        .any(|coordinate| !coordinate.is_finite())
    {
        return fail("a point of the map is not finite".into());
    }
    Ok(())
}

/// The PNG files of one medoid: small or transparent files for the page, and large files for the folder of the report.
struct MedoidPictures {
    image: Vec<u8>,
    image_large: Vec<u8>,
    trajectory: Vec<u8>,
    trajectory_large: Vec<u8>,
    /// The pictures of the members of the medoid's [`Spread`]; empty if the medoid has no spread.
    members: Vec<Vec<u8>>,
}

fn draw_medoids(report: &Report) -> Result<Vec<MedoidPictures>, ReportError> {
    let in_page = match report.medoids.len() {
        0..=24 => 640,
        25..=96 => 400,
        _ => 240,
    };
    let draw = |medoid: &MedoidEntry| -> Result<MedoidPictures, PictureError> {
        let (world, format) = (report.spec.world(), report.spec.image());
        let controller = &report.individuals[medoid.index as usize].controller;
        let bodies = Bodies::of(controller, world);
        let image = |scale| picture::image_png(&medoid.image, format.shape(), scale);
        let paths = |size, paper| {
            picture::trajectory_png(
                &medoid.replay,
                world,
                bodies.colouring(),
                format.window(),
                size,
                paper,
            )
        };
        Ok(MedoidPictures {
            image: image(1)?,
            image_large: image((400 / format.resolution()).max(1))?,
            trajectory: paths(in_page, Paper::Clear)?,
            trajectory_large: paths(1000, Paper::Light)?,
            members: medoid
                .spread
                .iter()
                .flat_map(Spread::members)
                .map(|(_, member)| picture::image_png(&member.image, format.shape(), 1))
                .collect::<Result<_, _>>()?,
        })
    };
    let drawn = report.medoids.par_iter().map(|medoid| {
        draw(medoid).map_err(|source| ReportError::Picture {
            index: medoid.index,
            source,
        })
    });
    drawn.collect()
}

/// Size of the pictures of further behaviours, in pixels.
const FURTHER_SIZE: u32 = 320;

/// Draws the paths of each further behaviour as PNG.
fn draw_further(report: &Report) -> Result<Vec<Vec<u8>>, ReportError> {
    let (world, window) = (report.spec.world(), report.spec.image().window());
    let drawn = report.further.par_iter().map(|further| {
        let bodies = Bodies::of(&report.individuals[further.index as usize].controller, world);
        let (colouring, paper) = (bodies.colouring(), Paper::Clear);
        picture::trajectory_png(&further.replay, world, colouring, window, FURTHER_SIZE, paper).map_err(
            |source| ReportError::Picture {
                index: further.index,
                source,
            },
        )
    });
    drawn.collect()
}

#[cfg(test)]
mod tests;
