//! `report`: gathers what the report shows from the coordinator, and has it written.

use super::{
    CliError, Global,
    connection::{Client, Connection},
    error::report_folder,
};
use crate::{
    local::Crew,
    novelty::Behaviours,
    projection,
    report::{self, Entry, GenerationSummary, Map, MedoidEntry, Report},
};
use murmuration_proto::{
    CampaignSpec, CapabilityModel, Controller, Features, Invalid, Method, Replay, SIMULATOR_VERSION, v1,
};
use std::path::{Path, PathBuf};

/// Frames of a replay in a report, about.
const FRAMES: u32 = 400;

/// Arguments of `report`.
#[derive(Debug, clap::Args)]
pub(super) struct ReportCommand {
    /// Campaign id, or `latest`
    campaign: String,
    /// Folder to write it to [default: reports/CAMPAIGN in the data directory]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl ReportCommand {
    pub(super) async fn execute(self, global: &Global) -> Result<(), CliError> {
        let mut connection = Connection::open(
            global,
            Crew {
                workers: 1,
                trainers: 0,
            },
        )
        .await?;
        let written = self.write(&mut connection.client, global).await;
        connection.close().await?;
        let page = written?.display().to_string();
        if global.json {
            super::json::print(&serde_json::json!({ "schema": 1, "report": page }));
        } else {
            println!("{page}");
        }
        Ok(())
    }

    async fn write(&self, client: &mut Client, global: &Global) -> Result<PathBuf, CliError> {
        let request = v1::GetCampaignRequest {
            campaign: self.campaign.clone(),
        };
        let id = client.get_campaign(request).await?.into_inner().id;
        let folder = self
            .out
            .clone()
            .unwrap_or_else(|| report_folder(&global.data, &id));
        write_report(client, &id, &folder).await
    }
}

/// Writes the report of a completed campaign into `folder`; the path of its page.
pub(super) async fn write_report(
    client: &mut Client,
    campaign: &str,
    folder: &Path,
) -> Result<PathBuf, CliError> {
    let report = gather(client, campaign).await?;
    let folder = folder.to_owned();
    let written = tokio::task::spawn_blocking(move || report::write(&report, &folder)).await;
    match written {
        Ok(files) => Ok(files?.page),
        Err(_) => Err(CliError::Failed(
            "the report broke off unexpectedly (this is a bug)".to_owned(),
        )),
    }
}

async fn gather(client: &mut Client, campaign: &str) -> Result<Report, CliError> {
    let id = || campaign.to_owned();
    let status = client
        .get_campaign(v1::GetCampaignRequest { campaign: id() })
        .await?
        .into_inner();
    let spec = CampaignSpec::try_from(status.spec.unwrap_or_default())?;
    let taxonomy = client
        .get_taxonomy(v1::GetTaxonomyRequest { campaign: id() })
        .await?
        .into_inner();
    let digest = client
        .get_digest(v1::GetDigestRequest { campaign: id() })
        .await?
        .into_inner();
    let generations = client
        .list_generations(v1::ListGenerationsRequest { campaign: id() })
        .await?
        .into_inner();
    let individuals = archive(client, campaign, spec.model()).await?;
    let stride = spec.world().horizon().div_ceil(FRAMES).max(1);
    let mut medoids = Vec::with_capacity(taxonomy.medoids.len());
    for medoid in taxonomy.medoids {
        let individual = medoid.individual.unwrap_or_default();
        let request = v1::GetReplayRequest {
            campaign: id(),
            index: individual.index,
            stride,
        };
        let replay = client.get_replay(request).await?.into_inner();
        medoids.push(MedoidEntry {
            index: individual.index,
            image: individual.image.unwrap_or_default(),
            cluster_size: medoid.cluster_size,
            mean_distance: medoid.mean_distance,
            replay: Replay::try_from(replay)?,
        });
    }
    Ok(Report {
        campaign: id(),
        digest: digest.digest,
        checkpoint: status.checkpoint,
        created_ms: status.created_ms,
        simulator_version: SIMULATOR_VERSION.to_owned(),
        generations: generations.generations.into_iter().map(generation).collect(),
        map: map(&individuals, spec.method())?,
        individuals,
        medoids,
        clusters: taxonomy.clusters,
        loss: taxonomy.loss,
        spec,
    })
}

async fn archive(
    client: &mut Client,
    campaign: &str,
    model: CapabilityModel,
) -> Result<Vec<Entry>, CliError> {
    let request = v1::GetArchiveRequest {
        campaign: campaign.to_owned(),
        images: false,
    };
    let mut chunks = client.get_archive(request).await?.into_inner();
    let mut entries = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        for individual in chunk.individuals {
            entries.push(entry(&individual, model)?);
        }
    }
    Ok(entries)
}

fn entry(individual: &v1::Individual, model: CapabilityModel) -> Result<Entry, Invalid> {
    Ok(Entry {
        generation: individual.generation,
        controller: Controller::new(model, &individual.controller)?,
        seed: individual.seed,
        features: Features::try_from(individual.features.as_slice()).map_err(|_| {
            Invalid::new(
                "features",
                format!("{} values", individual.features.len()),
                "5 values",
            )
        })?,
        embedding: individual.embedding.clone(),
        novelty: individual.novelty,
    })
}

fn generation(summary: v1::GenerationSummary) -> GenerationSummary {
    GenerationSummary {
        generation: summary.generation,
        best_novelty: summary.best_novelty,
        mean_novelty: summary.mean_novelty,
        filtered: summary.filtered,
    }
}

/// The behaviour space along its two principal axes.
fn map(individuals: &[Entry], method: Method) -> Result<Map, CliError> {
    let behaviour = |entry: &Entry| method.behaviour(&entry.features, &entry.embedding);
    let mut behaviours = Behaviours::new(individuals.first().map_or(0, |first| behaviour(first).len()));
    for entry in individuals {
        behaviours
            .push(&behaviour(entry))
            .map_err(|error| CliError::Failed(error.to_string()))?;
    }
    let projection = projection::principal_axes(&behaviours);
    let title = |axis: usize| {
        let share = 100.0 * projection.shares[axis];
        format!("principal axis {} ({share:.0}% of the variance)", axis + 1)
    };
    Ok(Map {
        axis_titles: [title(0), title(1)],
        points: projection.points,
    })
}
