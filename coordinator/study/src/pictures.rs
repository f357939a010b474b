//! The pictures of the medoids of a cell, and why a report cannot be written.

use crate::outcome::MeasuredCell;
use murmuration_report::picture::{Bodies, Paper, PictureError, trajectory_png};
use murmuration_sim::{replay::replay_frames, simulate::Start};
use murmuration_swarm::{CampaignSpec, Controller, Frames, Invalid};
use std::num::NonZeroU32;

/// Side of a medoid's picture, pixels.
const PICTURE: u32 = 180;

/// Why a report cannot be written.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    #[error(transparent)]
    Folder(#[from] murmuration_files::FolderError),
    #[error("cannot draw the map \"{title}\": {reason}")]
    Map { title: String, reason: String },
    #[error("cannot draw individual {index} of campaign {campaign}: {reason}")]
    Picture {
        index: u64,
        campaign: String,
        reason: String,
    },
}

/// PNG files of the medoids of a cell's last taxonomy, by index, the largest cluster first; no files if the cell was not judged.
pub(crate) type MedoidPictures = Vec<(u64, Vec<u8>)>;

/// Simulates and draws the medoids of a cell. The error has the index of a medoid that cannot be drawn, and the reason.
pub(crate) fn of_cell(cell: &MeasuredCell<'_>) -> Result<MedoidPictures, (u64, String)> {
    let Some(behaviours) = &cell.measured.behaviours else {
        return Ok(Vec::new());
    };
    let last = behaviours.taxonomies.last();
    let medoids = last.iter().flat_map(|taxonomy| &taxonomy.medoids);
    let drawn = medoids.filter_map(|&index| {
        let individual = behaviours.individuals.get(&index)?;
        let drawn = picture(&cell.cell.spec, &individual.controller, individual.seed);
        Some(match drawn {
            Ok(png) => Ok((index, png)),
            Err(reason) => Err((index, reason.to_string())),
        })
    });
    drawn.collect()
}

/// Why a medoid cannot be drawn.
#[derive(Debug, thiserror::Error)]
enum Undrawn {
    #[error(transparent)]
    Simulation(#[from] Invalid),
    #[error(transparent)]
    Picture(#[from] PictureError),
}

/// Draws the paths of the last steps of a swarm.
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
