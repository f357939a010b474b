//! Documents about robots and controllers: descriptions, results of evaluations, and tracked swarms.

use super::{Document, Whole};
use base64::{Engine as _, engine::general_purpose::STANDARD};
use murmuration_proto::v1;
use murmuration_report::picture::sensor_in_words;
use murmuration_swarm::{
    CapabilityModel, Controller, DriveKind, Evaluation, Features, Invalid, SeenRobots, Sensor, Species,
    mean_embedding, mean_features,
};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The robots of a swarm.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Robots {
    /// Name of the preset, or else the kind of the swarm.
    model: String,
    /// The description as an inline table of TOML, as in campaign files.
    description: String,
    /// The species, in order. A swarm of equal robots has one species, whose name has no meaning.
    species: Vec<OneSpecies>,
    /// Possible ratios of the species, each as the number of robots of each species; empty for a swarm of one species.
    ratios: Vec<Vec<u32>>,
    /// Names of a controller's genes, in order.
    genes: Vec<String>,
}

/// One species.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct OneSpecies {
    /// Name of the species.
    name: String,
    /// Radius of a body, world units.
    radius: f64,
    /// `differential` or `unicycle`.
    drive: &'static str,
    /// Largest magnitude of the two numbers of a pair: left and right wheel, or speed and turning rate.
    limits: [f64; 2],
    /// Sensors of a robot, S1 first.
    sensors: Vec<OneSensor>,
}

/// One sensor.
#[derive(Debug, Serialize, JsonSchema)]
#[schemars(inline)]
struct OneSensor {
    /// Angle of the sensor from the heading, radians; null if the angle is a gene.
    angle: Option<f64>,
    /// Lowest and highest value of an angle that is free in a range, radians; null for other angles.
    angle_range: Option<[f64; 2]>,
    /// Possible values of an angle that is free in a list, radians; empty for other angles.
    angles: Vec<f64>,
    /// Half of the cone's opening angle, radians; 0 for a ray.
    half_angle: f64,
    /// Largest distance at which the sensor sees robots and obstacles, world units; null without a limit.
    range: Option<f64>,
    /// Largest distance at which the sensor sees walls, world units; null if the sensor does not see walls.
    wall_range: Option<f64>,
    /// Things that the sensor sees: `robots` or the name of one species, `walls`, `obstacles`.
    sees: Vec<String>,
    /// The sensor in words.
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

/// The score of a controller.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct FilterScore {
    /// Genes of the controller: with the paper's robots, 4 wheel speeds, or 8 wheel speeds and an angle in radians.
    pub(crate) controller: Vec<f64>,
    /// The metrics, by name.
    pub(crate) metrics: BTreeMap<String, f64>,
    /// Sum of the metrics' contributions.
    pub(crate) score: f64,
    /// Controllers with a lower score are discarded.
    pub(crate) cutoff: f64,
    /// Whether the controller is kept.
    pub(crate) passes: bool,
}

/// A controller, for other programs.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct ExportedController {
    /// Name of the preset, or else the kind of the swarm.
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
    /// Name of the species.
    name: String,
    /// Meaning of the two numbers of a pair: left and right, or speed and turn.
    pair: [&'static str; 2],
    /// One pair of speeds per sensor state. The highest bit of a sensor state is the reading of the first sensor.
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

/// The result of evaluating a controller.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Evaluated {
    /// Place of the controller in the file, from 0.
    pub(crate) index: u64,
    /// The genes, in the order in which `murmuration robot` names them.
    pub(crate) controller: Vec<f64>,
    /// Seed of the first start.
    pub(crate) seed: Whole,
    /// Average speed, angular momentum, radial variance, scatter, group rotation: means over the starts.
    pub(crate) features: Features,
    /// Embedding by the checkpoint, the mean over the starts; empty without a checkpoint.
    pub(crate) embedding: Vec<f32>,
}

impl Evaluated {
    /// Takes the means over the trials of a controller.
    ///
    /// # Errors
    /// Fails if a trial does not have five features.
    pub(crate) fn new(
        index: u64,
        controller: &Controller,
        seed: u64,
        trials: &[v1::Evaluation],
    ) -> Result<Self, Invalid> {
        let features = trials.iter().map(|trial| {
            Features::try_from(trial.features.as_slice())
                .map_err(|_| Invalid::new("features", trial.features.len(), "5 values"))
        });
        let features: Vec<Features> = features.collect::<Result<_, _>>()?;
        Ok(Self {
            index,
            controller: controller.genes().to_vec(),
            seed: Whole(seed),
            features: mean_features(features.iter()),
            embedding: mean_embedding(trials.iter().map(|trial| trial.embedding.as_slice())),
        })
    }
}

/// A controller that this command simulated, and its behaviour.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Simulated {
    /// The genes, in the order in which `murmuration robot` names them.
    controller: Vec<f64>,
    /// Seed of the start.
    seed: Whole,
    /// Average speed, angular momentum, radial variance, scatter, group rotation.
    features: Vec<f64>,
    /// Grey values of the picture, base64, channel by channel and column by column.
    image: String,
}

impl Simulated {
    pub(crate) fn new(controller: &Controller, seed: u64, evaluation: &Evaluation) -> Self {
        Self {
            controller: controller.genes().to_vec(),
            seed: Whole(seed),
            features: evaluation.features().to_vec(),
            image: STANDARD.encode(evaluation.image()),
        }
    }
}

/// A tracked swarm, and the most similar individuals of a campaign.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Recognised<'a> {
    /// Id of the campaign.
    pub(crate) campaign: String,
    /// Robots that were tracked.
    pub(crate) robots: u32,
    /// The first and the last frame.
    pub(crate) frames: [u32; 2],
    /// Number of missing rows; a complete table has one row per robot and frame.
    pub(crate) missing: u64,
    /// Share of the rows that have a heading, 0 to 1. A robot without a heading is assumed to head where it moves.
    pub(crate) share_of_headings: f64,
    /// Time from one frame to the next, in units of the world's time.
    pub(crate) frame_time: f64,
    /// World units in one unit of the tracks.
    pub(crate) scale: f64,
    /// Share of the positions that are between the walls, or at most a robot's radius outside them, 0 to 1.
    pub(crate) inside: f64,
    /// The longer side of the rectangle that the positions span, world units.
    pub(crate) width: f64,
    /// Steps at the end of the tracks that features and picture cover.
    pub(crate) steps: u64,
    /// Sentences about how the command read the tracks, and about its assumptions.
    pub(crate) notes: Vec<String>,
    #[serde(flatten)]
    pub(crate) behaviour: Behaviour,
    #[serde(flatten)]
    pub(crate) nearest: Document<'a, v1::FindNearestResponse>,
}

/// The behaviour of a swarm.
#[derive(Debug, Serialize, JsonSchema)]
pub(crate) struct Behaviour {
    /// Average speed, angular momentum, radial variance, scatter, group rotation.
    features: Vec<f64>,
    /// Embedding by the campaign's checkpoint; empty without a checkpoint.
    embedding: Vec<f32>,
    /// Grey values of the picture, base64, column by column.
    image: String,
}

impl From<&Evaluation> for Behaviour {
    fn from(evaluation: &Evaluation) -> Self {
        Self {
            features: evaluation.features().to_vec(),
            embedding: evaluation.embedding().to_vec(),
            image: STANDARD.encode(evaluation.image()),
        }
    }
}
