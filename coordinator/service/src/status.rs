//! Converts errors of the other crates to gRPC statuses, and blames clients for unreadable messages.

use axum::{extract::Request, middleware::Next, response::Response};
use murmuration_dispatch::{JobError, JoinError};
use murmuration_engine::{
    blocking::Broken, campaign::CampaignError, maps::MapError, queries::QueryError, space::SpaceError,
};
use murmuration_model::labels::Refusal;
use murmuration_store::{LabelError, StoreError, checkpoints::CheckpointError};
use murmuration_swarm::Text;
use tonic::{Code, Status};

pub trait IntoStatus {
    fn into_status(self) -> Status;
}

/// Results whose error has a status.
pub trait OrStatus<T> {
    /// The result with its error converted to a status.
    ///
    /// # Errors
    /// The error of `self`, as a status.
    fn or_status(self) -> Result<T, Status>;
}

impl<T, E: IntoStatus> OrStatus<T> for Result<T, E> {
    fn or_status(self) -> Result<T, Status> {
        self.map_err(IntoStatus::into_status)
    }
}

impl IntoStatus for StoreError {
    fn into_status(self) -> Status {
        // The message repeats the request's text, which may have any length.
        let message = Text::line(&self.to_string());
        match self {
            StoreError::NoCampaign(_)
            | StoreError::NoStudy(_)
            | StoreError::NoCheckpoint(_)
            | StoreError::NoIndividual { .. } => Status::not_found(message),
            StoreError::DiskFull { .. }
            | StoreError::Unwritable { .. }
            | StoreError::ReadOnly { .. }
            | StoreError::Locked { .. }
            | StoreError::NoMirror { .. } => Status::resource_exhausted(message),
            StoreError::OtherRequest { .. } => Status::already_exists(message),
            // Another coordinator has the data now.
            StoreError::Interrupted(_)
            | StoreError::TakenOver(_)
            | StoreError::Replaced(_)
            | StoreError::MirrorTaken(_)
            | StoreError::Unmirrored { .. } => Status::unavailable(message),
            StoreError::Damaged { .. } => Status::data_loss(message),
            StoreError::InUse { .. }
            | StoreError::NoDirectory(_)
            | StoreError::NoFolder(_)
            | StoreError::Mirrored { .. }
            | StoreError::ReadsOnly(_)
            | StoreError::Newer { .. }
            | StoreError::Unshared { .. }
            | StoreError::Superseded(_) => Status::failed_precondition(message),
            StoreError::File { .. }
            | StoreError::Broken(_)
            | StoreError::Compression(_)
            | StoreError::Sqlite { .. } => Status::internal(message),
        }
    }
}

impl IntoStatus for Broken {
    fn into_status(self) -> Status {
        Status::internal(self.to_string())
    }
}

impl IntoStatus for JobError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            JobError::Fatal(_) | JobError::Poisoned(_) => Status::failed_precondition(message),
            JobError::Disagreement { .. } => Status::data_loss(message),
            JobError::NoWorker | JobError::ShuttingDown => Status::unavailable(message),
        }
    }
}

impl IntoStatus for CampaignError {
    fn into_status(self) -> Status {
        match self {
            CampaignError::Store(error) => error.into_status(),
            CampaignError::Job(error) => error.into_status(),
            CampaignError::Checkpoint(error) => error.into_status(),
            CampaignError::Query(error) => error.into_status(),
            CampaignError::Label(error) => error.into_status(),
            CampaignError::NotNoted(_) => Status::invalid_argument(self.to_string()),
            CampaignError::NotAllowed(_)
            | CampaignError::NotDeleted(_)
            | CampaignError::NotExtended { .. }
            | CampaignError::AfterFeedback(_)
            | CampaignError::OfStudy { .. }
            | CampaignError::NoEmbedding { .. }
            | CampaignError::OtherSimulator { .. }
            | CampaignError::NoEmbedder(_)
            | CampaignError::TooFewClasses { .. }
            | CampaignError::Untrainable { .. }
            | CampaignError::Tainted { .. }
            | CampaignError::Propose(_) => Status::failed_precondition(self.to_string()),
            CampaignError::Interrupted(_) => Status::unavailable(self.to_string()),
            CampaignError::Misfit(_) | CampaignError::Broken => Status::internal(self.to_string()),
        }
    }
}

impl IntoStatus for LabelError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            LabelError::Store(error) => error.into_status(),
            LabelError::OtherRequest(_) | LabelError::Refused(Refusal::ClassExists(_)) => {
                Status::already_exists(message)
            }
            LabelError::Refused(Refusal::NoClass(_)) => Status::not_found(message),
            LabelError::Refused(Refusal::IntoItself(_)) => Status::invalid_argument(message),
            LabelError::OverBudget(_)
            | LabelError::Refused(Refusal::TooManyClasses(_) | Refusal::Full { .. }) => {
                Status::resource_exhausted(message)
            }
            LabelError::Refused(
                Refusal::NothingToUndo(_) | Refusal::NothingToWithdraw { .. } | Refusal::NotNewestChange(_),
            ) => Status::failed_precondition(message),
        }
    }
}

impl IntoStatus for SpaceError {
    fn into_status(self) -> Status {
        match self {
            Self::Store(error) => error.into_status(),
            Self::Misfit(error) => Status::internal(error.to_string()),
            Self::Interrupted(error) => Status::unavailable(error.to_string()),
        }
    }
}

impl IntoStatus for MapError {
    fn into_status(self) -> Status {
        match self {
            Self::Space(error) => error.into_status(),
            Self::Broken(error) => error.into_status(),
        }
    }
}

impl IntoStatus for QueryError {
    fn into_status(self) -> Status {
        match self {
            Self::Store(error) => error.into_status(),
            Self::Space(error) => error.into_status(),
            Self::Broken => Status::internal(self.to_string()),
        }
    }
}

impl IntoStatus for CheckpointError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            CheckpointError::Store(error) => error.into_status(),
            CheckpointError::Model(_) => Status::invalid_argument(message),
            CheckpointError::Mismatch { .. }
            | CheckpointError::Missing { .. }
            | CheckpointError::Damaged { .. } => Status::data_loss(message),
            CheckpointError::Location { .. } | CheckpointError::Pictures { .. } => {
                Status::failed_precondition(message)
            }
            CheckpointError::Objects(_) => Status::unavailable(message),
        }
    }
}

impl IntoStatus for JoinError {
    fn into_status(self) -> Status {
        match self {
            JoinError::ShuttingDown => Status::unavailable(self.to_string()),
            JoinError::Quarantined(_) => Status::failed_precondition(self.to_string()),
        }
    }
}

/// Beginning of tonic's error about an unreadable message. Tonic blames the server (INTERNAL), but the client's message is at
/// fault.
const UNREADABLE: &str = "failed to decode Protobuf message";

/// Blames the client for a message that is unreadable before the answer begins.
pub async fn blame_the_client(request: Request, next: Next) -> Response {
    let answer = next.run(request).await;
    match Status::from_header_map(answer.headers()) {
        Some(status) if is_unreadable(&status) => blamed(status).into_http(),
        _ => answer,
    }
}

/// Blames the client for a message that is unreadable later on a stream.
pub(super) fn blamed(status: Status) -> Status {
    match is_unreadable(&status) {
        true => Status::invalid_argument(Text::line(status.message())),
        false => status,
    }
}

fn is_unreadable(status: &Status) -> bool {
    status.code() == Code::Internal && status.message().starts_with(UNREADABLE)
}
