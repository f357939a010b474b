//! A latent campaign in real processes, each of which is killed in each stage: the outcome is that of an undisturbed one.

use murmuration_proto::{
    CampaignSpec,
    v1::{self, campaign_service_client::CampaignServiceClient},
};
use murmuration_tests::{Murmuration, Running};
use std::{path::Path, time::Duration};
use tonic::transport::Channel;

/// Every stage takes a second or more: long enough to be met in it three times.
fn spec() -> CampaignSpec {
    let text = "name = \"stages\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n\
                [dataset]\ncontrollers = 6000\n[training.recipe.in-batch]\nepochs = 5\npatience = 5\n\
                [world]\nhorizon = 200\n[search]\npopulation = 2000\ngenerations = 6\n[taxonomy]\nmedoids = 600\n\
                [feedback]\nrounds = 1\nlabels = 1500\nstrategy = \"random\"\nstarts = 2\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 4\n";
    CampaignSpec::from_toml(text).unwrap()
}

/// A coordinator, a worker and a trainer, each a process.
struct Processes {
    murmuration: Murmuration,
    url: String,
    coordinator: Running,
    worker: Running,
    trainer: Running,
    client: CampaignServiceClient<Channel>,
}

impl Processes {
    async fn start(data: &Path) -> Self {
        let murmuration = Murmuration::over(data);
        let (coordinator, url) = serve(&murmuration, "127.0.0.1:0");
        Self {
            worker: Running::worker(&url),
            trainer: Running::trainer(&url),
            client: connect(&url).await,
            murmuration,
            coordinator,
            url,
        }
    }

    async fn create(&mut self) {
        let request = v1::CreateCampaignRequest {
            spec: Some((&spec()).into()),
            weight: None,
        };
        self.client.create_campaign(request).await.unwrap();
    }

    async fn status(&mut self) -> v1::Campaign {
        let request = v1::GetCampaignRequest {
            campaign: "latest".to_owned(),
        };
        self.client.get_campaign(request).await.unwrap().into_inner()
    }

    /// Waits until the campaign is within `stage`: begun, and with something of it done where that can be told.
    async fn wait_for(&mut self, stage: v1::CampaignStage) {
        loop {
            let status = self.status().await;
            assert_ne!(status.state(), v1::CampaignState::Failed, "{}", status.error);
            assert_ne!(
                status.state(),
                v1::CampaignState::Completed,
                "{stage:?} was missed"
            );
            let begun = match stage {
                v1::CampaignStage::Dataset => status.dataset_done > 0,
                v1::CampaignStage::Pretrain | v1::CampaignStage::FineTune => {
                    status.training.is_some_and(|training| training.epoch > 0)
                }
                v1::CampaignStage::Label => status.labelled > 0,
                v1::CampaignStage::Embed => status.embedded > 0,
                v1::CampaignStage::Evolve => status.generations_done > 0,
                _ => true,
            };
            if status.stage() == stage && begun {
                return;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// The last proof that a fault strikes where it should.
    async fn check_still_in(&mut self, stage: v1::CampaignStage) {
        let status = self.status().await;
        assert_eq!(
            (status.stage(), status.state()),
            (stage, v1::CampaignState::Running)
        );
    }

    async fn finish(&mut self) -> (String, String) {
        loop {
            let status = self.status().await;
            assert_ne!(status.state(), v1::CampaignState::Failed, "{}", status.error);
            if status.state() == v1::CampaignState::Completed {
                let request = v1::GetDigestRequest { campaign: status.id };
                let digest = self.client.get_digest(request).await.unwrap().into_inner().digest;
                return (status.checkpoint, digest);
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }
}

/// Starts a coordinator without workers; its process and its URL.
fn serve(murmuration: &Murmuration, listen: &str) -> (Running, String) {
    let mut coordinator = murmuration.start(&["serve", "--workers", "0", "--listen", listen]);
    let said = coordinator.wait_for("serving");
    let url = said.rsplit(' ').next().unwrap().to_owned();
    (coordinator, url)
}

async fn connect(url: &str) -> CampaignServiceClient<Channel> {
    CampaignServiceClient::connect(url.to_owned()).await.unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn worker_trainer_and_coordinator_killed_in_every_stage_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let mut undisturbed = Processes::start(&folder.path().join("undisturbed")).await;
    undisturbed.create().await;
    let expected = undisturbed.finish().await;
    drop(undisturbed);

    let mut processes = Processes::start(&folder.path().join("killed")).await;
    processes.create().await;
    for stage in [
        v1::CampaignStage::Dataset,
        v1::CampaignStage::Pretrain,
        v1::CampaignStage::Evolve,
        v1::CampaignStage::Label,
        v1::CampaignStage::FineTune,
        // Of the archive, with what was fine-tuned: the first time there was nothing to embed.
        v1::CampaignStage::Embed,
        v1::CampaignStage::Taxonomy,
    ] {
        processes.wait_for(stage).await;
        processes.worker.kill();
        processes.worker = Running::worker(&processes.url);
        processes.trainer.kill();
        processes.trainer = Running::trainer(&processes.url);
        processes.check_still_in(stage).await;
        processes.coordinator.kill();
        let listen = processes.url.trim_start_matches("http://").to_owned();
        (processes.coordinator, processes.url) = serve(&processes.murmuration, &listen);
        processes.client = connect(&processes.url).await;
    }
    assert_eq!(processes.finish().await, expected);
}
