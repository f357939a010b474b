//! The gRPC services of a coordinator, with the requirements and cost of each method.

use murmuration_access::{
    CostClass::{self, Bulk, Computing, Decision, Light, Reading, Streaming},
    GuardedRouter,
    MachineKind::{Trainer, Worker},
    MethodRequirements,
    Requirement::{self, AnyMachineOr, Machine, MachineOr, Nothing},
    Role, limits,
};
use murmuration_proto::{
    externalscaler::external_scaler_server::ExternalScalerServer,
    v1::{
        campaign_service_server::CampaignServiceServer, checkpoint_service_server::CheckpointServiceServer,
        evaluation_service_server::EvaluationServiceServer, label_service_server::LabelServiceServer,
        node_service_server::NodeServiceServer, study_service_server::StudyServiceServer,
        trainer_service_server::TrainerServiceServer, transfer_service_server::TransferServiceServer,
        worker_service_server::WorkerServiceServer,
    },
};
use murmuration_service::{
    CampaignApi, CheckpointApi, EvaluationApi, LabelApi, NodeApi, ScalerApi, StudyApi, TrainerApi,
    TransferApi, WorkerApi,
};

const VIEWER: Requirement = Requirement::VIEWER;
const ANNOTATOR: Requirement = Requirement::ANNOTATOR;
const OPERATOR: Requirement = Requirement::OPERATOR;

const CAMPAIGNS: MethodRequirements = &[
    ("CreateCampaign", OPERATOR, Decision),
    ("GetCampaign", VIEWER, Light),
    ("ListCampaigns", VIEWER, Reading),
    ("WatchCampaign", VIEWER, Streaming),
    ("PauseCampaign", OPERATOR, Decision),
    ("ResumeCampaign", OPERATOR, Decision),
    ("CancelCampaign", OPERATOR, Decision),
    ("DeleteCampaign", OPERATOR, Decision),
    ("AdoptCheckpoint", OPERATOR, Decision),
    ("RefineCampaign", OPERATOR, Decision),
    ("ExtendCampaign", OPERATOR, Decision),
    ("NoteCampaign", ANNOTATOR, Decision),
    ("ListGenerations", VIEWER, Reading),
    ("GetArchive", VIEWER, Reading),
    ("GetDigest", VIEWER, Reading),
    ("GetTaxonomy", VIEWER, Reading),
    ("GetIndividual", VIEWER, Light),
    ("GetReplay", VIEWER, Computing),
    ("FindNearest", VIEWER, Computing),
];

const CHECKPOINTS: MethodRequirements = &[
    ("ListCheckpoints", VIEWER, Reading),
    ("GetCheckpoint", AnyMachineOr(Role::Viewer), Light),
    ("FetchCheckpoint", AnyMachineOr(Role::Viewer), Reading),
    ("PublishCheckpoint", MachineOr(Trainer, Role::Operator), Decision),
];

const EVALUATIONS: MethodRequirements = &[
    ("Evaluate", OPERATOR, Streaming),
    ("Simulate", OPERATOR, Computing),
];

const LABELS: MethodRequirements = &[
    ("AppendLabels", ANNOTATOR, Decision),
    ("AppendSyntheticLabels", ANNOTATOR, Bulk),
    ("UndoLabels", ANNOTATOR, Bulk),
    ("WithdrawLabels", ANNOTATOR, Bulk),
    ("ListLabels", VIEWER, Reading),
    ("ListLabelEntries", VIEWER, Reading),
    ("ListClasses", VIEWER, Reading),
    ("ChangeClass", ANNOTATOR, Decision),
    ("NextQueries", ANNOTATOR, Computing),
    ("GetAgreement", VIEWER, Reading),
];

const TRANSFERS: MethodRequirements = &[
    ("ExportCampaign", VIEWER, Reading),
    ("ImportCampaign", OPERATOR, Reading),
];

const STUDIES: MethodRequirements = &[
    ("ListStudies", VIEWER, Light),
    ("GetStudy", VIEWER, Reading),
    ("KeepStudy", OPERATOR, Reading),
];

const NODES: MethodRequirements = &[
    ("ListNodes", VIEWER, Reading),
    ("GetDemand", AnyMachineOr(Role::Viewer), Light),
];

const SCALER: MethodRequirements = &[
    ("IsActive", AnyMachineOr(Role::Viewer), Light),
    ("StreamIsActive", AnyMachineOr(Role::Viewer), Streaming),
    ("GetMetricSpec", AnyMachineOr(Role::Viewer), Light),
    ("GetMetrics", AnyMachineOr(Role::Viewer), Light),
];

const WORKERS: MethodRequirements = &[("Work", Machine(Worker), CostClass::Free)];

const TRAINERS: MethodRequirements = &[
    ("Train", Machine(Trainer), CostClass::Free),
    ("FetchTraining", Machine(Trainer), Reading),
];

pub(super) const HEALTH: MethodRequirements = &[("Check", Nothing, Light), ("Watch", Nothing, Streaming)];

pub(super) const REFLECTION: MethodRequirements = &[("ServerReflectionInfo", VIEWER, Streaming)];

/// The coordinator's own services.
pub(super) struct Services {
    pub(super) campaigns: CampaignApi,
    pub(super) checkpoints: CheckpointApi,
    pub(super) evaluations: EvaluationApi,
    pub(super) labels: LabelApi,
    pub(super) workers: WorkerApi,
    pub(super) trainers: TrainerApi,
    pub(super) transfers: TransferApi,
    pub(super) studies: StudyApi,
    pub(super) nodes: NodeApi,
    pub(super) scaler: ScalerApi,
}

impl Services {
    /// The routes of all services, with the requirements of their methods.
    pub(super) fn routes(self) -> GuardedRouter {
        // The endpoint limits messages by the requirement of their method. The library's own limit (4 MiB) is raised for methods
        // that allow more.
        let labels =
            LabelServiceServer::new(self.labels).max_decoding_message_size(limits::MAX_LABEL_MESSAGE);
        let workers =
            WorkerServiceServer::new(self.workers).max_decoding_message_size(limits::MAX_WORKER_MESSAGE);
        GuardedRouter::default()
            .service(CampaignServiceServer::new(self.campaigns), CAMPAIGNS)
            .service(CheckpointServiceServer::new(self.checkpoints), CHECKPOINTS)
            .service(EvaluationServiceServer::new(self.evaluations), EVALUATIONS)
            .service(labels, LABELS)
            .service(workers, WORKERS)
            .service(TrainerServiceServer::new(self.trainers), TRAINERS)
            .service(TransferServiceServer::new(self.transfers), TRANSFERS)
            .service(StudyServiceServer::new(self.studies), STUDIES)
            .service(NodeServiceServer::new(self.nodes), NODES)
            .service(ExternalScalerServer::new(self.scaler), SCALER)
    }
}
