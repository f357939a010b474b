//! `submit`, `watch`, `list`, `show`, `pause`, `cancel`, `digest`: campaigns of a coordinator.

use super::{
    CliError, Global,
    connection::{self, Connection},
    follow::{Show as FollowShow, follow},
    json,
    next_step::{changed, failed, state, what_next},
    run::{InProcessArgs, go_on, read_spec},
    table::{Table, left, right},
    taxonomy,
    validation::{get_campaign, get_digest, list_campaigns, validated},
};
use murmuration_coordinator::local::InProcess;
use murmuration_link::{errln, outln, print};
use murmuration_model::{Tag, Weight, generations_in_words};
use murmuration_proto::v1;
use murmuration_swarm::{CampaignSpec, Controller, FEATURE_NAMES, counted, grouped, in_full};
use std::{collections::BTreeMap, path::PathBuf};

#[derive(Debug, clap::Args)]
pub struct Name {
    /// Campaign id, or `latest`
    pub(super) campaign: String,
}

#[derive(Debug, clap::Args)]
pub struct Submit {
    /// Campaign file (see examples/)
    spec: PathBuf,
    /// Seed of the search and the training, used instead of the file's seed
    #[arg(long, value_name = "N")]
    seed: Option<u64>,
    /// Share of the workers relative to other running campaigns, 1 to 10,000
    #[arg(long, value_name = "N", default_value_t)]
    weight: Weight,
}

#[derive(Debug, clap::Args)]
pub struct List {
    /// List the campaigns of studies too
    #[arg(long)]
    studies: bool,
    /// List only the campaigns with this tag, those of studies too
    #[arg(long, value_name = "TAG")]
    tag: Option<Tag>,
}

#[derive(Debug, clap::Args)]
pub struct Adopt {
    /// Campaign id, or `latest`
    campaign: String,
    /// Digest of a stored checkpoint, or its first digits
    checkpoint: String,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The command fine-tunes the embedder on the campaign's labels, embeds the archive with it, and continues the search for \
`feedback.generations` generations. Repeat it as often as you like.

Example:
  murmuration label latest --csv my.csv --annotator ana && murmuration refine latest")]
pub struct Refine {
    /// Campaign id, or `latest`
    campaign: String,
}

#[derive(Debug, clap::Args)]
#[command(after_help = "\
The archive becomes that of a campaign that asked for so many generations from the start, with the same digest, \
unless the campaign has adopted another checkpoint. The campaign gets a new taxonomy; the former one stays in its history. A campaign \
that has learned from feedback searches on with `refine`.

Example:
  murmuration extend latest --generations 200")]
pub struct Extend {
    /// Campaign id, or `latest`
    campaign: String,
    /// New number of generations, more than the campaign has
    #[arg(long, value_name = "N")]
    generations: u32,
}

#[derive(Debug, clap::Args)]
pub struct Show {
    /// Campaign id, or `latest`
    campaign: String,
    /// Show this individual of the archive instead of the campaign
    #[arg(long, value_name = "I")]
    index: Option<u64>,
    /// Show the clusters of the taxonomy and their names instead of the campaign
    #[arg(long, conflicts_with = "index")]
    taxonomy: bool,
}

#[derive(Debug, clap::Args)]
pub struct Digest {
    /// Campaign id, or `latest`
    campaign: String,
    /// Print the digest of the archive so far if the campaign has not completed
    #[arg(long)]
    partial: bool,
}

/// The output of `show`.
enum Shown {
    Campaign(v1::Campaign),
    Individual(v1::Campaign, v1::Individual),
    Taxonomy(v1::Campaign, v1::Taxonomy),
}

impl Submit {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let spec = read_spec(&self.spec, self.seed)?;
        let submit = async |connection: &mut Connection| {
            if connection.is_own() {
                let message = "no coordinator runs over this data directory: start `murmuration serve`, or use `murmuration run`";
                return Err(CliError::Failed(message.to_owned()));
            }
            let request = v1::CreateCampaignRequest {
                campaign: Some(v1::create_campaign_request::Campaign::Spec((&spec).into())),
                weight: Some(self.weight.get()),
                ..v1::CreateCampaignRequest::default()
            };
            validated(connection.client.create_campaign(request).await?)
        };
        let campaign = connection::with(global, InProcess::NONE, submit).await?;
        let next = format!("watch {}", campaign.id);
        Ok(changed(global, &campaign, campaign.state(), "submitted", &next)?)
    }
}

impl Adopt {
    /// Moves a campaign to another checkpoint. If this process runs the coordinator, it continues the campaign to its end.
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let adopt = async |connection: &mut Connection| {
            let checkpoint = super::checkpoints::find(&mut connection.checkpoints, &self.checkpoint).await?;
            let request = v1::AdoptCheckpointRequest {
                campaign: self.campaign,
                checkpoint: checkpoint.digest,
            };
            validated(connection.client.adopt_checkpoint(request).await?)
        };
        go_on(
            global,
            InProcessArgs::default().count()?,
            "moves to the checkpoint",
            adopt,
        )
        .await
    }
}

impl Refine {
    /// Begins a round of feedback. If this process runs the coordinator, it continues the campaign to its end.
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let refine = async |connection: &mut Connection| {
            let request = v1::RefineCampaignRequest {
                campaign: self.campaign,
            };
            validated(connection.client.refine_campaign(request).await?)
        };
        go_on(
            global,
            InProcessArgs::default().count()?,
            "learns from its labels",
            refine,
        )
        .await
    }
}

impl Extend {
    /// Continues the search of a completed campaign. If this process runs the coordinator, it continues the campaign to its end.
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let extend = async |connection: &mut Connection| {
            let request = v1::ExtendCampaignRequest {
                campaign: self.campaign,
                generations: self.generations,
            };
            validated(connection.client.extend_campaign(request).await?)
        };
        go_on(global, InProcessArgs::default().count()?, "searches on", extend).await
    }
}

pub(super) async fn watch(global: &Global, campaign: &str) -> Result<(), CliError> {
    let show = if global.json {
        FollowShow::Lines
    } else {
        FollowShow::Person
    };
    let watch = async |connection: &mut Connection| {
        let last = follow(&mut connection.client, campaign, show).await?;
        Ok((last, connection.is_own()))
    };
    let (last, own) = connection::with(global, InProcess::NONE, watch).await?;
    match last.state() {
        v1::CampaignState::Failed => Err(failed(global, &last)),
        v1::CampaignState::Running if own => {
            let next = what_next(global, &last);
            Err(CliError::Failed(format!(
                "campaign {} was interrupted; {next}",
                last.id
            )))
        }
        _ => {
            let next = what_next(global, &last);
            errln!("campaign {} is {}; {next}", last.id, state(&last));
            Ok(())
        }
    }
}

impl List {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut campaigns = listed(global).await?;
        if let Some(tag) = &self.tag {
            campaigns.retain(|campaign| campaign.tags.iter().any(|own| own == tag.as_str()));
        }
        if global.json {
            return Ok(json::print_all(campaigns.iter().map(json::Document))?);
        }
        show_list(global, campaigns, self.studies || self.tag.is_some())
    }
}

async fn listed(global: &Global) -> Result<Vec<v1::Campaign>, CliError> {
    let list = async |connection: &mut Connection| list_campaigns(&mut connection.client).await;
    connection::with(global, InProcess::NONE, list).await
}

/// Prints the campaigns as a table, with a column of tags if any campaign has one. Without `studies`, the table lacks the campaigns
/// of studies, and their number follows it.
fn show_list(global: &Global, campaigns: Vec<v1::Campaign>, studies: bool) -> Result<(), CliError> {
    let mut folded: BTreeMap<String, u64> = BTreeMap::new();
    let has_tags = campaigns.iter().any(|campaign| !campaign.tags.is_empty());
    let columns = [
        left("CAMPAIGN"),
        left("STATE"),
        left("STAGE"),
        right("GENERATIONS"),
        left("MODEL"),
        left("METHOD"),
    ];
    let mut table = Table::new(columns.into_iter().chain(has_tags.then(|| left("TAGS"))));
    for campaign in campaigns {
        if !studies && !campaign.study.is_empty() {
            *folded.entry(campaign.study).or_default() += 1;
            continue;
        }
        let Some(Ok(spec)) = campaign.spec.clone().map(CampaignSpec::try_from) else {
            continue;
        };
        let [done, all] =
            [campaign.generations_done, campaign.generations].map(|count| grouped(count.into()));
        let cells = [
            campaign.id.clone(),
            state(&campaign),
            stage(&campaign).unwrap_or("-").to_owned(),
            format!("{done}/{all}"),
            spec.model().to_string(),
            spec.method().name().to_owned(),
        ];
        let tags = has_tags.then(|| campaign.tags.join(" "));
        table.row(cells.into_iter().chain(tags));
    }
    table.print()?;
    for (study, count) in folded {
        let next = global.next("list --studies");
        errln!("and {} of study {study}: {next}", counted(count, "campaign"));
    }
    Ok(())
}

/// The name of a campaign's stage; `None` if the campaign has ended.
fn stage(campaign: &v1::Campaign) -> Option<&'static str> {
    match campaign.state() {
        v1::CampaignState::Completed | v1::CampaignState::Cancelled => None,
        _ => Some(super::follow::stage_name(campaign.stage())),
    }
}

impl Show {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let get = async |connection: &mut Connection| {
            let campaign = get_campaign(&mut connection.client, self.campaign).await?;
            if self.taxonomy {
                let found = taxonomy::of(connection, &campaign.id).await?;
                return Ok(Shown::Taxonomy(campaign, found));
            }
            let Some(index) = self.index else {
                return Ok(Shown::Campaign(campaign));
            };
            let request = v1::GetIndividualRequest {
                campaign: campaign.id.clone(),
                index,
            };
            let individual = connection.client.get_individual(request).await?.into_inner();
            Ok(Shown::Individual(campaign, individual))
        };
        match connection::with(global, InProcess::NONE, get).await? {
            Shown::Campaign(campaign) => show_campaign(global, &campaign),
            Shown::Individual(campaign, individual) => show_individual(global, &campaign, &individual),
            Shown::Taxonomy(campaign, found) => taxonomy::show(global, &campaign.id, &found),
        }
    }
}

fn show_campaign(global: &Global, campaign: &v1::Campaign) -> Result<(), CliError> {
    if global.json {
        json::print(json::Document(campaign))?;
        return Ok(());
    }
    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
    let stage = stage(campaign).map_or_else(String::new, |stage| format!(" (stage: {stage})"));
    outln!("# {} is {}{stage}", campaign.id, state(campaign))?;
    for expected in [&campaign.error, &campaign.waiting] {
        if !expected.is_empty() {
            outln!("# {expected}")?;
        }
    }
    let why = generations_in_words(&spec, campaign.generations, campaign.rounds_done);
    outln!(
        "# {} of {} complete{}",
        grouped(campaign.generations_done.into()),
        counted(campaign.generations.into(), "generation"),
        why.map_or_else(String::new, |why| format!(": {why}"))
    )?;
    if !campaign.checkpoint.is_empty() {
        outln!("# embedded by checkpoint {}", campaign.checkpoint)?;
    }
    if !campaign.tags.is_empty() {
        outln!("# tags: {}", campaign.tags.join(" "))?;
    }
    for line in campaign.note.lines() {
        outln!("# {line}")?;
    }
    Ok(print(spec.to_toml())?)
}

fn show_individual(
    global: &Global,
    campaign: &v1::Campaign,
    individual: &v1::Individual,
) -> Result<(), CliError> {
    if global.json {
        json::print(json::Document(individual))?;
        return Ok(());
    }
    let spec = CampaignSpec::try_from(campaign.spec.clone().unwrap_or_default())?;
    let controller = Controller::new(spec.model(), &individual.controller)?;
    outln!(
        "individual  {} of {} (generation {})",
        individual.index,
        campaign.id,
        individual.generation
    )?;
    outln!("controller  {controller}")?;
    outln!("seed        {}", individual.seed)?;
    let novelty = [("novelty when evaluated", &individual.novelty)];
    let features = FEATURE_NAMES.iter().copied().zip(&individual.features);
    for (name, value) in novelty.into_iter().chain(features) {
        outln!("{name:<22} {}", in_full(*value))?;
    }
    if !individual.trials.is_empty() {
        let trials = counted(individual.trials.len() as u64, "trial");
        outln!("features are means over {trials}, from starts with the seeds")?;
        for trial in &individual.trials {
            outln!("  {}", trial.seed)?;
        }
    }
    Ok(())
}

pub(super) async fn pause(global: &Global, campaign: &str) -> Result<(), CliError> {
    let pause = async |connection: &mut Connection| {
        let request = v1::PauseCampaignRequest {
            campaign: campaign.to_owned(),
        };
        validated(connection.client.pause_campaign(request).await?)
    };
    let campaign = connection::with(global, InProcess::NONE, pause).await?;
    let next = format!("resume {}", campaign.id);
    let paused = v1::CampaignState::Paused;
    Ok(changed(global, &campaign, paused, "is paused", &next)?)
}

pub(super) async fn cancel(global: &Global, campaign: &str) -> Result<(), CliError> {
    let cancel = async |connection: &mut Connection| {
        let request = v1::CancelCampaignRequest {
            campaign: campaign.to_owned(),
        };
        validated(connection.client.cancel_campaign(request).await?)
    };
    let campaign = connection::with(global, InProcess::NONE, cancel).await?;
    let cancelled = v1::CampaignState::Cancelled;
    Ok(changed(global, &campaign, cancelled, "is cancelled", "list")?)
}

impl Digest {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let answer = async |connection: &mut Connection| {
            let campaign = get_campaign(&mut connection.client, self.campaign.as_str()).await?;
            if campaign.state() != v1::CampaignState::Completed && !self.partial {
                let (id, state) = (&campaign.id, state(&campaign));
                let next = global.next(&format!("digest {id} --partial"));
                return Err(CliError::Failed(format!(
                    "campaign {id} is {state}, so its archive is not complete; for the digest of the archive so far: {next}"
                )));
            }
            let digest = get_digest(&mut connection.client, campaign.id.as_str()).await?;
            Ok((campaign, digest))
        };
        let (campaign, digest) = connection::with(global, InProcess::NONE, answer).await?;
        let complete = campaign.state() == v1::CampaignState::Completed;
        if global.json {
            json::print(json::Digest {
                campaign: &campaign.id,
                complete,
                digest: json::Document(&digest),
            })?;
        } else {
            outln!("{}", digest.digest)?;
        }
        if !complete {
            errln!(
                "campaign {} is {}: this is the digest of the {} that its archive has so far",
                campaign.id,
                state(&campaign),
                counted(digest.evaluations, "evaluation")
            );
        }
        Ok(())
    }
}
