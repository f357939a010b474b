//! A coordinator with in-process workers over a temporary data directory.

use murmuration_access::{ListenConfig, Requirements};
use murmuration_coordinator::{
    local::{InProcess, LocalCluster},
    server::Options,
};
use murmuration_dispatch as dispatch;
use murmuration_link::Coordinator;
use murmuration_proto::{
    parts::whole,
    v1::{self, campaign_service_client::CampaignServiceClient},
};
use murmuration_store::DataDirectory;
use murmuration_swarm::CampaignSpec;
use std::{path::Path, time::Duration};
use tonic::{service::interceptor::InterceptedService, transport::Channel};

/// A running cluster.
#[derive(Debug)]
pub struct Cluster {
    local: LocalCluster,
    /// A connected client.
    pub client: CampaignServiceClient<Coordinator>,
}

/// A campaign that is small enough for tests: 5 generations of 20 controllers, with 200 steps for each controller. `more` is
/// appended to the campaign's file.
#[must_use]
pub fn small_spec(more: &str) -> CampaignSpec {
    let text = format!(
        "name = \"small\"\nmodel = \"single-sensor\"\nmethod = \"hand-crafted\"\n{more}\n\
         [world]\nhorizon = 200\n[search]\npopulation = 20\ngenerations = 5\n[taxonomy]\nmedoids = 4\n"
    );
    CampaignSpec::from_toml(&text).unwrap()
}

/// Writes the file of a campaign to `folder`. The campaign takes some seconds, so that tests can interrupt it: 240 generations of
/// 20 controllers, with 600 steps for each controller.
#[must_use]
pub fn longer_spec(folder: &Path) -> String {
    let text = small_spec("seed = 5").to_toml();
    let text = text
        .replace("generations = 5", "generations = 240")
        .replace("horizon = 200", "horizon = 600");
    let path = folder.join("longer.toml");
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// A latent campaign as small as [`small_spec`], trained on the pictures of 100 controllers. `more` is appended to the campaign's
/// file.
#[must_use]
pub fn small_latent_spec(more: &str) -> CampaignSpec {
    let text = format!(
        "name = \"small\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n{more}\n\
         [dataset]\ncontrollers = 100\n[training.recipe.in-batch]\nbatch = 30\nepochs = 3\n\
         [world]\nhorizon = 200\n[search]\npopulation = 20\ngenerations = 5\n[taxonomy]\nmedoids = 4\n"
    );
    CampaignSpec::from_toml(&text).unwrap()
}

/// Options with which the coordinator notices a silent worker within a second.
#[must_use]
pub fn quick_dispatch() -> dispatch::Options {
    dispatch::Options {
        heartbeat_interval: Duration::from_millis(100),
        silence_limit: Duration::from_millis(500),
        ..dispatch::Options::default()
    }
}

impl Cluster {
    /// Starts a coordinator over the data directory `data`, with `workers` workers and a trainer. Running campaigns of the
    /// directory continue.
    pub async fn start(data: &Path, workers: usize) -> Self {
        Self::start_as(data, workers, ListenConfig::open(0), quick_dispatch()).await
    }

    /// Starts a cluster as [`Cluster::start`] does, with another listener. The cluster's own client connects as a process of this
    /// machine.
    pub async fn start_at(data: &Path, workers: usize, listen: ListenConfig) -> Self {
        Self::start_as(data, workers, listen, quick_dispatch()).await
    }

    /// Starts a cluster as [`Cluster::start`] does, with other options for workers.
    pub async fn start_with(data: &Path, workers: usize, dispatch: dispatch::Options) -> Self {
        Self::start_as(data, workers, ListenConfig::open(0), dispatch).await
    }

    /// Starts a cluster as [`Cluster::start`] does, but without a trainer.
    pub async fn start_without_trainer(data: &Path, workers: usize) -> Self {
        let in_process = InProcess {
            workers,
            ..InProcess::NONE
        };
        Self::start_in_process(data, in_process, ListenConfig::open(0), quick_dispatch()).await
    }

    async fn start_as(
        data: &Path,
        workers: usize,
        listen: ListenConfig,
        dispatch: dispatch::Options,
    ) -> Self {
        Self::start_in_process(
            data,
            InProcess {
                workers,
                trainers: 1,
                ..InProcess::NONE
            },
            listen,
            dispatch,
        )
        .await
    }

    async fn start_in_process(
        data: &Path,
        in_process: InProcess,
        listen: ListenConfig,
        dispatch: dispatch::Options,
    ) -> Self {
        let options = Options {
            data: DataDirectory::hold(data).unwrap(),
            listen,
            resume: true,
            checkpoints: None,
            tries_checkpoints: true,
            dispatch,
            mirror: None,
            reads_only: None,
            publication: None,
        };
        let local = LocalCluster::start(options, in_process).await.unwrap();
        let way = local.coordinator().local();
        let channel = way
            .credentials
            .endpoint(&way.url)
            .unwrap()
            .connect()
            .await
            .unwrap();
        let client = CampaignServiceClient::new(InterceptedService::new(channel, way.credentials.bearer()));
        Self { local, client }
    }

    /// The requirements of each page and gRPC method of the coordinator.
    #[must_use]
    pub const fn requirements(&self) -> &Requirements {
        self.local.coordinator().requirements()
    }

    /// URL of the coordinator.
    #[must_use]
    pub fn url(&self) -> String {
        self.local.coordinator().url()
    }

    /// A channel to the coordinator, for clients of other services.
    pub async fn channel(&self) -> Channel {
        Channel::from_shared(self.url()).unwrap().connect().await.unwrap()
    }

    /// Starts a campaign and returns its id.
    pub async fn create(&mut self, spec: &CampaignSpec) -> String {
        let request = v1::CreateCampaignRequest {
            campaign: Some(v1::create_campaign_request::Campaign::Spec(spec.into())),
            ..v1::CreateCampaignRequest::default()
        };
        self.client
            .create_campaign(request)
            .await
            .unwrap()
            .into_inner()
            .id
    }

    /// Watches a campaign until it stops, and returns its last status.
    pub async fn finish(&mut self, campaign: &str) -> v1::Campaign {
        self.watch_until(campaign, |_| false).await
    }

    /// Watches a campaign until its status satisfies `wanted` or the campaign stops. Returns the last status.
    pub async fn watch_until(
        &mut self,
        campaign: &str,
        wanted: impl Fn(&v1::Campaign) -> bool,
    ) -> v1::Campaign {
        let request = v1::WatchCampaignRequest {
            campaign: campaign.to_owned(),
        };
        let mut statuses = self.client.watch_campaign(request).await.unwrap().into_inner();
        let mut last = None;
        while let Some(status) = statuses.message().await.unwrap() {
            let found = wanted(&status);
            last = Some(status);
            if found {
                break;
            }
        }
        last.expect("a watched campaign says something")
    }

    /// The digest of a campaign's archive.
    pub async fn digest(&mut self, campaign: &str) -> String {
        let request = v1::GetDigestRequest {
            campaign: campaign.to_owned(),
        };
        self.client.get_digest(request).await.unwrap().into_inner().digest
    }

    /// Every individual of a campaign, with its picture.
    pub async fn archive(&mut self, campaign: &str) -> Vec<v1::Individual> {
        let request = v1::GetArchiveRequest {
            campaign: campaign.to_owned(),
            images: true,
        };
        let parts = self.client.get_archive(request).await.unwrap().into_inner();
        whole(parts).await.unwrap().individuals
    }

    /// The taxonomy of a completed campaign.
    pub async fn taxonomy(&mut self, campaign: &str) -> v1::Taxonomy {
        let request = v1::GetTaxonomyRequest {
            campaign: campaign.to_owned(),
        };
        let parts = self.client.get_taxonomy(request).await.unwrap().into_inner();
        whole(parts).await.unwrap()
    }

    /// Switches a campaign to a checkpoint.
    ///
    /// # Errors
    /// The coordinator's error.
    pub async fn adopt(&mut self, campaign: &str, checkpoint: &str) -> Result<(), tonic::Status> {
        let request = v1::AdoptCheckpointRequest {
            campaign: campaign.to_owned(),
            checkpoint: checkpoint.to_owned(),
        };
        self.client.adopt_checkpoint(request).await.map(drop)
    }

    /// The current status of a campaign.
    pub async fn status(&mut self, campaign: &str) -> v1::Campaign {
        let request = v1::GetCampaignRequest {
            campaign: campaign.to_owned(),
        };
        self.client.get_campaign(request).await.unwrap().into_inner()
    }

    /// All campaigns.
    pub async fn campaigns(&mut self) -> Vec<v1::Campaign> {
        let listed = self.client.list_campaigns(v1::ListCampaignsRequest {}).await;
        whole(listed.unwrap().into_inner()).await.unwrap().campaigns
    }

    /// Runs a campaign until it is completed, and returns its digest.
    pub async fn run(&mut self, spec: &CampaignSpec) -> String {
        let campaign = self.create(spec).await;
        let last = self.finish(&campaign).await;
        assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
        self.digest(&campaign).await
    }

    /// Stops the cluster.
    pub async fn stop(self) {
        self.local.shutdown().await.unwrap();
    }
}
