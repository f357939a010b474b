//! Names of the columns of label files, in exports and in the labelled sets (tests/labelled).

use murmuration_proto::v1;
use murmuration_swarm::{CapabilityModel, ImageFormat, Preset, World, to_differing_line};

/// Column that identifies the behaviour: for a campaign, by the individual's index.
pub(super) const INDEX: &str = "index";
/// Column that identifies the behaviour in the labelled sets, by the file name of a picture.
pub(super) const SET_INDEX: &str = "id";
/// Column of the second sensor's angle. A file without this column and without a column of robots is of the single-sensor model.
pub(super) const ANGLE: &str = "angle_2";
/// Column of the second sensor's angle in the labelled sets.
pub(super) const SET_ANGLE: &str = "theta";
/// The first gene's column in the labelled sets.
pub(super) const SET_SPEED: &str = "v1";

/// Every name of the first gene's column, for the paper's robots.
pub(super) const FIRST_SPEEDS: [&str; 3] = ["left_0", "left_00", SET_SPEED];

/// Columns of a two-sensor controller's genes in the labelled sets; a single-sensor controller has the first four columns.
const SET_GENES: [&str; 9] = [SET_SPEED, "v2", "v3", "v4", "v5", "v6", "v7", "v8", SET_ANGLE];

/// Columns of the genes of a model's controllers in the labelled sets; empty for robots other than the paper's.
pub(super) fn set_genes(model: &CapabilityModel) -> &'static [&'static str] {
    match model.preset() {
        Some(Preset::SingleSensor) => &SET_GENES[..4],
        Some(Preset::TwoSensor) => &SET_GENES,
        Some(Preset::Flockbots | Preset::TurboPi) | None => &[],
    }
}

/// Column of the world, if it is not the paper's: a TOML table on one line, such as `{ horizon = 600 }`.
pub(super) const WORLD: &str = "world";
/// Column of the picture's format, if it is not the paper's: a TOML table on one line.
pub(super) const IMAGE: &str = "image";

/// The columns for a world and a picture format that are not the paper's, with the fields that differ.
pub(super) fn settings(world: &World, format: ImageFormat) -> Vec<(&'static str, String)> {
    let papers = v1::World::from(World::default());
    let world = to_differing_line(&v1::World::from(world.clone()), &papers);
    let papers = v1::ImageFormat::from(ImageFormat::default());
    let image = to_differing_line(&v1::ImageFormat::from(format), &papers);
    let columns = [(WORLD, world), (IMAGE, image)].into_iter();
    columns.filter_map(|(name, line)| Some((name, line?))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gene_of_the_papers_robots_has_a_column_in_the_labelled_sets() {
        for preset in Preset::PAPER {
            let model = CapabilityModel::from(preset);
            let names = model.gene_names();
            assert!(FIRST_SPEEDS.contains(&names[0].as_str()));
            assert_eq!(names.len(), set_genes(&model).len());
            assert_eq!(
                names.iter().any(|name| name == ANGLE),
                preset == Preset::TwoSensor
            );
        }
    }
}
