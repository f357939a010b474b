//! A campaign in a cluster of this process, over a temporary or a kept folder.

use super::{CliError, Took, process_cpu};
use murmuration_access::ListenConfig;
use murmuration_cli::connection;
use murmuration_coordinator::{
    local::{InProcess, LocalCluster},
    server::{LocalWay, Options},
};
use murmuration_dispatch as dispatch;
use murmuration_proto::v1::{
    self, campaign_service_client::CampaignServiceClient, checkpoint_service_client::CheckpointServiceClient,
};
use murmuration_sim::simulate::Start;
use murmuration_store::{DataDirectory, Store};
use murmuration_swarm::{CampaignSpec, Controller, Lineage};
use std::{
    path::{Path, PathBuf},
    time::{Duration, Instant},
};
use tempfile::TempDir;

/// Shortest and longest pause between two queries of the campaign's progress.
const PAUSES: (Duration, Duration) = (Duration::from_millis(3), Duration::from_millis(200));

/// A cluster in this process, in which no campaign has run yet.
pub(in crate::bench) struct BenchCampaign {
    folder: Folder,
    cluster: LocalCluster,
}

/// The data directory of a cluster.
enum Folder {
    Temporary(TempDir),
    Kept(PathBuf),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Self::Temporary(folder) => folder.path(),
            Self::Kept(folder) => folder,
        }
    }
}

/// A campaign that has reached its end.
pub(in crate::bench) struct Finished {
    /// Time from the request that creates the campaign to the campaign's end.
    pub(in crate::bench) took: Took,
    folder: Folder,
    spec: CampaignSpec,
    id: String,
}

impl Finished {
    /// The evaluated tasks, in the order of the archive.
    pub(in crate::bench) fn tasks(&self) -> Result<Vec<(Controller, Start)>, CliError> {
        let (store, _) = Store::look(self.folder.path(), true)?;
        let record = store.campaign(&self.id)?;
        let range = 0..self.spec.search().evaluations();
        let individuals = store.individuals(&record.id, self.spec.model(), range, false)?;
        let tasks = individuals.into_iter();
        let tasks = tasks.map(|individual| (individual.controller, Start::seeded(individual.seed)));
        Ok(tasks.collect())
    }
}

impl BenchCampaign {
    /// Starts a cluster with these workers and trainers, and publishes the checkpoint `model` if there is one.
    pub(in crate::bench) async fn start(
        in_process: InProcess,
        model: Option<Vec<u8>>,
    ) -> Result<Self, CliError> {
        let folder = tempfile::tempdir()
            .map_err(|error| CliError::Failed(format!("cannot create a temporary folder: {error}")))?;
        Self::start_in(Folder::Temporary(folder), in_process, model).await
    }

    /// Starts a cluster without workers. Its data directory is `folder`, which stays.
    pub(super) async fn start_kept(folder: &Path) -> Result<Self, CliError> {
        Self::start_in(Folder::Kept(folder.to_owned()), InProcess::NONE, None).await
    }

    async fn start_in(
        folder: Folder,
        in_process: InProcess,
        model: Option<Vec<u8>>,
    ) -> Result<Self, CliError> {
        let options = Options {
            data: DataDirectory::hold(folder.path())?,
            listen: ListenConfig::open(0),
            resume: false,
            checkpoints: None,
            tries_checkpoints: false,
            dispatch: dispatch::Options::default(),
            mirror: None,
            reads_only: None,
            publication: None,
        };
        let cluster = LocalCluster::start(options, in_process).await?;
        let bench = Self { folder, cluster };
        if let Some(model) = model {
            let channel = connection::connect(&bench.way().target()).await?;
            let parts = Lineage::default().publish_requests(&model);
            let mut client = CheckpointServiceClient::new(channel);
            client.publish_checkpoint(tokio_stream::iter(parts)).await?;
        }
        Ok(bench)
    }

    /// The address and the credentials with which workers reach the coordinator.
    pub(super) const fn way(&self) -> &LocalWay {
        self.cluster.coordinator().local()
    }

    /// Runs a campaign through its last generation, and ends the cluster.
    pub(super) async fn run(self, spec: &CampaignSpec) -> Result<Finished, CliError> {
        let generations = spec.search().generations();
        let begun = Instant::now();
        self.follow(spec, |campaign| {
            let done = campaign.generations_done;
            (done < generations).then(|| pause(begun.elapsed(), done, generations))
        })
        .await
    }

    /// Runs a campaign to its taxonomy, and ends the cluster. Calls `saw` with the campaign's stage after each pause.
    pub(in crate::bench) async fn complete(
        self,
        spec: &CampaignSpec,
        pause: Duration,
        mut saw: impl FnMut(v1::CampaignStage),
    ) -> Result<Finished, CliError> {
        self.follow(spec, |campaign| {
            saw(campaign.stage());
            (campaign.state() != v1::CampaignState::Completed).then_some(pause)
        })
        .await
    }

    /// Runs a campaign and queries its status. `pause` returns the time until the next query, or `None` to end.
    async fn follow(
        self,
        spec: &CampaignSpec,
        mut pause: impl FnMut(&v1::Campaign) -> Option<Duration>,
    ) -> Result<Finished, CliError> {
        let channel = connection::connect(&self.way().target()).await?;
        let mut client = CampaignServiceClient::new(channel);
        let (begun, cpu) = (Instant::now(), process_cpu());
        let request = v1::CreateCampaignRequest {
            campaign: Some(v1::create_campaign_request::Campaign::Spec(spec.into())),
            ..v1::CreateCampaignRequest::default()
        };
        let mut campaign = client.create_campaign(request).await?.into_inner();
        while let Some(pause) = pause(&campaign) {
            if !campaign.active {
                return Err(CliError::Failed(format!(
                    "the campaign ended early: {}",
                    campaign.error
                )));
            }
            tokio::time::sleep(pause).await;
            let request = v1::GetCampaignRequest {
                campaign: campaign.id.clone(),
            };
            campaign = client.get_campaign(request).await?.into_inner();
        }
        let took = Took {
            wall: begun.elapsed(),
            cpu: process_cpu().saturating_sub(cpu),
        };
        self.cluster.shutdown().await?;
        Ok(Finished {
            took,
            folder: self.folder,
            spec: spec.clone(),
            id: campaign.id,
        })
    }
}

/// Half of the estimated remaining time, so that queries are few, and the last query comes just after the end.
fn pause(elapsed: Duration, done: u32, all: u32) -> Duration {
    let left = elapsed * all.saturating_sub(done) / done.max(1);
    (left / 2).clamp(PAUSES.0, PAUSES.1)
}
