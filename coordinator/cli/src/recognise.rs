//! `recognise`: the behaviour of a swarm that a camera tracked, and the most similar individuals of a campaign.

mod assumed;
mod shown;

use super::{
    CliError, Global, checkpoints,
    connection::{self, Connection},
    controller,
    files::{FileType, Overwrite, check_outputs, read},
    robots::described,
    validation::{get_campaign, validated},
};
use assumed::{Arena, Assumed};
use murmuration_coordinator::local::InProcess;
use murmuration_embed::{Embedder, Runtime};
use murmuration_files::InputKind;
use murmuration_onnx::EmbedderModel;
use murmuration_proto::v1;
use murmuration_report::picture;
use murmuration_sim::{evaluate::observe, features::FEATURE_STEPS};
use murmuration_swarm::{
    CampaignSpec, Controller, Evaluation, Invalid, PictureShape, World, counted, text::quoted,
};
use murmuration_tracks::{Tracks, TracksError};
use std::path::PathBuf;

/// Side of each picture in the row, in pixels, if all pictures fit.
const PICTURE_SIDE: u32 = 400;
/// Largest width of the row of pictures, in pixels.
const ROW_WIDTH: u32 = 4096;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The file has a row for each robot in each frame: the columns frame and robot (whole numbers), x and y, and perhaps heading \
(radians; y points down, and headings grow from x to y). A robot that is missing for up to 25 frames in a row is interpolated. \
Without headings, a robot looks where it moves.

Examples:
  murmuration simulate --controller -0.7,0.3,1,1 --seed 7 --tracks tracks.csv
  murmuration recognise tracks.csv
  murmuration recognise tracks.csv --frame-time 0.5 --arena 400x400 --png row.png")]
pub struct Recognise {
    /// Tracks of the robots, CSV
    tracks: PathBuf,
    /// Campaign to compare the swarm with
    #[arg(long, value_name = "ID", default_value = "latest")]
    campaign: String,
    /// File that describes the robots [default: the campaign's robots]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Controller of the robots, if it is known; it gives the free angles of sensors [default: straight ahead]
    #[arg(long, value_name = "NUMBERS")]
    controller: Option<String>,
    /// Time from one frame to the next, in units of the world's time [default: one step]
    #[arg(long, value_name = "TIME")]
    frame_time: Option<f64>,
    /// Width and height of the filmed arena, in units of the tracks, with a corner at 0, 0; the command scales the arena to the
    /// world [default: the tracks are in world units]
    #[arg(long, value_name = "WIDTHxHEIGHT")]
    arena: Option<Arena>,
    /// Number of nearest individuals to show, 1 to 100
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=100))]
    count: u32,
    /// Write the swarm's picture, then the pictures of the nearest individuals, to this PNG
    #[arg(long, value_name = "FILE")]
    png: Option<PathBuf>,
    #[command(flatten)]
    overwrite: Overwrite,
}

/// The tracks as a behaviour, with the nearest individuals of a campaign.
struct Recognised {
    campaign: String,
    assumed: Assumed,
    /// The shape of pictures of the campaign.
    shape: PictureShape,
    evaluation: Evaluation,
    nearest: v1::FindNearestResponse,
    /// Pictures of the nearest individuals; empty without `--png`.
    pictures: Vec<Vec<u8>>,
}

impl Recognise {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        if let Some(path) = &self.png {
            FileType::Png.check("--png", path)?;
            let read = self.robot.iter().chain([&self.tracks]);
            check_outputs([("--png", path)], read, self.overwrite)?;
        }
        let tracks = Tracks::parse(&self.tracks, read(&self.tracks, InputKind::Tracks)?)?;
        let find = async |connection: &mut Connection| self.find(connection, &tracks).await;
        let recognised = connection::with(global, InProcess::NONE, find).await?;
        recognised.assumed.tell();
        shown::show(&recognised, global.json)?;
        match &self.png {
            Some(path) => self.overwrite.write(path, row(&recognised)?),
            None => Ok(()),
        }
    }

    async fn find(&self, connection: &mut Connection, tracks: &Tracks) -> Result<Recognised, CliError> {
        let campaign = get_campaign(&mut connection.client, &self.campaign).await?;
        let spec = CampaignSpec::try_from(campaign.spec.unwrap_or_default())?;
        let (controller, world) = self.swarm(&spec, tracks)?;
        let assumed = Assumed::of(self, tracks, &controller, &world, &spec)?;
        let steps = (spec.image().window() - 1).max(FEATURE_STEPS);
        // A campaign's picture covers at most the steps since the start of a swarm.
        let steps = steps.min(spec.world().horizon());
        let frames = tracks.ending(steps, &assumed.filmed(&world)?)?;
        let assumed = assumed.with_steps(frames.len() as u64 - 1, u64::from(steps));
        let named = |error| CliError::Input(format!("{}: {error}", self.tracks.display()));
        let evaluation = observe(&controller, &world, spec.image(), &frames).map_err(named)?;
        let evaluation = match campaign.checkpoint.as_str() {
            digest if spec.space().embeds() && !digest.is_empty() => {
                embedded(connection, digest, evaluation).await?
            }
            _ => evaluation,
        };
        let request = v1::FindNearestRequest {
            campaign: campaign.id.clone(),
            features: evaluation.features().to_vec(),
            embedding: evaluation.embedding().to_vec(),
            checkpoint: campaign.checkpoint,
            count: Some(self.count),
        };
        let nearest = validated(connection.client.find_nearest(request).await?)?;
        let mut pictures = Vec::new();
        for neighbour in nearest.neighbours.iter().filter(|_| self.png.is_some()) {
            let request = v1::GetIndividualRequest {
                campaign: campaign.id.clone(),
                index: neighbour.index,
            };
            let individual = connection.client.get_individual(request).await?.into_inner();
            pictures.push(individual.image.unwrap_or_default());
        }
        Ok(Recognised {
            campaign: campaign.id,
            assumed,
            shape: spec.image().shape(),
            evaluation,
            nearest,
            pictures,
        })
    }

    /// The robots, with the sensor angles of their controller, and the filmed world.
    fn swarm(&self, spec: &CampaignSpec, tracks: &Tracks) -> Result<(Controller, World), CliError> {
        let (model, world) = match &self.robot {
            Some(path) => described(path)?,
            None => (spec.model().clone(), spec.world().clone()),
        };
        let sizes = [spec.world(), &world].map(|world| [world.width(), world.height()]);
        if sizes[0] != sizes[1] {
            let [[width, height], own] = sizes;
            return Err(CliError::Input(format!(
                "the world of --robot is {} x {}, but the campaign's world is {width} x {height}: pictures of these two worlds \
                 cannot be compared",
                own[0], own[1]
            )));
        }
        if let Some(robots) = model.robots().filter(|&robots| robots != tracks.robots()) {
            return Err(CliError::Input(format!(
                "{}: there are {}, and the species have {robots} together",
                self.tracks.display(),
                counted(tracks.robots().into(), "robot")
            )));
        }
        let world = World::try_from(v1::World {
            agents: Some(tracks.robots()),
            radius: Some(model.largest_radius()),
            start: None,
            ..world.into()
        });
        let world = world.map_err(|error| CliError::Input(format!("{}: {error}", self.tracks.display())))?;
        let controller = match &self.controller {
            Some(text) => controller::parse(text, Some(&model))?,
            None => assumed::unknown(&model, tracks.counts(&model)?.as_deref())?,
        };
        Ok((controller, world))
    }
}

/// Adds to an evaluation its embedding by a checkpoint of the coordinator.
async fn embedded(
    connection: &mut Connection,
    digest: &str,
    evaluation: Evaluation,
) -> Result<Evaluation, CliError> {
    let file = checkpoints::fetch(&mut connection.checkpoints, digest).await?;
    let model = EmbedderModel::read(&file).map_err(|error| CliError::Failed(format!("{digest}: {error}")))?;
    let mut embedder = Embedder::open(&Runtime::load()?, model)?;
    let embedding = embedder.embed(&[evaluation.image()])?.pop().unwrap_or_default();
    let dimensions = embedder.model().dimensions();
    Ok(evaluation.embedded(embedding, dimensions)?)
}

/// Draws the picture of the swarm, then the pictures of the nearest individuals.
fn row(recognised: &Recognised) -> Result<Vec<u8>, CliError> {
    let mut images = vec![recognised.evaluation.image()];
    images.extend(recognised.pictures.iter().map(Vec::as_slice));
    let side = recognised.shape.side() as u32;
    let fits = ROW_WIDTH / ((side + 1) * images.len() as u32).max(1);
    let scale = (PICTURE_SIDE / side.max(1)).min(fits).max(1);
    Ok(picture::image_row_png(&images, recognised.shape, scale)?)
}

impl From<TracksError> for CliError {
    fn from(error: TracksError) -> Self {
        Self::Input(error.to_string())
    }
}

impl std::str::FromStr for Arena {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let sides = text.split_once('x').and_then(|(width, height)| {
            let side = |text: &str| text.trim().parse::<f64>().ok();
            Some([side(width)?, side(height)?])
        });
        let sides = sides.filter(|sides| sides.iter().all(|side| side.is_finite() && *side > 0.0));
        sides
            .map(Self)
            .ok_or_else(|| Invalid::new("arena", quoted(text), "two numbers over 0 such as 400x300"))
    }
}
