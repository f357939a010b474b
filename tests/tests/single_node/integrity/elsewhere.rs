//! Tests a worker that returns wrong results to a search that runs outside the coordinator.

use super::{Honest, LIAR, audited, connect, impossible, tell_lies};
use murmuration_dispatch::Options;
use murmuration_proto::v1::{
    self, evaluate_request::Part, evaluation_description::Campaign,
    evaluation_service_client::EvaluationServiceClient,
};
use murmuration_tests::{Cluster, small_spec};
use std::time::Duration;
use tokio::sync::{mpsc, watch};
use tokio_stream::wrappers::ReceiverStream;
use tonic::Code;

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_with_results_of_a_machine_found_wrong_does_not_end_well() {
    let folder = tempfile::tempdir().unwrap();
    let options = Options {
        // The liar sends nothing while the test waits for the client's results.
        silence_limit: Duration::from_secs(20),
        ..audited("0")
    };
    let cluster = Cluster::start_with(folder.path(), 0, options).await;
    let description = Part::Description(v1::EvaluationDescription {
        campaign: Some(Campaign::Spec((&small_spec("")).into())),
        pictures: false,
        seed: None,
    });
    let task = |seed| v1::EvaluationTask {
        controller: vec![0.1, 0.2, 0.3, 0.4],
        seed,
    };
    let controllers = |seeds: std::ops::Range<u64>| {
        Part::Controllers(v1::ControllersToEvaluate {
            tasks: seeds.map(task).collect(),
        })
    };
    let request = |part| v1::EvaluateRequest { part: Some(part) };
    let (requests, sent) = mpsc::channel(4);
    for part in [description, controllers(0..20)] {
        requests.send(request(part)).await.unwrap();
    }
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let mut client = EvaluationServiceClient::new(cluster.channel().await);
    let (count, mut received) = watch::channel(0);
    let evaluated = tokio::spawn(async move {
        let mut responses = client.evaluate(ReceiverStream::new(sent)).await?.into_inner();
        while let Some(response) = responses.message().await? {
            count.send_modify(|received| *received += response.results.len());
        }
        Ok::<_, tonic::Status>(())
    });
    tell_lies(&mut liar, 20).await;
    // The coordinator would evaluate results again that the client does not have yet, and the stream would end without an error.
    // Therefore the client must have the first wrong results before the next wrong results expose the liar.
    received.wait_for(|&received| received >= 20).await.unwrap();
    requests.send(request(controllers(20..40))).await.unwrap();
    drop(requests);
    let (lease, batch) = liar.lease(20).await;
    liar.answer(lease, impossible(), batch.tasks.len()).await;
    assert_eq!(liar.dismissed().await.code(), Code::InvalidArgument);
    let worker = Honest::join(&cluster, folder.path(), 3);
    let refused = evaluated.await.unwrap().unwrap_err();
    assert_eq!(refused.code(), Code::DataLoss, "{refused}");
    assert!(refused.message().contains("controller 0 among them"), "{refused}");
    worker.leave().await;
    cluster.stop().await;
}
