//! `atlas`: every controller of a space, evaluated and judged, as a table, a picture and a page.

use crate::{
    json,
    known_campaigns::{KnownCampaigns, stopped, to_rest},
};
use murmuration_cli::{
    CliError, Global, InProcessArgs,
    connection::{self, Connection},
    files::{expect_outside_data, replaces},
    follow::{Show, View},
    next_step, read_spec,
    validation::{self, get_campaign, get_digest},
};
use murmuration_files::{Folder, Replaces};
use murmuration_link::{errln, outln, termination};
use murmuration_model::CampaignId;
use murmuration_proto::v1;
use murmuration_report::atlas::{self, Atlas, AtlasEntry, Layout, Tiles};
use murmuration_search::filter::Score;
use murmuration_service::report_data;
use murmuration_swarm::{CampaignSpec, Controller, Invalid, counted};
use std::path::{Path, PathBuf};

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command runs the campaign of the file, or continues it, and writes atlas.csv and its README.md; where all controllers of four \
speeds were evaluated, also atlas.png, atlas-poster.svg, atlas-poster.png, atlas.html and the pictures of all swarms. docs/atlas.md says \
what they show.

Examples:
  murmuration lab atlas examples/atlas.toml --values 7        a coarse atlas, in seconds
  murmuration lab atlas examples/atlas.toml --out atlas       every controller of the paper's robot, in minutes
  murmuration lab atlas latest --out atlas                    the atlas of a campaign that there is")]
pub struct AtlasCommand {
    /// Campaign file with the method "exhaustive"; or the id of a campaign that has verdicts, or `latest`
    campaign: String,
    /// Folder for the atlas [default: atlases/CAMPAIGN in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Replace files of a former atlas in the folder even if they have been changed since
    #[arg(long)]
    force: bool,
    /// Number of values of each speed, used instead of the file's step: an odd number from 3 on
    #[arg(long, value_name = "N")]
    values: Option<u32>,
    #[command(flatten)]
    in_process: InProcessArgs,
}

/// The campaign that an atlas is made of.
enum Source {
    /// The specification in a campaign file. If a campaign has this specification already, the campaign continues.
    Spec(Box<CampaignSpec>),
    /// An existing campaign.
    Campaign(String),
}

impl AtlasCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let source = self.source()?;
        let in_process = self.in_process.some()?;
        if let Some(folder) = &self.out {
            expect_outside_data(folder)?;
            // Files that must not be replaced are found now, before hours of evaluations.
            drop(atlas::folder(folder, replaces(self.force))?);
        }
        let make = async |connection: &mut Connection| {
            let begun = match source {
                Source::Spec(spec) => {
                    let mut known = KnownCampaigns::default();
                    known.find_or_begin(&mut connection.client, &spec, "").await?
                }
                Source::Campaign(campaign) => {
                    let campaign = get_campaign(&mut connection.client, campaign).await?;
                    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
                    check(&spec, &format!("campaign {}", campaign.id))?;
                    campaign
                }
            };
            let made = async {
                let done = finish(connection, global, begun).await?;
                self.write(connection, global, &done).await
            };
            tokio::select! {
                made = made => made,
                signal = termination() => Err(CliError::Failed(format!(
                    "{signal}; complete generations are kept, and the same command continues with them"
                ))),
            }
        };
        let made = match self.is_file() {
            true => connection::with_new(global, in_process, make).await?,
            false => connection::with(global, in_process, make).await?,
        };
        let path = made.atlas.clone();
        if global.json {
            return Ok(json::print(made)?);
        }
        outln!("campaign  {}", made.campaign)?;
        outln!("digest    {}", made.digest)?;
        Ok(outln!("atlas     {path}")?)
    }

    /// Whether the argument is a file. A campaign's id has no dot and no slash.
    fn is_file(&self) -> bool {
        self.campaign.contains(['.', '/'])
    }

    fn source(&self) -> Result<Source, CliError> {
        if !self.is_file() {
            if self.values.is_some() {
                let message = "--values: the campaign is there already; name a campaign file";
                return Err(CliError::Input(message.to_owned()));
            }
            return Ok(Source::Campaign(self.campaign.clone()));
        }
        let spec = read_spec(Path::new(&self.campaign), None)?;
        let spec = match self.values {
            Some(values) => with_values(&spec, values)?,
            None => spec,
        };
        check(&spec, &self.campaign)?;
        Ok(Source::Spec(Box::new(spec)))
    }

    /// Writes the atlas of a completed campaign.
    async fn write(
        &self,
        connection: &mut Connection,
        global: &Global,
        campaign: &v1::Campaign,
    ) -> Result<json::Atlas, CliError> {
        let id = validation::id(campaign)?;
        let (folder, replaces) = match &self.out {
            Some(folder) => (folder.clone(), replaces(self.force)),
            None => (atlas_folder(&global.data, &id), Replaces::All),
        };
        let mut folder = atlas::folder(&folder, replaces)?;
        let atlas = gather(connection, campaign, &mut folder).await?;
        let (digest, controllers) = (atlas.digest.clone(), atlas.entries.len() as u64);
        let write = move || atlas::write(&atlas, folder);
        let Ok(files) = tokio::task::spawn_blocking(write).await else {
            let message = "the atlas could not be written because of a bug";
            return Err(CliError::Failed(message.to_owned()));
        };
        Ok(json::Atlas {
            campaign: campaign.id.clone(),
            digest,
            atlas: files?.page.display().to_string(),
            controllers,
        })
    }
}

/// The folder in which `murmuration` keeps the atlas of a campaign.
fn atlas_folder(data: &Path, campaign: &CampaignId) -> PathBuf {
    data.join("atlases").join(campaign.as_str())
}

/// The specification with a grid that has `values` values of each speed.
fn with_values(spec: &CampaignSpec, values: u32) -> Result<CampaignSpec, CliError> {
    if values < 3 || values.is_multiple_of(2) {
        let text = format!(
            "--values {values}: must be an odd number from 3 on, so that a speed of 0 is among the values"
        );
        return Err(CliError::Input(text));
    }
    let mut message = v1::CampaignSpec::from(spec);
    let controllers = message.controllers.get_or_insert_default();
    controllers.step = Some(2.0 / f64::from(values - 1));
    let search = message.search.get_or_insert_default();
    (search.population, search.generations) = (None, None);
    Ok(message.try_into()?)
}

/// Refuses a specification whose trials are not judged.
fn check(spec: &CampaignSpec, of: &str) -> Result<(), CliError> {
    if spec.judges() {
        return Ok(());
    }
    Err(CliError::Input(format!(
        "{of} has no verdicts to make an atlas of: its file needs method = \"exhaustive\", or judge = true in [evaluation]"
    )))
}

/// Waits until the campaign is completed, and resumes it if necessary.
async fn finish(
    connection: &mut Connection,
    global: &Global,
    begun: v1::Campaign,
) -> Result<v1::Campaign, CliError> {
    errln!(
        "campaign {} · {} of {}",
        begun.id,
        counted(begun.generations_done.into(), "generation"),
        begun.generations
    );
    let mut view = View::new(Show::Person);
    let last = to_rest(&mut connection.client, begun, |status| view.draw(status)).await;
    view.end();
    let last = last?;
    match last.state() {
        v1::CampaignState::Completed => Ok(last),
        v1::CampaignState::Failed => Err(next_step::failed(global, &last)),
        _ => {
            let next = next_step::what_next(global, &last);
            Err(CliError::Failed(format!("{}; {next}", stopped(&last))))
        }
    }
}

/// Collects the archive of a campaign. Writes the pictures of its swarms into `folder` as they arrive, since all pictures
/// together may not fit in memory.
async fn gather(
    connection: &mut Connection,
    campaign: &v1::Campaign,
    folder: &mut Folder,
) -> Result<Atlas, CliError> {
    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
    let digest = get_digest(&mut connection.client, &campaign.id).await?.digest;
    let layout = Layout::of(&spec);
    let request = v1::GetArchiveRequest {
        campaign: campaign.id.clone(),
        images: layout.is_some(),
    };
    let mut chunks = connection.client.get_archive(request).await?.into_inner();
    let mut tiles = layout.map(|layout| Tiles::new(layout, spec.image().shape()));
    let listed = spec.enumeration();
    let mut entries = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals {
            let entry = entry(&spec, &individual)?;
            // The substitute for a controller with a poisoned task is not in the ordered list, and has no position in a tile.
            let is_listed = listed.is_some_and(|all| {
                individual.index < all.len() && all.controller(individual.index) == entry.controller
            });
            if let (Some(tiles), Some(image), true) = (&mut tiles, &individual.image, is_listed) {
                tiles.add(folder, &entry.controller, image)?;
            }
            entries.push(entry);
        }
    }
    if let Some(tiles) = tiles {
        tiles.finish(folder)?;
    }
    Ok(Atlas {
        campaign: campaign.id.clone(),
        digest,
        spec,
        entries,
    })
}

fn entry(spec: &CampaignSpec, individual: &v1::Individual) -> Result<AtlasEntry, Invalid> {
    let controller = Controller::new(spec.model(), &individual.controller)?;
    Ok(AtlasEntry {
        score: Score::of(&controller).total(),
        controller,
        seed: individual.seed,
        verdicts: report_data::verdicts_of(spec, individual)?,
        features: report_data::features(&individual.features)?,
    })
}
