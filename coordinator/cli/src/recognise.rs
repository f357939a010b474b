//! `recognise`: the behaviour of a swarm that a camera tracked, and the most similar individuals of a campaign.

mod assumed;
mod film;
mod shown;

use super::{
    CliError, Global, checkpoints,
    connection::{self, Connection},
    controller,
    files::{FileType, Overwrite, check_outputs},
    robots::described,
    validation::{get_campaign, list_campaigns, validated},
};
use assumed::{Assumed, Compared};
use film::Film;
use murmuration_coordinator::local::InProcess;
use murmuration_embed::{Embedder, Runtime};
use murmuration_link::errln;
use murmuration_onnx::EmbedderModel;
use murmuration_proto::v1;
use murmuration_report::picture;
use murmuration_sim::{evaluate::observe, features::FEATURE_STEPS};
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, Controller, Evaluation, PictureShape, World, counted,
};
use murmuration_tracks::{Tracks, TracksFile};
use std::{io::Read, path::PathBuf};

/// Side of each picture in the row, in pixels, if all pictures fit.
const PICTURE_SIDE: u32 = 400;
/// Largest width of the row of pictures, in pixels.
const ROW_WIDTH: u32 = 4096;

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The file has a row for each robot in each frame: the columns frame (a whole number) and robot (a number or a name), x and y, and \
perhaps heading (radians, growing from x to y). A robot whose x and y are empty or NaN is not seen in this frame. A robot that is \
missing for up to 25 frames in a row is interpolated. Without headings, a robot looks where it moves.

Examples:
  murmuration simulate --controller -0.7,0.3,1,1 --seed 7 --tracks tracks.csv
  murmuration recognise tracks.csv
  murmuration recognise tracks.csv --frame-time 2 --arena 500x500 --png row.png
  murmuration recognise sleap.csv --columns frame=frame_idx,robot=track,x=body.x,y=body.y")]
pub struct Recognise {
    #[command(flatten)]
    film: Film,
    /// Campaign to compare the swarm with, or `latest` [default: the newest completed campaign]
    #[arg(long, value_name = "ID")]
    campaign: Option<String>,
    /// File that describes the robots [default: the campaign's robots]
    #[arg(long, value_name = "FILE")]
    robot: Option<PathBuf>,
    /// Controller of the robots, if it is known; it gives the free angles of sensors [default: straight ahead]
    #[arg(long, value_name = "NUMBERS")]
    controller: Option<String>,
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
            let read = self.robot.iter().chain([&self.film.tracks]);
            check_outputs([("--png", path)], read, self.overwrite)?;
        }
        // Without the file, nothing is started.
        let file = self.film.open()?;
        let find = async |connection: &mut Connection| self.find(connection, file).await;
        let recognised = connection::with(global, InProcess::NONE, find).await?;
        for note in recognised.assumed.notes() {
            errln!("{note}");
        }
        shown::show(&recognised, global.json)?;
        match &self.png {
            Some(path) => self.overwrite.write(path, row(&recognised)?),
            None => Ok(()),
        }
    }

    async fn find(
        &self,
        connection: &mut Connection,
        file: TracksFile<impl Read>,
    ) -> Result<Recognised, CliError> {
        let campaign = self.campaign(connection).await?;
        let is_complete = campaign.state() == v1::CampaignState::Completed;
        let spec = CampaignSpec::try_from(campaign.spec.unwrap_or_default())?;
        let (model, world) = self.robots(&spec)?;
        let steps = (spec.image().window() - 1).max(FEATURE_STEPS);
        // A campaign's picture covers at most the steps since the start of a swarm.
        let steps = steps.min(spec.world().horizon());
        let mut tracks = self.film.read(file, &world, steps)?;
        let (controller, world) = self.swarm(&model, world, &mut tracks)?;
        let filmed = self.film.scale(&world)?;
        let understood = tracks
            .understood(steps, &filmed)
            .map_err(|error| self.film.refused(error))?;
        let frames = tracks
            .ending(steps, &filmed)
            .map_err(|error| self.film.refused(error))?;
        let jumps = tracks
            .check_moves(&frames, &filmed, model.top_speed())
            .map_err(|error| self.film.refused(error))?;
        let compared = Compared {
            understood,
            axes: filmed.axes(),
            jumps,
            frame_time: self.film.frame_time(&world),
            scale: filmed.scale(),
            steps: frames.len() as u64 - 1,
            wanted: u64::from(steps),
            is_complete,
        };
        let assumed = Assumed::of(compared, &tracks, &controller, self.controller.is_some(), &spec);
        let named = |error| CliError::Input(format!("{}: {error}", self.film.tracks.display()));
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

    /// The campaign with which the swarm is compared.
    async fn campaign(&self, connection: &mut Connection) -> Result<v1::Campaign, CliError> {
        if let Some(campaign) = &self.campaign {
            return get_campaign(&mut connection.client, campaign).await;
        }
        let all = list_campaigns(&mut connection.client).await?;
        let is_complete = |campaign: &v1::Campaign| campaign.state() == v1::CampaignState::Completed;
        match all.into_iter().rev().find(is_complete) {
            Some(newest) => Ok(newest),
            None => get_campaign(&mut connection.client, "latest").await,
        }
    }

    /// The robots and their world: those of `--robot`, or else the campaign's.
    fn robots(&self, spec: &CampaignSpec) -> Result<(CapabilityModel, World), CliError> {
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
        Ok((model, world))
    }

    /// The swarm of the film, with the sensor angles of its controller, and its world.
    fn swarm(
        &self,
        model: &CapabilityModel,
        world: World,
        tracks: &mut Tracks,
    ) -> Result<(Controller, World), CliError> {
        if let Some(robots) = model.robots().filter(|&robots| robots != tracks.robots()) {
            return Err(CliError::Input(format!(
                "{}: there are {}, and the species have {robots} together",
                self.film.tracks.display(),
                counted(tracks.robots().into(), "robot")
            )));
        }
        let world = World::try_from(v1::World {
            agents: Some(tracks.robots()),
            radius: Some(model.largest_radius()),
            start: None,
            ..world.into()
        });
        let world =
            world.map_err(|error| CliError::Input(format!("{}: {error}", self.film.tracks.display())))?;
        let counts = tracks
            .order_by_species(model)
            .map_err(|error| self.film.refused(error))?;
        let controller = match &self.controller {
            Some(text) => controller::parse(text, Some(model))?,
            None => assumed::unknown(model, counts.as_deref())?,
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
