//! Robots on the command line: options that name robots, and `robot`, which shows them.

use super::{
    CliError,
    files::{FileType, Overwrite, check_outputs, read_words},
    json,
    run::read_spec,
};
use murmuration_files::InputKind;
use murmuration_link::{OutputError, outln};
use murmuration_report::picture::{robot_svg, sensor_in_words};
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, DriveKind, ImageFormat, Preset, Robot, SensorAngle, Species, World,
    counted,
};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
pub struct RobotArgs {
    /// Robots by name: single-sensor, two-sensor, flockbots or turbopi [default: the paper's robots with as many genes]
    #[arg(long, value_name = "NAME", requires = "controller")]
    model: Option<Preset>,
    /// File that describes the robots, and their world if it is not the paper's, in the format of campaign files
    #[arg(long, value_name = "FILE", requires = "controller", conflicts_with = "model")]
    robot: Option<PathBuf>,
    /// Campaign file with the robots, world and image format to use [default: the paper's]
    #[arg(long, value_name = "SPEC.toml", requires = "controller", conflicts_with_all = ["model", "robot"])]
    spec: Option<PathBuf>,
}

impl RobotArgs {
    /// The input files.
    pub(super) fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.robot.iter().chain(&self.spec)
    }

    /// The robots (`None` if no option names or describes them), their world, and the format of their picture.
    pub(super) fn read(&self) -> Result<(Option<CapabilityModel>, World, ImageFormat), CliError> {
        if let Some(path) = &self.spec {
            let spec = read_spec(path, None)?;
            return Ok((Some(spec.model().clone()), spec.world().clone(), *spec.image()));
        }
        let format = ImageFormat::default();
        if let Some(path) = &self.robot {
            let (model, world) = described(path)?;
            return Ok((Some(model), world, format));
        }
        Ok(match self.model.map(CapabilityModel::from) {
            Some(model) => {
                let world = World::for_model(&model)?;
                (Some(model), world, format)
            }
            None => (None, World::default(), format),
        })
    }
}

/// The robots of a file, and their world.
pub(super) fn described(path: &Path) -> Result<(CapabilityModel, World), CliError> {
    let text = read_words(path, InputKind::Campaign)?;
    let named = |error| CliError::Input(format!("{}: {error}", path.display()));
    CampaignSpec::robots_from_toml(&text).map_err(named)
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The file has the fields that a campaign file has for robots: model, [robot], or [[species]] and ratios. It may be a whole campaign \
file. docs/robots.md describes the fields.

Examples:
  murmuration robot examples/three-sensors.toml --svg robot.svg
  murmuration robot --model turbopi")]
pub struct ShowRobot {
    /// File that describes the robots
    #[arg(required_unless_present = "model")]
    file: Option<PathBuf>,
    /// Robots by name: single-sensor, two-sensor, flockbots or turbopi
    #[arg(long, value_name = "NAME", conflicts_with = "file")]
    model: Option<Preset>,
    /// Draw the robot to this SVG; for several species, draw one SVG each, with the name of the species before .svg
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

impl ShowRobot {
    pub(super) fn execute(self, as_json: bool) -> Result<(), CliError> {
        if let Some(path) = &self.svg {
            FileType::Svg.check("--svg", path)?;
            check_outputs([("--svg", path)], &self.file, self.overwrite)?;
        }
        let model = match (&self.file, self.model) {
            (Some(path), _) => described(path)?.0,
            (None, preset) => preset.unwrap_or(Preset::SingleSensor).into(),
        };
        if as_json {
            json::print(json::Robots::from(&model))?;
        } else {
            show(&model)?;
        }
        match &self.svg {
            Some(path) => draw(&model, path, self.overwrite),
            None => Ok(()),
        }
    }
}

fn draw(model: &CapabilityModel, path: &Path, overwrite: Overwrite) -> Result<(), CliError> {
    let svg = |species: &Species| robot_svg(species.robot(), None).into_string();
    match model.species() {
        [alone] => overwrite.write(path, svg(alone)),
        several => {
            let file = |species: &Species| path.with_extension(format!("{}.svg", species.name()));
            several
                .iter()
                .try_for_each(|species| overwrite.check(&file(species)))?;
            several
                .iter()
                .try_for_each(|species| overwrite.write(&file(species), svg(species)))
        }
    }
}

fn show(model: &CapabilityModel) -> Result<(), OutputError> {
    outln!("{model}")?;
    for species in model.species() {
        if model.species().len() > 1 {
            outln!("\nspecies {}", species.name())?;
        }
        outln!("  body  {}", body(species.robot()))?;
        for (i, sensor) in species.robot().sensors().iter().enumerate() {
            outln!("  S{}    {}", i + 1, sensor_in_words(sensor, None))?;
        }
    }
    let ratios: Vec<String> = model
        .ratios()
        .iter()
        .map(|counts| format!("{counts:?}"))
        .collect();
    if !ratios.is_empty() {
        outln!("\nrobots of each species: {}", ratios.join(" or "))?;
    }
    outln!("\n{}", counted(model.genes() as u64, "gene"))?;
    for (name, values) in model.gene_names().iter().zip(gene_values(model)) {
        outln!("  {name:<16} {values}")?;
    }
    Ok(())
}

/// A robot's body in words, such as `radius 5, two wheels of radius 2, speeds up to 1`.
fn body(robot: &Robot) -> String {
    let [first, second] = robot.drive().limits();
    let radius = robot.radius();
    match robot.drive().kind() {
        DriveKind::Differential { wheel_radius } => {
            format!("radius {radius}, two wheels of radius {wheel_radius}, speeds up to {first}")
        }
        DriveKind::Unicycle => {
            format!("radius {radius}, unicycle, speed up to {first}, turning rate up to {second}")
        }
    }
}

/// The range of each gene of a model's controllers, in their order.
pub(super) fn gene_values(model: &CapabilityModel) -> Vec<String> {
    let mut values = Vec::with_capacity(model.genes());
    for species in model.species() {
        let robot = species.robot();
        let limits = robot.drive().limits().into_iter().cycle();
        values.extend(
            limits
                .take(robot.speeds())
                .map(|limit| format!("-{limit} to {limit}")),
        );
        values.extend(robot.free_angles().map(|(_, angle)| angle_values(angle)));
    }
    if model.ratios().len() > 1 {
        values.push(format!("0 to {}: the place of a ratio", model.ratios().len() - 1));
    }
    values
}

fn angle_values(angle: &SensorAngle) -> String {
    match angle.range() {
        Some([low, high]) => format!("{low:.4} to {high:.4}"),
        None => {
            let choices: Vec<_> = angle
                .choices()
                .iter()
                .map(|angle| format!("{angle:.4}"))
                .collect();
            format!("one of {}", choices.join(", "))
        }
    }
}
