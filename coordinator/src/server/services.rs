//! The gRPC services of a coordinator, and what each of their methods requires.

use murmuration_access::{
    GuardedRouter,
    MachineKind::{Trainer, Worker},
    MethodRequirements,
    Requirement::{self, AnyMachineOr, Machine, MachineOr, Nothing},
    Role, limits,
};
use murmuration_proto::v1::{
    campaign_service_server::CampaignServiceServer, checkpoint_service_server::CheckpointServiceServer,
    evaluation_service_server::EvaluationServiceServer, label_service_server::LabelServiceServer,
    trainer_service_server::TrainerServiceServer, transfer_service_server::TransferServiceServer,
    worker_service_server::WorkerServiceServer,
};
use murmuration_service::{
    CampaignApi, CheckpointApi, EvaluationApi, LabelApi, TrainerApi, TransferApi, WorkerApi,
};

const VIEWER: Requirement = Requirement::VIEWER;
const ANNOTATOR: Requirement = Requirement::ANNOTATOR;
const OPERATOR: Requirement = Requirement::OPERATOR;

const CAMPAIGNS: MethodRequirements = &[
    ("CreateCampaign", OPERATOR),
    ("GetCampaign", VIEWER),
    ("ListCampaigns", VIEWER),
    ("WatchCampaign", VIEWER),
    ("PauseCampaign", OPERATOR),
    ("ResumeCampaign", OPERATOR),
    ("CancelCampaign", OPERATOR),
    ("DeleteCampaign", OPERATOR),
    ("AdoptCheckpoint", OPERATOR),
    ("RefineCampaign", OPERATOR),
    ("ListGenerations", VIEWER),
    ("GetArchive", VIEWER),
    ("GetDigest", VIEWER),
    ("GetTaxonomy", VIEWER),
    ("GetIndividual", VIEWER),
    ("GetReplay", VIEWER),
    ("FindNearest", VIEWER),
];

const CHECKPOINTS: MethodRequirements = &[
    ("ListCheckpoints", VIEWER),
    ("GetCheckpoint", AnyMachineOr(Role::Viewer)),
    ("FetchCheckpoint", AnyMachineOr(Role::Viewer)),
    ("PublishCheckpoint", MachineOr(Trainer, Role::Operator)),
];

const EVALUATIONS: MethodRequirements = &[("Evaluate", OPERATOR), ("Simulate", OPERATOR)];

const LABELS: MethodRequirements = &[
    ("AppendLabels", ANNOTATOR),
    ("AppendSyntheticLabels", ANNOTATOR),
    ("UndoLabels", ANNOTATOR),
    ("WithdrawLabels", ANNOTATOR),
    ("ListLabels", VIEWER),
    ("ListLabelEntries", VIEWER),
    ("ListClasses", VIEWER),
    ("ChangeClass", ANNOTATOR),
    ("NextQueries", ANNOTATOR),
    ("GetAgreement", VIEWER),
];

const TRANSFERS: MethodRequirements = &[("ExportCampaign", VIEWER), ("ImportCampaign", OPERATOR)];

const WORKERS: MethodRequirements = &[("Work", Machine(Worker))];

const TRAINERS: MethodRequirements = &[("Train", Machine(Trainer)), ("FetchTraining", Machine(Trainer))];

pub(super) const HEALTH: MethodRequirements = &[("Check", Nothing), ("Watch", Nothing)];

pub(super) const REFLECTION: MethodRequirements = &[("ServerReflectionInfo", VIEWER)];

/// The services that are a coordinator's own.
pub(super) struct Services {
    pub(super) campaigns: CampaignApi,
    pub(super) checkpoints: CheckpointApi,
    pub(super) evaluations: EvaluationApi,
    pub(super) labels: LabelApi,
    pub(super) workers: WorkerApi,
    pub(super) trainers: TrainerApi,
    pub(super) transfers: TransferApi,
}

impl Services {
    /// Each with its methods' requirements, and the longest message that it reads.
    pub(super) fn routes(self) -> GuardedRouter {
        let campaigns =
            CampaignServiceServer::new(self.campaigns).max_decoding_message_size(limits::MAX_MESSAGE);
        let checkpoints =
            CheckpointServiceServer::new(self.checkpoints).max_decoding_message_size(limits::MAX_MESSAGE);
        let evaluations =
            EvaluationServiceServer::new(self.evaluations).max_decoding_message_size(limits::MAX_MESSAGE);
        let labels =
            LabelServiceServer::new(self.labels).max_decoding_message_size(limits::MAX_LABEL_MESSAGE);
        let workers =
            WorkerServiceServer::new(self.workers).max_decoding_message_size(limits::MAX_WORKER_MESSAGE);
        let trainers =
            TrainerServiceServer::new(self.trainers).max_decoding_message_size(limits::MAX_MESSAGE);
        let transfers =
            TransferServiceServer::new(self.transfers).max_decoding_message_size(limits::MAX_MESSAGE);
        GuardedRouter::default()
            .service(campaigns, CAMPAIGNS)
            .service(checkpoints, CHECKPOINTS)
            .service(evaluations, EVALUATIONS)
            .service(labels, LABELS)
            .service(workers, WORKERS)
            .service(trainers, TRAINERS)
            .service(transfers, TRANSFERS)
    }
}
