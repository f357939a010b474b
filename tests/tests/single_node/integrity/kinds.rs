//! Tests that machines of different kinds embed a picture almost identically, and that no audit counts one of them as wrong.

use crate::integrity::{Honest, LIAR, audited, connect, impossible, notices};
use murmuration_dispatch::Options;
use murmuration_embed::{Embedder, Runtime};
use murmuration_link::{Address, Role, Target, fetch_checkpoint};
use murmuration_onnx::EmbedderModel;
use murmuration_proto::v1;
use murmuration_sim::{evaluate::Evaluator, simulate::Start};
use murmuration_swarm::{
    CampaignSpec, CapabilityModel, CheckpointDigest, Compressor, Controller, Evaluation, ImageFormat,
    Purpose, RandomStream, World,
};
use murmuration_tests::{Cluster, small_latent_spec};
use rand::RngExt as _;
use std::time::Duration;
use tonic::Code;

/// Evaluates a batch as a correct machine of another kind does: embeddings differ in the last bits.
async fn evaluate(cluster: &Cluster, lease: v1::LeaseId, batch: v1::EvaluationBatch) -> v1::Evaluations {
    let digest: CheckpointDigest = batch.checkpoint.parse().unwrap();
    let address = Address::new(Target::open(&cluster.url()), Role::Trainer, "tested").unwrap();
    let bytes = fetch_checkpoint(&address.calls(), digest, lease).await.unwrap();
    let model = EmbedderModel::read(&bytes).unwrap();
    let mut embedder = Embedder::open(&Runtime::load().unwrap(), model).unwrap();
    let world = World::try_from(batch.world.unwrap()).unwrap();
    let model = CapabilityModel::try_from(batch.model.unwrap()).unwrap();
    let format = ImageFormat::for_swarm(batch.image.unwrap(), &world, &model).unwrap();
    let mut evaluator = Evaluator::new(&world, &format).unwrap();
    let evaluated = batch.tasks.iter().map(|task| {
        let controller = Controller::new(&model, &task.controller).unwrap();
        let evaluation = evaluator
            .evaluate(&controller, &Start::seeded(task.seed))
            .unwrap();
        let embedding = embedder.embed(&[evaluation.image()]).unwrap().remove(0);
        let other_kind: Vec<f32> = embedding.into_iter().map(f32::next_up).collect();
        let dimensions = other_kind.len();
        evaluation.embedded(other_kind, dimensions).unwrap()
    });
    Evaluation::message(&evaluated.collect::<Vec<_>>(), &mut Compressor::new().unwrap()).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_machine_of_another_kind_embedded_is_not_found_wrong() {
    let folder = tempfile::tempdir().unwrap();
    let text = small_latent_spec("").to_toml();
    let spec = CampaignSpec::from_toml(&text.replace("generations = 5", "generations = 200")).unwrap();
    let options = Options {
        // The machine sends nothing while it computes.
        silence_limit: Duration::from_secs(20),
        ..audited("0")
    };
    let mut cluster = Cluster::start_with(folder.path(), 0, options).await;
    let campaign = cluster.create(&spec).await;
    let worker = Honest::join(&cluster, folder.path(), 3);
    let status = cluster
        .watch_until(&campaign, |status| status.generations_done > 0)
        .await;
    assert_eq!(status.error, "");
    worker.leave().await;

    let mut other = connect(&cluster, LIAR).await.unwrap();
    let until = cluster.status(&campaign).await.generations_done + 2;
    let generation_of = |task: &v1::EvaluationTask| {
        let seed_of = |index| RandomStream::derive(spec.seed(), Purpose::Start, index).random::<u64>();
        (0..800).find(|&index| seed_of(index) == task.seed).unwrap() / 20
    };
    let mut answered = Vec::new();
    // The number of batches depends on the speed of the other workers.
    let (lease, batch, count) = loop {
        let (lease, batch) = other.lease(20).await;
        let in_hand = generation_of(&batch.tasks[0]);
        let count = answered
            .iter()
            .filter(|&&generation| generation < in_hand)
            .count();
        if count >= 20 && cluster.status(&campaign).await.generations_done >= until {
            break (lease, batch, count);
        }
        answered.extend(batch.tasks.iter().map(generation_of));
        let evaluations = evaluate(&cluster, lease, batch).await;
        other.answer_with(lease, evaluations).await;
    };
    // The machine now returns an impossible result. The coordinator has the machine's earlier results evaluated again: the
    // results of the current generation at once, the other results later.
    other.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(other.dismissed().await.code(), Code::InvalidArgument);
    let worker = Honest::join(&cluster, folder.path(), 3);
    let last = cluster.finish(&campaign).await;
    assert_eq!(last.state(), v1::CampaignState::Completed, "{}", last.error);
    let message = notices(&last);
    assert!(
        message.contains(&format!("no error was found in {count} results")),
        "{message}"
    );
    worker.leave().await;
    cluster.stop().await;
}
