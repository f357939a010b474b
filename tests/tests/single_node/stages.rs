//! Kills each process of a latent campaign's cluster in each stage of the campaign. The outcome must equal the outcome of an
//! undisturbed campaign.

use murmuration_proto::v1;
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{ProcessCluster, Running};

/// A campaign whose stages each last a second or more, so that the test can observe each stage three times.
fn spec() -> CampaignSpec {
    let text = "name = \"stages\"\nmodel = \"single-sensor\"\nmethod = \"latent\"\n\
                [dataset]\ncontrollers = 6000\n[training.recipe.in-batch]\nepochs = 5\npatience = 5\n\
                [world]\nhorizon = 200\n[search]\npopulation = 2000\ngenerations = 6\n[taxonomy]\nmedoids = 600\n\
                [feedback]\nrounds = 1\nlabels = 1500\nstrategy = \"random\"\nstarts = 2\ngenerations = 1\n[feedback.recipe.labelled]\nepochs = 4\n";
    CampaignSpec::from_toml(text).unwrap()
}

/// A cluster with a running campaign.
struct Campaign {
    cluster: ProcessCluster,
    trainer: Running,
    id: String,
}

impl Campaign {
    fn start() -> Self {
        let mut cluster = ProcessCluster::start(1);
        let trainer = cluster.worker(&cluster.url(), "murmuration-trainer");
        let id = cluster.submit(&spec());
        Self { cluster, trainer, id }
    }

    /// Waits until the campaign is in `stage` and, if the status shows progress of this stage, has made some progress.
    fn wait_for(&mut self, stage: v1::CampaignStage) {
        self.cluster.wait_to_strike(&self.id, |status| {
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
            status.stage() == stage && begun
        });
    }

    fn kill_everything_in(&mut self, stage: v1::CampaignStage) {
        self.cluster.workers.pop().unwrap().kill();
        self.cluster.add_worker();
        let url = self.cluster.url();
        let trainer = self.cluster.worker(&url, "murmuration-trainer");
        std::mem::replace(&mut self.trainer, trainer).kill();
        let status = self.cluster.check_running(&self.id);
        assert_eq!(
            status.stage(),
            stage,
            "the stage was over before the coordinator was killed"
        );
        self.cluster.restart_coordinator();
    }

    /// The campaign's last checkpoint, and the digest of its archive.
    fn finish(mut self) -> (String, String) {
        let digest = self.cluster.finish(&self.id);
        (self.cluster.try_status(&self.id).unwrap().checkpoint, digest)
    }
}

#[test]
fn worker_trainer_and_coordinator_killed_in_every_stage_change_nothing() {
    let expected = Campaign::start().finish();
    let mut killed = Campaign::start();
    for stage in [
        v1::CampaignStage::Dataset,
        v1::CampaignStage::Pretrain,
        v1::CampaignStage::Evolve,
        v1::CampaignStage::Label,
        v1::CampaignStage::FineTune,
        // This stage embeds the archive with the fine-tuned checkpoint. After pretraining, the archive was still empty.
        v1::CampaignStage::Embed,
        v1::CampaignStage::Taxonomy,
    ] {
        killed.wait_for(stage);
        killed.kill_everything_in(stage);
    }
    assert_eq!(killed.finish(), expected);
}
