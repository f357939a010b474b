//! The pictures of the medoids of a cell.

use crate::outcome::MeasuredCell;
use murmuration_proto::{CampaignSpec, Controller, Frames, Invalid};
use murmuration_report::picture::{Bodies, Paper, PictureError, trajectory_png};
use murmuration_worker::{replay::replay_frames, simulate::Start};
use std::num::NonZeroU32;

/// Side of a medoid's picture, pixels.
const PICTURE: u32 = 180;

/// The pictures of a cell.
pub(crate) struct CellPictures {
    /// The medoids of its last taxonomy by index, the largest cluster first: PNG files. None if they were not judged.
    pub(crate) medoids: Vec<(u64, Vec<u8>)>,
}

impl CellPictures {
    /// Simulates and draws them; otherwise says of which individual there is no picture, and why.
    pub(crate) fn of(cell: &MeasuredCell<'_>) -> Result<Self, (u64, String)> {
        let Some(behaviours) = &cell.measured.behaviours else {
            return Ok(Self { medoids: Vec::new() });
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
                Err(reason) => Err((index, reason.to_string())),
            })
        });
        Ok(Self {
            medoids: medoids.collect::<Result<_, _>>()?,
        })
    }
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
