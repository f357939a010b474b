//! Tests the list of workers and trainers, and how many of them are wanted, also as KEDA asks.

use murmuration_proto::{
    externalscaler::{GetMetricsRequest, ScaledObjectRef, external_scaler_client::ExternalScalerClient},
    parts::whole,
    v1::{self, node_service_client::NodeServiceClient},
};
use murmuration_swarm::CampaignSpec;
use murmuration_tests::{Cluster, longer_spec};
use std::{collections::HashMap, fs};
use tonic::Code;

fn object(metadata: &[(&str, &str)]) -> ScaledObjectRef {
    let metadata = metadata
        .iter()
        .map(|(name, value)| ((*name).to_owned(), (*value).to_owned()));
    ScaledObjectRef {
        name: "worker".to_owned(),
        namespace: "murmuration".to_owned(),
        scaler_metadata: HashMap::from_iter(metadata),
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nodes_are_listed_and_as_many_as_the_open_work_needs_are_wanted() {
    let folder = tempfile::tempdir().unwrap();
    let mut cluster = Cluster::start_without_trainer(folder.path(), 1).await;
    let mut nodes = NodeServiceClient::connect(cluster.url()).await.unwrap();
    let mut keda = ExternalScalerClient::connect(cluster.url()).await.unwrap();
    let worker = object(&[("node", "worker"), ("threads", "1"), ("within", "1")]);
    let trainer = object(&[("node", "trainer")]);
    assert!(!keda.is_active(worker.clone()).await.unwrap().into_inner().result);
    let mut changes = keda.stream_is_active(worker.clone()).await.unwrap().into_inner();
    assert!(!changes.message().await.unwrap().unwrap().result);
    let spec = fs::read_to_string(longer_spec(folder.path())).unwrap();
    let campaign = cluster.create(&CampaignSpec::from_toml(&spec).unwrap()).await;
    assert!(changes.message().await.unwrap().unwrap().result);
    let demand = v1::GetDemandRequest {
        threads: Some(1),
        seconds: Some(1.0),
    };
    let demanded = nodes.get_demand(demand).await.unwrap().into_inner();
    assert!(demanded.workers >= 1 && demanded.tasks > 0, "{demanded:?}");
    assert_eq!(demanded.trainers, 0);
    // The cost is known once a worker has answered.
    cluster
        .watch_until(&campaign, |status| status.generations_done > 1)
        .await;
    let demanded = nodes.get_demand(demand).await.unwrap().into_inner();
    assert!(
        demanded.thread_seconds.is_some_and(|seconds| seconds > 0.0),
        "{demanded:?}"
    );
    let listed = nodes
        .list_nodes(v1::ListNodesRequest {})
        .await
        .unwrap()
        .into_inner();
    let listed = whole(listed).await.unwrap().nodes;
    assert_eq!(listed.len(), 1, "{listed:?}");
    assert_eq!((listed[0].kind(), listed[0].threads), (v1::NodeKind::Worker, 1));

    let spec = keda
        .get_metric_spec(worker.clone())
        .await
        .unwrap()
        .into_inner()
        .metric_specs;
    assert_eq!((spec.len(), spec[0].target_size), (1, 1));
    for (asked, wanted) in [(worker.clone(), true), (trainer, false)] {
        let request = GetMetricsRequest {
            scaled_object_ref: Some(asked),
            metric_name: spec[0].metric_name.clone(),
        };
        let values = keda
            .get_metrics(request)
            .await
            .unwrap()
            .into_inner()
            .metric_values;
        assert_eq!(
            (values.len(), values[0].metric_value > 0),
            (1, wanted),
            "{values:?}"
        );
    }
    let wrong = keda.is_active(object(&[("node", "oven")])).await.unwrap_err();
    assert_eq!(wrong.code(), Code::InvalidArgument, "{wrong}");

    let request = v1::CancelCampaignRequest { campaign };
    cluster.client.cancel_campaign(request).await.unwrap();
    assert!(!changes.message().await.unwrap().unwrap().result);
    let demanded = nodes.get_demand(demand).await.unwrap().into_inner();
    assert_eq!((demanded.workers, demanded.tasks), (0, 0));
    drop(changes);
    cluster.stop().await;
}
