//! A worker that lies to a search that runs elsewhere.

use super::{Honest, LIAR, audited, connect, impossible, tell_lies};
use murmuration_proto::v1::{
    self, evaluate_request::Part, evaluation_description::Campaign,
    evaluation_service_client::EvaluationServiceClient,
};
use murmuration_tests::{Cluster, small_spec};
use tonic::Code;

#[tokio::test(flavor = "multi_thread")]
async fn a_stream_with_results_of_a_machine_found_wrong_does_not_end_well() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start_with(folder.path(), 0, audited("0")).await;
    let description = Part::Description(v1::EvaluationDescription {
        campaign: Some(Campaign::Spec((&small_spec("")).into())),
        pictures: false,
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
    let parts = [description, controllers(0..20), controllers(20..40)];
    let requests = parts.map(|part| v1::EvaluateRequest { part: Some(part) });
    let mut liar = connect(&cluster, LIAR).await.unwrap();
    let mut client = EvaluationServiceClient::new(cluster.channel().await);
    let evaluated = tokio::spawn(async move {
        let mut responses = client.evaluate(tokio_stream::iter(requests)).await?.into_inner();
        let mut results = 0;
        while let Some(response) = responses.message().await? {
            results += response.results.len();
        }
        Ok::<_, tonic::Status>(results)
    });
    tell_lies(&mut liar, 20).await;
    // The first lies are sent already when the next give it away.
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
