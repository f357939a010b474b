//! `submit`, `watch`, `list`, `show`, `pause`, `cancel`, `digest`: campaigns of some coordinator.

use super::{
    CliError, Global,
    connection::{Client, Connection},
    follow::{Show as FollowShow, follow},
    json,
    run::{CrewSize, read_spec},
};
use crate::{campaign::Weight, local::Crew};
use murmuration_proto::{CampaignSpec, Controller, FEATURE_NAMES, v1};
use std::path::PathBuf;
use tonic::Status;

/// A campaign's name on the command line.
#[derive(Debug, clap::Args)]
pub(super) struct Name {
    /// Campaign id, or `latest`
    pub(super) campaign: String,
}

/// Arguments of `submit`.
#[derive(Debug, clap::Args)]
pub(super) struct Submit {
    /// Campaign file (see examples/)
    spec: PathBuf,
    /// Seed instead of the file's, of its training too
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Its share of the workers while other campaigns run as well, in proportion to theirs: 1 to 10,000
    #[arg(long, value_name = "N", default_value_t)]
    weight: Weight,
}

/// Arguments of `adopt`.
#[derive(Debug, clap::Args)]
pub(super) struct Adopt {
    /// Campaign id, or `latest`
    campaign: String,
    /// Digest of a stored checkpoint, or enough of its beginning
    checkpoint: String,
}

/// Arguments of `refine`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The embedder is fine-tuned on the classes that people (or `label --synthetic`) gave, the archive moves to it, and the
search goes on for as many generations as the campaign's `feedback.generations` says. Repeat it as often as you like.

Example:
  murmuration label latest --csv my.csv --annotator ana && murmuration refine latest")]
pub(super) struct Refine {
    /// Campaign id, or `latest`
    campaign: String,
}

/// Arguments of `show`.
#[derive(Debug, clap::Args)]
pub(super) struct Show {
    /// Campaign id, or `latest`
    campaign: String,
    /// Show this individual of its archive instead
    #[arg(long, value_name = "I")]
    index: Option<u64>,
}

impl Submit {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let spec = read_spec(&self.spec, self.seed)?;
        let mut connection = Connection::open(global, Crew::NONE).await?;
        if connection.is_own() {
            connection.close().await?;
            let said = "no coordinator is running: start `murmuration serve`, or use `murmuration run`";
            return Err(CliError::Failed(said.to_owned()));
        }
        let request = v1::CreateCampaignRequest {
            spec: Some((&spec).into()),
            weight: Some(self.weight.get()),
        };
        let campaign = connection.client.create_campaign(request).await?.into_inner();
        changed(
            global,
            &campaign,
            "submitted",
            &format!("murmuration watch {}", campaign.id),
        );
        Ok(())
    }
}

impl Adopt {
    /// Has a campaign move to another checkpoint; where this process runs the coordinator, to the end.
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, CrewSize::default().count()).await?;
        let checkpoint = super::checkpoints::find(&mut connection.checkpoints, &self.checkpoint).await?;
        let request = v1::AdoptCheckpointRequest {
            campaign: self.campaign,
            checkpoint: checkpoint.digest,
        };
        let campaign = connection.client.adopt_checkpoint(request).await?.into_inner();
        if connection.is_own() {
            return super::run::to_report(connection, global, &campaign.id).await;
        }
        let next = format!("murmuration watch {}", campaign.id);
        changed(global, &campaign, "moves to that checkpoint", &next);
        Ok(())
    }
}

impl Refine {
    /// Begins a round of feedback; where this process runs the coordinator, to the end.
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, CrewSize::default().count()).await?;
        let request = v1::RefineCampaignRequest {
            campaign: self.campaign,
        };
        let refined = connection.client.refine_campaign(request).await;
        if connection.is_own() {
            return match refined {
                Ok(campaign) => super::run::to_report(connection, global, &campaign.get_ref().id).await,
                Err(status) => {
                    connection.close().await?;
                    Err(status.into())
                }
            };
        }
        let campaign = refined?.into_inner();
        let next = format!("murmuration watch {}", campaign.id);
        changed(global, &campaign, "learns from its labels", &next);
        Ok(())
    }
}

/// Tells what a command changed, and what to type next.
pub(super) fn changed(global: &Global, campaign: &v1::Campaign, what: &str, next: &str) {
    if global.json {
        json::print(&json::campaign(campaign));
    } else {
        println!("{}", campaign.id);
        eprintln!("campaign {} {what}; next: {next}", campaign.id);
    }
}

pub(super) async fn watch(global: &Global, campaign: &str) -> Result<(), CliError> {
    let mut connection = Connection::open(global, Crew::NONE).await?;
    let show = if global.json {
        FollowShow::Lines
    } else {
        FollowShow::Person
    };
    let last = follow(&mut connection.client, campaign, show).await;
    let own = connection.is_own();
    connection.close().await?;
    let last = last?;
    match last.state() {
        v1::CampaignState::Failed => Err(CliError::Failed(format!("campaign {}: {}", last.id, last.error))),
        v1::CampaignState::Running if own => {
            let said = format!(
                "campaign {} was interrupted: `murmuration resume {}`",
                last.id, last.id
            );
            Err(CliError::Failed(said))
        }
        _ => {
            eprintln!("campaign {} is {}", last.id, state(&last));
            Ok(())
        }
    }
}

pub(super) async fn list(global: &Global) -> Result<(), CliError> {
    let mut connection = Connection::open(global, Crew::NONE).await?;
    let listed = connection
        .client
        .list_campaigns(v1::ListCampaignsRequest {})
        .await;
    connection.close().await?;
    let campaigns = listed?.into_inner().campaigns;
    if global.json {
        campaigns
            .iter()
            .map(json::campaign)
            .for_each(|campaign| json::print(&campaign));
        return Ok(());
    }
    println!(
        "{:<28} {:<12} {:<9} {:>13} {:<13} {:<13}",
        "CAMPAIGN", "STATE", "STAGE", "GENERATIONS", "MODEL", "METHOD"
    );
    for campaign in campaigns {
        let Some(Ok(spec)) = campaign.spec.clone().map(CampaignSpec::try_from) else {
            continue;
        };
        let progress = format!("{}/{}", campaign.generations_done, campaign.generations);
        println!(
            "{:<28} {:<12} {:<9} {progress:>13} {:<13} {:<13}",
            campaign.id,
            state(&campaign),
            stage(&campaign),
            spec.model().name(),
            spec.method().name(),
        );
    }
    Ok(())
}

/// The stage in a word, of a campaign that has not ended.
fn stage(campaign: &v1::Campaign) -> &'static str {
    match campaign.state() {
        v1::CampaignState::Completed | v1::CampaignState::Cancelled => "-",
        _ => super::follow::stage_name(campaign.stage()),
    }
}

/// The state in a word; a running campaign that nobody works on was interrupted, one whose disk is full waits.
fn state(campaign: &v1::Campaign) -> String {
    match campaign.state() {
        v1::CampaignState::Running if !campaign.waiting.is_empty() => "waiting".to_owned(),
        v1::CampaignState::Running if !campaign.active => "interrupted".to_owned(),
        state => state
            .as_str_name()
            .trim_start_matches("CAMPAIGN_STATE_")
            .to_lowercase(),
    }
}

impl Show {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(global, Crew::NONE).await?;
        let request = v1::GetCampaignRequest {
            campaign: self.campaign,
        };
        let campaign = connection.client.get_campaign(request).await;
        let individual = match (&campaign, self.index) {
            (Ok(campaign), Some(index)) => {
                let request = v1::GetIndividualRequest {
                    campaign: campaign.get_ref().id.clone(),
                    index,
                };
                Some(connection.client.get_individual(request).await)
            }
            _ => None,
        };
        connection.close().await?;
        let campaign = campaign?.into_inner();
        match individual {
            Some(individual) => show_individual(global, &campaign, &individual?.into_inner()),
            None => show_campaign(global, &campaign),
        }
    }
}

fn show_campaign(global: &Global, campaign: &v1::Campaign) -> Result<(), CliError> {
    if global.json {
        json::print(&json::campaign(campaign));
        return Ok(());
    }
    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
    println!(
        "# {} is {} (stage: {})",
        campaign.id,
        state(campaign),
        stage(campaign)
    );
    for said in [&campaign.error, &campaign.waiting] {
        if !said.is_empty() {
            println!("# {said}");
        }
    }
    println!(
        "# {} of {} generations are complete",
        campaign.generations_done, campaign.generations
    );
    if !campaign.checkpoint.is_empty() {
        println!("# embedded by checkpoint {}", campaign.checkpoint);
    }
    print!("{}", spec.to_toml());
    Ok(())
}

fn show_individual(
    global: &Global,
    campaign: &v1::Campaign,
    individual: &v1::Individual,
) -> Result<(), CliError> {
    if global.json {
        json::print(&json::individual(individual));
        return Ok(());
    }
    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
    let controller = Controller::new(spec.model(), &individual.controller)?;
    println!(
        "individual  {} of {} (generation {})",
        individual.index, campaign.id, individual.generation
    );
    println!("controller  {controller}");
    println!("seed        {}", individual.seed);
    println!("novelty     {}", individual.novelty);
    for (name, value) in FEATURE_NAMES.iter().zip(&individual.features) {
        println!("{name:<20} {value}");
    }
    Ok(())
}

pub(super) async fn pause(global: &Global, campaign: &str) -> Result<(), CliError> {
    let mut connection = Connection::open(global, Crew::NONE).await?;
    let request = v1::PauseCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let paused = connection.client.pause_campaign(request).await;
    connection.close().await?;
    let campaign = paused?.into_inner();
    changed(
        global,
        &campaign,
        "is paused",
        &format!("murmuration resume {}", campaign.id),
    );
    Ok(())
}

pub(super) async fn cancel(global: &Global, campaign: &str) -> Result<(), CliError> {
    let mut connection = Connection::open(global, Crew::NONE).await?;
    let request = v1::CancelCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let cancelled = connection.client.cancel_campaign(request).await;
    connection.close().await?;
    changed(
        global,
        &cancelled?.into_inner(),
        "is cancelled",
        "murmuration list",
    );
    Ok(())
}

pub(super) async fn digest(global: &Global, campaign: &str) -> Result<(), CliError> {
    let mut connection = Connection::open(global, Crew::NONE).await?;
    let answer = id_and_digest(&mut connection.client, campaign).await;
    connection.close().await?;
    let (id, digest) = answer?;
    if global.json {
        json::print(&json::digest(&id, &digest));
    } else {
        println!("{}", digest.digest);
    }
    Ok(())
}

/// The id behind a name such as `latest`, and the digest.
async fn id_and_digest(
    client: &mut Client,
    campaign: &str,
) -> Result<(String, v1::GetDigestResponse), Status> {
    let request = v1::GetCampaignRequest {
        campaign: campaign.to_owned(),
    };
    let id = client.get_campaign(request).await?.into_inner().id;
    let request = v1::GetDigestRequest { campaign: id.clone() };
    Ok((id, client.get_digest(request).await?.into_inner()))
}
