//! The atlas of a controller space: what the judge says of every controller, as a table, a picture and a page.
//!
//! The picture stacks four dimensions: a tile for each pair of speeds while nothing is seen, and in each tile a pixel
//! for each pair of speeds while something is.

mod layout;
mod page;
mod picture;
mod poster;
mod table;
mod tally;
mod tiles;

#[cfg(test)]
mod tests;

pub use layout::Layout;
pub use tally::{Tally, agreed, precision};
pub use tiles::Tiles;

use super::{ReportError, ReportFiles, files::Folder};
use murmuration_model::colours::{self, Rgb};
use murmuration_proto::{CampaignSpec, Class, Controller, Features, Verdict};
use std::path::Path;

/// What an exhaustive campaign found.
#[derive(Debug, Clone)]
pub struct Atlas {
    /// Id of the campaign.
    pub campaign: String,
    /// Digest of its archive.
    pub digest: String,
    /// Its specification.
    pub spec: CampaignSpec,
    /// Its archive, by index; at least one.
    pub entries: Vec<AtlasEntry>,
}

/// A controller of an atlas. What is said of it holds for its mirror image too.
#[derive(Debug, Clone)]
pub struct AtlasEntry {
    /// The controller.
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

/// Writes `atlas.csv`, its `README.md` and `spec.toml` into `folder`, which is made if it does not exist; where all
/// controllers of four speeds were evaluated, also `atlas.png`, `atlas-poster.svg` and, last, `atlas.html`, the page of
/// the answer; otherwise the page is the table. The page shows pictures of swarms if [`Tiles`] wrote them into the same
/// folder.
///
/// # Errors
/// [`ReportError::Write`] names the path.
pub fn write(atlas: &Atlas, folder: &Path) -> Result<ReportFiles, ReportError> {
    let tallies: Vec<Tally> = atlas
        .entries
        .iter()
        .map(|entry| Tally::of(&entry.verdicts))
        .collect();
    let mut files = Folder::create(folder)?;
    files.text("README.md", &table::readme(atlas))?;
    files.text("spec.toml", &atlas.spec.to_toml())?;
    let csv = files.write("atlas.csv", |file| table::write(atlas, &tallies, file))?;
    let Some(layout) = Layout::of(&atlas.spec) else {
        return Ok(ReportFiles {
            page: csv,
            others: files.written()[..2].to_vec(),
        });
    };
    let places = layout.places(atlas);
    let drawn = |file, scale| {
        let drawn = picture::png(&layout, &places, &tallies, scale);
        drawn.map_err(|source| ReportError::Drawing { file, source })
    };
    let map = drawn("atlas.png", 1)?;
    let large = drawn("atlas-poster.svg", poster::scale(&layout))?;
    files.bytes("atlas.png", &map)?;
    files.text("atlas-poster.svg", &poster::svg(atlas, &layout, &tallies, &large))?;
    let others = files.written().to_vec();
    let page = files.text("atlas.html", &page::render(atlas, &layout, &places, &map))?;
    Ok(ReportFiles { page, others })
}

/// The colour of a class in atlases: that of a behaviour without one is grey.
#[must_use]
pub const fn colour(class: Class) -> Rgb {
    match class {
        Class::CyclicPursuit => colours::AGENTS[9],
        Class::Milling => colours::AGENTS[13],
        Class::Aggregation => colours::AGENTS[7],
        Class::Dispersal => colours::AGENTS[8],
        Class::WallFollowing => colours::AGENTS[11],
        Class::NestedCycle => colours::AGENTS[5],
        Class::ConcavePath => colours::AGENTS[10],
        Class::Random => colours::LINE,
    }
}
