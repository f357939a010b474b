//! Documents about robots and their controllers.

use murmuration_proto::{CapabilityModel, Controller, DriveKind, SeenRobots, Sensor, Species};
use murmuration_report::picture::sensor_in_words;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The robots of a swarm.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct Robots {
    /// A preset's name, or what kind of swarm it is.
    model: String,
    /// The description as an inline table of TOML, as in campaign files.
    description: String,
    /// The species, in order; one without a name that matters if all robots are of one kind.
    species: Vec<OneSpecies>,
    /// Numbers of robots of each species, to choose from; empty if there is one species.
    ratios: Vec<Vec<u32>>,
    /// Names of a controller's genes, in order.
    genes: Vec<String>,
}

/// One species.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct OneSpecies {
    /// Its name.
    name: String,
    /// Radius of a body, world units.
    radius: f64,
    /// `differential` or `unicycle`.
    drive: &'static str,
    /// Largest magnitude of the two numbers of a pair: left and right wheel, or speed and turning rate.
    limits: [f64; 2],
    /// Its sensors, S1 first.
    sensors: Vec<OneSensor>,
}

/// One sensor.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct OneSensor {
    /// Its angle from the heading, radians; null if that is a gene.
    angle: Option<f64>,
    /// Lowest and highest value of a free angle, radians; null unless it is free in a range.
    angle_range: Option<[f64; 2]>,
    /// Values of a free angle to choose from, radians; empty unless it is free in a list.
    angles: Vec<f64>,
    /// Half of the cone's opening angle, radians; 0 for a ray.
    half_angle: f64,
    /// Largest distance at which it sees robots and obstacles, world units; null without a limit.
    range: Option<f64>,
    /// Largest distance at which it sees walls, world units; null if it does not see them.
    wall_range: Option<f64>,
    /// What it sees: `robots` or the name of one species, `walls`, `obstacles`.
    sees: Vec<String>,
    /// The same in words.
    words: String,
}

impl From<&CapabilityModel> for Robots {
    fn from(model: &CapabilityModel) -> Self {
        Self {
            model: model.to_string(),
            description: model.to_line(),
            species: model.species().iter().map(OneSpecies::from).collect(),
            ratios: model.ratios().to_vec(),
            genes: model.gene_names(),
        }
    }
}

impl From<&Species> for OneSpecies {
    fn from(species: &Species) -> Self {
        let robot = species.robot();
        Self {
            name: species.name().to_string(),
            radius: robot.radius(),
            drive: match robot.drive().kind() {
                DriveKind::Differential { .. } => "differential",
                DriveKind::Unicycle => "unicycle",
            },
            limits: robot.drive().limits(),
            sensors: robot.sensors().iter().map(OneSensor::from).collect(),
        }
    }
}

impl From<&Sensor> for OneSensor {
    fn from(sensor: &Sensor) -> Self {
        let robots = match sensor.robots() {
            SeenRobots::None => None,
            SeenRobots::All => Some("robots".to_owned()),
            SeenRobots::Species(name) => Some(name.to_string()),
        };
        let walls = sensor.wall_range().map(|_| "walls".to_owned());
        let obstacles = sensor.sees_obstacles().then(|| "obstacles".to_owned());
        Self {
            angle: sensor.angle().value(),
            angle_range: sensor.angle().range(),
            angles: sensor.angle().choices().to_vec(),
            half_angle: sensor.half_angle(),
            range: sensor.range(),
            wall_range: sensor.wall_range(),
            sees: robots.into_iter().chain(walls).chain(obstacles).collect(),
            words: sensor_in_words(sensor, None),
        }
    }
}

/// A controller, for other programs.
#[derive(Debug, Serialize, JsonSchema)]
pub(in crate::cli) struct ExportedController {
    /// A preset's name, or what kind of swarm it is.
    model: String,
    /// The robots as an inline table of TOML, as in campaign files.
    robots: String,
    /// The genes by name.
    genes: BTreeMap<String, f64>,
    /// The controller of each species, in order.
    species: Vec<SpeciesController>,
}

/// The controller of one species.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct SpeciesController {
    /// Its name.
    name: String,
    /// What the two numbers of a pair are: left and right, or speed and turn.
    pair: [&'static str; 2],
    /// The pair of each sensor state; the highest bit of a state is the first sensor's.
    speeds: Vec<[f64; 2]>,
    /// The angle of each sensor, radians.
    angles: Vec<f64>,
}

impl From<&Controller> for ExportedController {
    fn from(controller: &Controller) -> Self {
        let model = controller.model();
        let species = model.species().iter().zip(controller.robots());
        Self {
            model: model.to_string(),
            robots: model.to_line(),
            genes: model
                .gene_names()
                .into_iter()
                .zip(controller.genes().iter().copied())
                .collect(),
            species: species
                .map(|(species, robot)| SpeciesController {
                    name: species.name().to_string(),
                    pair: robot.robot().drive().pair_names(),
                    speeds: robot.pairs().to_vec(),
                    angles: robot.angles().collect(),
                })
                .collect(),
        }
    }
}
