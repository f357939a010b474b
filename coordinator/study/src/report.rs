//! Writes the report of a study: one self-contained page, and the tables that it follows from.

use crate::{
    outcome::{MeasuredCell, Outcome},
    page, written,
};
use murmuration_proto::{CampaignSpec, Controller, Frames, Invalid};
use murmuration_report::{
    Folder,
    picture::{Bodies, Paper, PictureError, trajectory_png},
};
use murmuration_worker::{replay::replay_frames, simulate::Start};
use rayon::prelude::*;
use std::{
    num::NonZeroU32,
    path::{Path, PathBuf},
};

/// Side of a medoid's picture, pixels.
const PICTURE: u32 = 180;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// A file or folder cannot be written.
    #[error("{0}")]
    Write(#[from] murmuration_report::ReportError),
    /// A medoid cannot be simulated or drawn.
    #[error("cannot draw individual {index} of campaign {campaign}: {reason}")]
    Picture {
        /// Its index.
        index: u64,
        /// Its campaign.
        campaign: String,
        /// What is wrong.
        reason: String,
    },
}

/// The files that were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ReportFiles {
    /// The page to open.
    pub page: PathBuf,
    /// The figures of each cell.
    pub cells: PathBuf,
    /// The judged individuals.
    pub medoids: PathBuf,
}

/// The pictures of a cell.
pub(crate) struct CellPictures {
    /// The medoids of its last taxonomy by index, the largest cluster first: PNG files. None if they were not judged.
    pub(crate) medoids: Vec<(u64, Vec<u8>)>,
}

/// Writes `report.html`, `cells.csv` and `medoids.csv` into `folder`, which is made if it does not exist. Every file is
/// complete or absent; the page is written last.
///
/// # Errors
/// See [`ReportError`].
pub fn write_report(outcome: &Outcome, folder: &Path) -> Result<ReportFiles, ReportError> {
    let cells: Vec<MeasuredCell<'_>> = outcome.cells().collect();
    let pictures: Vec<CellPictures> = cells.par_iter().map(drawn).collect::<Result<_, _>>()?;
    let page = page::render(outcome, &outcome.tables(), &pictures);
    let mut files = Folder::create(folder)?;
    Ok(ReportFiles {
        cells: files.write("cells.csv", |file| written::cells(outcome, file))?,
        medoids: files.write("medoids.csv", |file| written::medoids(outcome, file))?,
        page: files.text("report.html", &page)?,
    })
}

fn drawn(cell: &MeasuredCell<'_>) -> Result<CellPictures, ReportError> {
    let Some(behaviours) = &cell.measured.behaviours else {
        return Ok(CellPictures { medoids: Vec::new() });
    };
    let last = behaviours
        .taxonomies
        .last()
        .map(|taxonomy| taxonomy.medoids.as_slice());
    let medoids = last.unwrap_or_default().iter().filter_map(|&index| {
        let individual = behaviours.individuals.get(&index)?;
        let drawn = picture(&cell.cell.spec, &individual.controller, individual.seed);
        Some(match drawn {
            Ok(png) => Ok((index, png)),
            Err(reason) => Err(ReportError::Picture {
                index,
                campaign: cell.measured.campaign.clone(),
                reason: reason.to_string(),
            }),
        })
    });
    Ok(CellPictures {
        medoids: medoids.collect::<Result<_, _>>()?,
    })
}

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
enum Undrawn {
    #[error("{0}")]
    Simulation(#[from] Invalid),
    #[error("{0}")]
    Picture(#[from] PictureError),
}

/// The paths of the last steps of a swarm.
fn picture(spec: &CampaignSpec, genes: &[f64], seed: u64) -> Result<Vec<u8>, Undrawn> {
    let (world, window) = (spec.world(), spec.image().window());
    let controller = Controller::new(spec.model(), genes)?;
    let frames = Frames::of_end(window, NonZeroU32::MIN.saturating_add(1), world);
    let replay = replay_frames(&controller, world, &Start::seeded(seed), &frames)?;
    let bodies = Bodies::of(&controller, world);
    Ok(trajectory_png(
        &replay,
        world,
        bodies.colouring(),
        window,
        PICTURE,
        Paper::Light,
    )?)
}
