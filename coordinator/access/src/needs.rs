//! The one table of what every gRPC method and every page needs. What is not in it is for operators alone, and a test
//! fails.

use super::Machine;
use axum::http::Method;
use serde::{Deserialize, Serialize};
use std::fmt;

/// What somebody may do. Each role may do what those before it may.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// Look: campaigns, archives, labels, reports
    Viewer,
    /// Label: say what is what, name classes, be asked
    Annotator,
    /// Decide: submit, pause, cancel and refine campaigns, publish checkpoints
    Operator,
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Viewer => "viewer",
            Self::Annotator => "annotator",
            Self::Operator => "operator",
        })
    }
}

/// What a request must show.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Requirement {
    /// Nothing.
    Nothing,
    /// The token of somebody with this role.
    Person(Role),
    /// The certificate of such a machine; an operator's token where machines have none.
    Machine(Machine),
    /// The certificate of such a machine, or the token of somebody with this role.
    MachineOr(Machine, Role),
    /// A machine's certificate, or the token of somebody with this role.
    AnyMachineOr(Role),
}

use Machine::{Trainer, Worker};
use Requirement::{AnyMachineOr, MachineOr, Nothing, Person};
use Role::{Annotator, Operator, Viewer};

/// gRPC: service, methods, what they need.
const METHODS: [(&str, &[(&str, Requirement)]); 7] = [
    (
        "murmuration.v1.CampaignService",
        &[
            ("CreateCampaign", Person(Operator)),
            ("GetCampaign", Person(Viewer)),
            ("ListCampaigns", Person(Viewer)),
            ("WatchCampaign", Person(Viewer)),
            ("PauseCampaign", Person(Operator)),
            ("ResumeCampaign", Person(Operator)),
            ("CancelCampaign", Person(Operator)),
            ("AdoptCheckpoint", Person(Operator)),
            ("RefineCampaign", Person(Operator)),
            ("ListGenerations", Person(Viewer)),
            ("GetArchive", Person(Viewer)),
            ("GetDigest", Person(Viewer)),
            ("GetTaxonomy", Person(Viewer)),
            ("GetIndividual", Person(Viewer)),
            ("GetReplay", Person(Viewer)),
        ],
    ),
    (
        "murmuration.v1.CheckpointService",
        &[
            ("ListCheckpoints", Person(Viewer)),
            ("GetCheckpoint", AnyMachineOr(Viewer)),
            ("FetchCheckpoint", AnyMachineOr(Viewer)),
            ("PublishCheckpoint", MachineOr(Trainer, Operator)),
        ],
    ),
    (
        "murmuration.v1.LabelService",
        &[
            ("AppendLabels", Person(Annotator)),
            ("AppendSyntheticLabels", Person(Annotator)),
            ("UndoLabels", Person(Annotator)),
            ("ListLabels", Person(Viewer)),
            ("ListLabelEntries", Person(Viewer)),
            ("ListClasses", Person(Viewer)),
            ("ChangeClass", Person(Annotator)),
            ("NextQueries", Person(Annotator)),
            ("GetAgreement", Person(Viewer)),
        ],
    ),
    (
        "murmuration.v1.WorkerService",
        &[("Work", Requirement::Machine(Worker))],
    ),
    (
        "murmuration.v1.TrainerService",
        &[
            ("Train", Requirement::Machine(Trainer)),
            ("FetchTraining", Requirement::Machine(Trainer)),
        ],
    ),
    ("grpc.health.v1.Health", &[("Check", Nothing), ("Watch", Nothing)]),
    (
        "grpc.reflection.v1.ServerReflection",
        &[("ServerReflectionInfo", Person(Viewer))],
    ),
];

/// Pages, and what machines ask: route, what looking at it needs, what posting to it needs.
const PAGES: [(&str, Option<Requirement>, Option<Requirement>); 29] = [
    ("/", Some(Person(Viewer)), Some(Person(Operator))),
    ("/login", Some(Nothing), Some(Nothing)),
    ("/logout", None, Some(Nothing)),
    ("/assets/{name}", Some(Nothing), None),
    ("/healthz", Some(Nothing), None),
    ("/readyz", Some(Nothing), None),
    ("/metrics", Some(Person(Viewer)), None),
    ("/events", Some(Person(Viewer)), None),
    ("/campaigns/{id}", Some(Person(Viewer)), None),
    ("/campaigns/{id}/events", Some(Person(Viewer)), None),
    ("/campaigns/{id}/individuals/{index}", Some(Person(Viewer)), None),
    (
        "/campaigns/{id}/individuals/{index}/motion",
        Some(Person(Viewer)),
        None,
    ),
    ("/campaigns/{id}/pause", None, Some(Person(Operator))),
    ("/campaigns/{id}/resume", None, Some(Person(Operator))),
    ("/campaigns/{id}/cancel", None, Some(Person(Operator))),
    ("/campaigns/{id}/refine", None, Some(Person(Operator))),
    ("/campaigns/{id}/label", Some(Person(Viewer)), None),
    ("/campaigns/{id}/sheet", Some(Person(Viewer)), None),
    ("/campaigns/{id}/map", Some(Person(Viewer)), None),
    ("/campaigns/{id}/taxonomy", Some(Person(Viewer)), None),
    ("/campaigns/{id}/report", Some(Person(Viewer)), None),
    ("/campaigns/{id}/changes", Some(Person(Viewer)), None),
    (
        "/campaigns/{id}/labels",
        Some(Person(Viewer)),
        Some(Person(Annotator)),
    ),
    ("/campaigns/{id}/questions", None, Some(Person(Annotator))),
    ("/campaigns/{id}/undo", None, Some(Person(Annotator))),
    ("/campaigns/{id}/classes", None, Some(Person(Annotator))),
    ("/campaigns/{id}/points", Some(Person(Viewer)), None),
    ("/campaigns/{id}/points/axes", Some(Person(Viewer)), None),
    ("/campaigns/{id}/points/neighbours", Some(Person(Viewer)), None),
];

/// What the gRPC method of this path (`/SERVICE/METHOD`) needs; `None` where there is none.
pub(super) fn of_method(path: &str) -> Option<Requirement> {
    let (service, method) = path.strip_prefix('/')?.split_once('/')?;
    let (_, methods) = METHODS.iter().find(|(known, _)| *known == service)?;
    let known = methods.iter().find(|(known, _)| *known == method);
    Some(known.map_or(Person(Operator), |&(_, need)| need))
}

/// What a page needs, by its route (`/campaigns/{id}`); `None` is no page.
pub(super) fn of_page(method: &Method, route: Option<&str>) -> Requirement {
    // An address that leads nowhere.
    let Some(route) = route else { return Person(Viewer) };
    let looks = [Method::GET, Method::HEAD].contains(method);
    let known = PAGES.iter().find(|(known, ..)| *known == route);
    let need = known.and_then(|&(_, look, post)| if looks { look } else { post });
    need.unwrap_or(Person(Operator))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::FILE_DESCRIPTORS;
    use prost::Message as _;
    use prost_types::FileDescriptorSet;

    /// Every method that is served, as `/SERVICE/METHOD`.
    fn methods() -> Vec<String> {
        let sets = [
            FILE_DESCRIPTORS,
            tonic_health::pb::FILE_DESCRIPTOR_SET,
            tonic_reflection::pb::v1::FILE_DESCRIPTOR_SET,
        ];
        let files = sets.map(|set| FileDescriptorSet::decode(set).unwrap().file);
        let services = files.iter().flatten().flat_map(|file| {
            let package = file.package();
            file.service.iter().map(move |service| (package, service))
        });
        services
            .flat_map(|(package, service)| {
                let name = service.name();
                service
                    .method
                    .iter()
                    .map(move |method| format!("/{package}.{name}/{}", method.name()))
            })
            .collect()
    }

    /// Every page, as the router has it: route, whether it is looked at, whether it is posted to.
    fn pages() -> Vec<(&'static str, bool, bool)> {
        let sources = [
            include_str!("../../web/src/lib.rs"),
            include_str!("../../src/probes.rs"),
        ];
        let routes = sources
            .into_iter()
            .flat_map(|source| source.split(".route(").skip(1));
        routes
            .map(|route| {
                let route = route.trim_start();
                let (path, handlers) = route[1..].split_once('"').unwrap();
                // One line, or as many as end with a line of its own.
                let handlers = handlers.split("\n        .").next().unwrap();
                let handled = |how: &str| {
                    handlers.contains(&format!(" {how}(")) || handlers.contains(&format!(".{how}("))
                };
                (path, handled("get"), handled("post"))
            })
            .collect()
    }

    #[test]
    fn every_method_is_in_the_table_and_nothing_else_is() {
        let served = methods();
        assert!(served.len() > 30, "{served:?}");
        let mut listed: Vec<String> = METHODS
            .iter()
            .flat_map(|(service, methods)| {
                methods
                    .iter()
                    .map(move |(method, _)| format!("/{service}/{method}"))
            })
            .collect();
        let mut served = served;
        served.sort();
        listed.sort();
        assert_eq!(listed, served);
    }

    #[test]
    fn every_page_is_in_the_table_and_nothing_else_is() {
        let mut served = pages();
        let mut listed = PAGES
            .map(|(route, look, post)| (route, look.is_some(), post.is_some()))
            .to_vec();
        assert!(served.len() > 20, "{served:?}");
        served.sort_unstable();
        listed.sort_unstable();
        assert_eq!(listed, served);
    }

    #[test]
    fn what_the_table_does_not_know_is_for_operators() {
        assert_eq!(
            of_method("/murmuration.v1.CampaignService/Explode"),
            Some(Person(Operator))
        );
        assert_eq!(of_method("/campaigns/small-1"), None);
        assert_eq!(of_page(&Method::GET, Some("/secret")), Person(Operator));
        assert_eq!(of_page(&Method::DELETE, Some("/events")), Person(Operator));
    }
}
