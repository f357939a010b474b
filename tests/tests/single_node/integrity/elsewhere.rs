//! Tests a worker that returns wrong results to a search that runs outside the coordinator.

use super::{Honest, LIAR, SLOW, connect, impossible, patient, tell_lies};
use murmuration_proto::v1::{
    self, evaluate_request::Part, evaluation_description::Campaign,
    evaluation_service_client::EvaluationServiceClient,
};
use murmuration_tests::{Cluster, small_spec};
use std::ops::Range;
use tokio::{
    sync::{mpsc, watch},
    task::JoinHandle,
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Code, Status};

fn controllers(seeds: Range<u64>) -> v1::EvaluateRequest {
    let task = |seed| v1::EvaluationTask {
        controller: vec![0.1, 0.2, 0.3, 0.4],
        seed,
    };
    let tasks = seeds.map(task).collect();
    v1::EvaluateRequest {
        part: Some(Part::Controllers(v1::ControllersToEvaluate { tasks })),
    }
}

/// Begins a stream with 20 controllers. Returns the sender of further requests, the number of results that the client has
/// received, and the end of the stream.
async fn evaluate(
    cluster: &Cluster,
) -> (
    mpsc::Sender<v1::EvaluateRequest>,
    watch::Receiver<usize>,
    JoinHandle<Result<(), Status>>,
) {
    let description = Part::Description(v1::EvaluationDescription {
        campaign: Some(Campaign::Spec((&small_spec("")).into())),
        pictures: false,
        seed: None,
    });
    let description = v1::EvaluateRequest {
        part: Some(description),
    };
    let (requests, sent) = mpsc::channel(4);
    for request in [description, controllers(0..20)] {
        requests.send(request).await.unwrap();
    }
    let mut client = EvaluationServiceClient::new(cluster.channel().await);
    let (count, received) = watch::channel(0);
    let evaluated = tokio::spawn(async move {
        let mut responses = client.evaluate(ReceiverStream::new(sent)).await?.into_inner();
        while let Some(response) = responses.message().await? {
            count.send_modify(|received| *received += response.results.len());
        }
        Ok(())
    });
    (requests, received, evaluated)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_ends_once_its_audits_are_over() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_with(folder.path(), 0, patient("1")).await;
    let mut slow = connect(&cluster, SLOW).await.unwrap();
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let (requests, mut received, evaluated) = evaluate(&cluster).await;
    drop(requests);
    slow.lease(1).await;
    tell_lies(&mut liar, 20).await;
    received.wait_for(|&received| received >= 20).await.unwrap();
    assert!(!evaluated.is_finished(), "the results are not audited yet");
    drop(slow);
    let workers = [3, 4].map(|machine| Honest::join(&cluster, folder.path(), machine));
    let refused = evaluated.await.unwrap().unwrap_err();
    assert_eq!(refused.code(), Code::DataLoss, "{refused}");
    assert!(refused.message().contains("controller 0 among them"), "{refused}");
    for worker in workers {
        worker.leave().await;
    }
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_with_results_of_a_machine_found_wrong_does_not_end_well() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_with(folder.path(), 0, patient("0")).await;
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let (requests, mut received, evaluated) = evaluate(&cluster).await;
    tell_lies(&mut liar, 20).await;
    // The coordinator would evaluate results again that the client does not have yet, and the stream would end without an error.
    // Therefore the client must have the first wrong results before the next wrong results expose the liar.
    received.wait_for(|&received| received >= 20).await.unwrap();
    requests.send(controllers(20..40)).await.unwrap();
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
