//! Tests the requirements of each page and gRPC method, as a running coordinator registers them.

use murmuration_access::{Requirement, Role};
use murmuration_proto::FILE_DESCRIPTORS;
use murmuration_tests::Cluster;
use prost::Message as _;
use prost_types::FileDescriptorSet;
use std::collections::BTreeSet;

/// Every method in the descriptors of our services and of the standard services, as `/SERVICE/METHOD`.
fn described() -> BTreeSet<String> {
    let sets = [
        FILE_DESCRIPTORS,
        tonic_health::pb::FILE_DESCRIPTOR_SET,
        tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
    ];
    let mut methods = BTreeSet::new();
    for file in sets
        .map(|set| FileDescriptorSet::decode(set).unwrap().file)
        .concat()
    {
        for service in &file.service {
            let name = format!("{}.{}", file.package(), service.name());
            methods.extend(
                service
                    .method
                    .iter()
                    .map(|method| format!("/{name}/{}", method.name())),
            );
        }
    }
    methods
}

#[tokio::test(flavor = "multi_thread")]
async fn every_method_has_a_requirement_and_none_is_required_of_what_there_is_not() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let described = described();
    assert!(described.len() > 30, "{described:?}");
    let listed: Vec<String> = cluster.requirements().methods().map(|(path, _)| path).collect();
    assert_eq!(listed.len(), described.len(), "{listed:?}");
    assert_eq!(BTreeSet::from_iter(listed), described);
    cluster.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn strangers_get_the_log_in_and_health_alone_and_viewers_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let cluster = Cluster::start(folder.path(), 0).await;
    let requirements = cluster.requirements();
    let pages = requirements
        .pages()
        .map(|(method, route, needs)| (format!("{method} {route}"), needs));
    let (for_anybody, others): (Vec<_>, Vec<_>) = pages
        .chain(requirements.methods())
        .partition(|(_, needs)| *needs == Requirement::Nothing);
    let for_anybody: BTreeSet<&str> = for_anybody.iter().map(|(route, _)| route.as_str()).collect();
    let expected = [
        "/grpc.health.v1.Health/Check",
        "/grpc.health.v1.Health/Watch",
        "GET /assets/{name}",
        "GET /healthz",
        "GET /login",
        "GET /open",
        "GET /readyz",
        "POST /login",
        "POST /logout",
    ];
    assert_eq!(for_anybody, BTreeSet::from(expected));
    // These actions change nothing. They are POST requests only because a POST request must come from our own pages.
    let change_nothing = [
        "POST /play/motion",
        "POST /play/around",
        "POST /play/robot",
        "POST /play/like",
        "POST /campaigns/{id}/pieces",
    ];
    let posts = others
        .iter()
        .filter(|(route, _)| route.starts_with("POST") && !change_nothing.contains(&route.as_str()));
    for (route, needs) in posts {
        let changes = matches!(needs, Requirement::Person(role) if *role > Role::Viewer);
        assert!(changes, "{route}: {needs:?}");
    }
    cluster.stop().await;
}
