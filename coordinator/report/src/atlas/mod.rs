//! The atlas of a controller space: what the judge says of every controller, as a table, a picture and a page.
//!
//! The picture stacks four dimensions: a tile for each pair of speeds while nothing is seen, and in each tile a pixel
//! for each pair of speeds while something is.

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

use super::{ReportError, ReportFiles, files::Folder};
use crate::picture::{PictureError, encoded};
use murmuration_model::colours::Rgb;
use murmuration_proto::{CampaignSpec, Controller, Features, Verdict};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// The map of an exhaustive campaign.
#[derive(Debug, Clone)]
pub struct Atlas {
    /// Id of the campaign.
    pub campaign: String,
    /// Digest of its archive.
    pub digest: String,
    pub spec: CampaignSpec,
    /// Its archive, by index; at least one.
    pub entries: Vec<AtlasEntry>,
}

/// A controller of an atlas. What is said of it holds for its mirror image too.
#[derive(Debug, Clone)]
pub struct AtlasEntry {
    pub controller: Controller,
    /// Seed of its first start, from which the others follow.
    pub seed: u64,
    /// What the judge said of each trial; at least one.
    pub verdicts: Vec<Verdict>,
    /// Means over its trials.
    pub features: Features,
    /// Its heuristic score.
    pub score: f64,
}

/// The table, by which the folder of an atlas is known.
const TABLE: &str = "atlas.csv";
/// The other files of an atlas, but for the pictures of swarms.
const FILES: [&str; 6] = [
    "README.md",
    "spec.toml",
    "atlas.png",
    "atlas-poster.svg",
    "atlas-poster.png",
    "atlas.html",
];

/// Writes `atlas.csv`, its `README.md` and `spec.toml` into `folder`, which is made if it does not exist; where all
/// controllers of four speeds were evaluated, also `atlas.png`, `atlas-poster.svg`, `atlas-poster.png` and, last, `atlas.html`,
/// the page of the answer; otherwise the page is the table. The page shows pictures of swarms if [`Tiles`] wrote them into the same
/// folder.
pub fn write(atlas: &Atlas, folder: &Path) -> Result<ReportFiles, ReportError> {
    let tallies: Vec<Tally> = atlas
        .entries
        .iter()
        .map(|entry| Tally::of(&entry.verdicts))
        .collect();
    let mut files = Folder::create(folder)?;
    files.text("README.md", &table::readme(atlas))?;
    files.text("spec.toml", &atlas.spec.to_toml())?;
    let csv = files.write(TABLE, |file| table::write(atlas, &tallies, file))?;
    let Some(layout) = Layout::of(&atlas.spec) else {
        return Ok(ReportFiles {
            page: csv,
            others: files.written()[..2].to_vec(),
        });
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
    let others = files.written().to_vec();
    let page = files.text("atlas.html", &page::render(atlas, &layout, &places, &map))?;
    Ok(ReportFiles { page, others })
}

/// Moves an atlas that [`write()`] and [`Tiles`] put into `fresh`, a folder on the same disk, to `folder`, which exists. Then what
/// an atlas that was there before left is removed: files that the new one has not would be taken for its own. Everything else
/// in `folder` stays, and so does the former atlas where nothing can be moved.
///
/// # Errors
/// [`ReportError::Write`] names what cannot be moved or removed.
pub fn replace(fresh: &Path, folder: &Path) -> Result<(), ReportError> {
    // A folder that merely has a file of such a name is none of ours. The table is moved last, and never removed, so that an atlas
    // that was moved in part is still known as one.
    let was_atlas = folder.join(TABLE).is_file();
    let new = files_in(fresh);
    let failed = |path: &Path| {
        let path = path.to_owned();
        move |source| ReportError::Write { path, source }
    };
    for name in &new {
        let place = folder.join(name);
        if let Some(above) = place.parent() {
            fs::create_dir_all(above).map_err(failed(above))?;
        }
        fs::rename(fresh.join(name), &place).map_err(failed(&place))?;
    }
    if was_atlas {
        for name in files_in(folder).iter().filter(|name| !new.contains(name)) {
            let path = folder.join(name);
            fs::remove_file(&path).map_err(failed(&path))?;
        }
    }
    Ok(())
}

/// The files of an atlas that are in a folder, by their names in it.
fn files_in(folder: &Path) -> Vec<PathBuf> {
    let tiles = fs::read_dir(folder.join(tiles::FOLDER)).into_iter().flatten();
    let tiles = tiles.filter_map(|tile| tile.ok()?.file_name().into_string().ok());
    let tiles = tiles.filter(|name| name.starts_with("tile-") && name.ends_with(".png"));
    let tiles = tiles.map(|name| Path::new(tiles::FOLDER).join(name));
    let files = FILES.iter().chain([&TABLE]).map(PathBuf::from);
    let files = files.filter(|name| folder.join(name).is_file());
    tiles.chain(files).collect()
}

/// What the script of an atlas's page draws from, as JSON, and the picture as a PNG, a pixel a controller: for a page that a
/// coordinator serves.
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

/// The picture as a PNG, a pixel a controller.
fn png(pixels: &[Rgb], layout: &Layout) -> Result<Vec<u8>, PictureError> {
    encoded(pixels.as_flattened(), [layout.side(); 2], png::ColorType::Rgb)
}
