//! The atlas of a controller space: the judge's verdicts on every controller, as a table, a picture and a page.
//!
//! The picture shows four dimensions. It has one tile for each pair of speeds while a robot sees nothing; each tile has one pixel
//! for each pair of speeds while a robot sees something.

mod layout;
mod page;
mod poster;
mod table;
mod tally;
mod tiles;

#[cfg(test)]
mod tests;

pub use layout::Layout;
pub use page::{HOW, canvas, explained};
pub use tally::{Tally, agreed, precision};
pub use tiles::Tiles;

use super::{ReportError, ReportFiles};
use crate::picture::{PictureError, encoded};
use murmuration_files::{Folder, Replaces};
use murmuration_model::colours::Rgb;
use murmuration_swarm::{CampaignSpec, Controller, Features, Verdict};
use std::path::Path;

/// The map of an exhaustive campaign.
#[derive(Debug, Clone)]
pub struct Atlas {
    /// The campaign's id.
    pub campaign: String,
    /// Digest of the campaign's archive.
    pub digest: String,
    pub spec: CampaignSpec,
    /// The controllers of the campaign's archive, by index; at least one.
    pub entries: Vec<AtlasEntry>,
}

/// A controller of an atlas. The data of a controller also apply to its mirror image.
#[derive(Debug, Clone)]
pub struct AtlasEntry {
    pub controller: Controller,
    /// Seed of the controller's first start; the other starts follow from this seed.
    pub seed: u64,
    /// The judge's verdict on each trial; at least one.
    pub verdicts: Vec<Verdict>,
    /// Means over the controller's trials.
    pub features: Features,
    /// The controller's heuristic score.
    pub score: f64,
}

/// The files of an atlas, except the pictures of swarms.
const FILES: [&str; 7] = [
    "README.md",
    "spec.toml",
    "atlas.csv",
    "atlas.png",
    "atlas-poster.svg",
    "atlas-poster.png",
    "atlas.html",
];

/// Prepares the folder of an atlas; `replaces` says whether it can replace an earlier atlas.
///
/// # Errors
/// The errors of [`Folder::finish`], reported before any work is done.
pub fn folder(path: &Path, replaces: Replaces) -> Result<Folder, ReportError> {
    let folder = Folder::create(path, replaces)?;
    folder.check_names(FILES)?;
    Ok(folder)
}

/// Writes `atlas.csv`, its `README.md` and `spec.toml`. If all controllers of four speeds were evaluated, it also writes
/// `atlas.png`, `atlas-poster.svg`, `atlas-poster.png` and, last, the page `atlas.html`. The page shows pictures of swarms if
/// [`Tiles`] wrote these pictures into the same folder. The last file written is the main file of the result: the page, or else
/// the table.
///
/// # Errors
/// The errors of [`Folder::finish`], or [`ReportError::Drawing`].
pub fn write(atlas: &Atlas, mut files: Folder) -> Result<ReportFiles, ReportError> {
    let tallies: Vec<Tally> = atlas
        .entries
        .iter()
        .map(|entry| Tally::of(&entry.verdicts))
        .collect();
    files.text("README.md", &table::readme(atlas))?;
    files.text("spec.toml", &atlas.spec.to_toml())?;
    files.write("atlas.csv", |file| table::write(atlas, &tallies, file))?;
    let Some(layout) = Layout::of(&atlas.spec) else {
        return Ok(ReportFiles::of(files.finish()?));
    };
    let places = layout.places(atlas);
    let pixels = tally::pixels(&places, &tallies);
    let undrawn = |file| move |source| ReportError::Drawing { file, source };
    let map = png(&pixels, &layout).map_err(undrawn("atlas.png"))?;
    let poster = poster::poster(atlas, &layout, &tallies, pixels);
    files.bytes("atlas.png", &map)?;
    files.text(
        "atlas-poster.svg",
        &poster.svg().map_err(undrawn("atlas-poster.svg"))?,
    )?;
    let print = poster
        .png(poster::PNG_SCALE)
        .map_err(undrawn("atlas-poster.png"))?;
    files.bytes("atlas-poster.png", &print)?;
    files.text("atlas.html", &page::render(atlas, &layout, &places, &map))?;
    Ok(ReportFiles::of(files.finish()?))
}

/// Data for a page of an atlas that a coordinator serves: JSON for the page's script, and the picture as PNG with one pixel per
/// controller.
pub fn for_page(atlas: &Atlas, layout: &Layout) -> Result<(String, Vec<u8>), ReportError> {
    let tallies: Vec<Tally> = atlas
        .entries
        .iter()
        .map(|entry| Tally::of(&entry.verdicts))
        .collect();
    let places = layout.places(atlas);
    let picture = png(&tally::pixels(&places, &tallies), layout).map_err(|source| ReportError::Drawing {
        file: "atlas.png",
        source,
    })?;
    Ok((page::data(atlas, layout, &places).to_string(), picture))
}

/// The picture as PNG, with one pixel per controller.
fn png(pixels: &[Rgb], layout: &Layout) -> Result<Vec<u8>, PictureError> {
    encoded(pixels.as_flattened(), [layout.side(); 2], png::ColorType::Rgb)
}
