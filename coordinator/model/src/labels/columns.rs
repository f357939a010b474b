//! What columns of label files are called: as in an export, and as they were called before, which files may still have.

use murmuration_proto::{CapabilityModel, ImageFormat, Preset, World, to_toml_line, v1};

/// Column of the behaviour: of a campaign, the individual's index.
pub(super) const INDEX: &str = "index";
/// What it was called before, and is where a behaviour is a file of a picture.
pub(super) const FORMER_INDEX: &str = "id";
/// Column of the second sensor's angle; a file without it is of the single-sensor model, unless it says its robots.
pub(super) const ANGLE: &str = "angle_2";
/// What it was called before.
pub(super) const FORMER_ANGLE: &str = "theta";
/// What the column of the first gene of the paper's robots was called before.
pub(super) const FORMER_SPEED: &str = "v1";

/// Columns of the first gene of the paper's robots, now and before.
pub(super) const FIRST_SPEEDS: [&str; 3] = ["left_0", "left_00", FORMER_SPEED];

/// What the columns of a two-sensor controller's genes were called before; those of one sensor are the first four.
const FORMER_GENES: [&str; 9] = [
    FORMER_SPEED,
    "v2",
    "v3",
    "v4",
    "v5",
    "v6",
    "v7",
    "v8",
    FORMER_ANGLE,
];

/// What the columns of the genes of a model's controllers were called before; none if they had no other names.
pub(super) fn former_genes(model: &CapabilityModel) -> &'static [&'static str] {
    match model.preset() {
        Some(Preset::SingleSensor) => &FORMER_GENES[..4],
        Some(Preset::TwoSensor) => &FORMER_GENES,
        Some(Preset::Flockbots | Preset::TurboPi) | None => &[],
    }
}

/// What a behaviour's world and picture are, as the columns that say so.
pub(super) fn settings(world: &World, format: ImageFormat) -> [(&'static str, String); 16] {
    let obstacles: Vec<v1::Obstacle> = world.obstacles().iter().map(Into::into).collect();
    [
        ("width", world.width().to_string()),
        ("height", world.height().to_string()),
        ("padding", world.padding().to_string()),
        ("agents", world.agents().to_string()),
        ("radius", world.radius().to_string()),
        ("wheel_radius", world.wheel_radius().to_string()),
        ("dt", world.dt().to_string()),
        ("horizon", world.horizon().to_string()),
        ("jitter", world.jitter().to_string()),
        ("boundary", world.boundary().to_string()),
        ("obstacles", to_toml_line(&obstacles)),
        ("start", to_toml_line(&v1::StartShape::from(world.start()))),
        ("noise", to_toml_line(&v1::Noise::from(world.noise()))),
        ("resolution", format.resolution().to_string()),
        ("window", format.window().to_string()),
        ("channels", format.channels_name().to_owned()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_gene_of_the_papers_robots_had_a_name_before() {
        for preset in Preset::PAPER {
            let model = CapabilityModel::from(preset);
            let names = model.gene_names();
            assert!(FIRST_SPEEDS.contains(&names[0].as_str()));
            assert_eq!(names.len(), former_genes(&model).len());
            assert_eq!(
                names.iter().any(|name| name == ANGLE),
                preset == Preset::TwoSensor
            );
        }
    }
}
