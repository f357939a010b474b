//! Errors of the floors below, as gRPC says them, and messages that cannot be read.

use axum::{extract::Request, middleware::Next, response::Response};
use murmuration_dispatch::{JobError, JoinError};
use murmuration_engine::{blocking::Broken, campaign::CampaignError, queries::QueryError, space::SpaceError};
use murmuration_model::labels::Refusal;
use murmuration_proto::Text;
use murmuration_store::{LabelError, StoreError, checkpoints::CheckpointError};
use tonic::{Code, Status};

pub trait IntoStatus {
    /// The status for the client.
    fn into_status(self) -> Status;
}

/// Results whose error has a status.
pub trait OrStatus<T> {
    /// The same, with the status in the place of the error.
    ///
    /// # Errors
    /// Those of `self`.
    fn or_status(self) -> Result<T, Status>;
}

impl<T, E: IntoStatus> OrStatus<T> for Result<T, E> {
    fn or_status(self) -> Result<T, Status> {
        self.map_err(IntoStatus::into_status)
    }
}

impl IntoStatus for StoreError {
    fn into_status(self) -> Status {
        // It repeats what was asked for, which may be of any length.
        let said = Text::line(&self.to_string());
        match self {
            StoreError::NoCampaign(_) | StoreError::NoCheckpoint(_) | StoreError::NoIndividual { .. } => {
                Status::not_found(said)
            }
            StoreError::DiskFull { .. } | StoreError::Unwritable { .. } | StoreError::ReadOnly { .. } => {
                Status::resource_exhausted(said)
            }
            StoreError::OtherRequest { .. } => Status::already_exists(said),
            StoreError::Interrupted(_) => Status::unavailable(said),
            StoreError::Damaged { .. } => Status::data_loss(said),
            StoreError::InUse { .. }
            | StoreError::NoDirectory(_)
            | StoreError::NoFolder(_)
            | StoreError::Newer { .. }
            | StoreError::Superseded(_) => Status::failed_precondition(said),
            StoreError::File { .. } | StoreError::Compression(_) | StoreError::Sqlite { .. } => {
                Status::internal(said)
            }
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
        let said = self.to_string();
        match self {
            JobError::Fatal(_) | JobError::Poisoned(_) => Status::failed_precondition(said),
            JobError::Disagreement { .. } => Status::data_loss(said),
            JobError::NoWorker | JobError::ShuttingDown => Status::unavailable(said),
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
            CampaignError::NotAllowed(_)
            | CampaignError::NotDeleted(_)
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
        let said = self.to_string();
        match self {
            LabelError::Store(error) => error.into_status(),
            LabelError::OtherRequest(_) | LabelError::Refused(Refusal::ClassExists(_)) => {
                Status::already_exists(said)
            }
            LabelError::Refused(Refusal::NoClass(_)) => Status::not_found(said),
            LabelError::Refused(Refusal::IntoItself(_)) => Status::invalid_argument(said),
            LabelError::OverBudget(_)
            | LabelError::Refused(Refusal::TooManyClasses(_) | Refusal::Full { .. }) => {
                Status::resource_exhausted(said)
            }
            LabelError::Refused(
                Refusal::NothingToUndo(_) | Refusal::NothingToWithdraw { .. } | Refusal::NotNewestChange(_),
            ) => Status::failed_precondition(said),
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
        let said = self.to_string();
        match self {
            CheckpointError::Store(error) => error.into_status(),
            CheckpointError::Model(_) => Status::invalid_argument(said),
            CheckpointError::Mismatch { .. }
            | CheckpointError::Missing { .. }
            | CheckpointError::Damaged { .. } => Status::data_loss(said),
            CheckpointError::Location { .. } | CheckpointError::Pictures { .. } => {
                Status::failed_precondition(said)
            }
            CheckpointError::Objects(_) => Status::unavailable(said),
            CheckpointError::Broken => Status::internal(said),
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

/// Beginning of tonic's error about a message that cannot be read. It blames the server (INTERNAL); the client is told that its message is wrong.
const SAID: &str = "failed to decode Protobuf message";

/// Blames the client of a method for a message that could not be read before the answer began.
pub async fn blame_the_client(request: Request, next: Next) -> Response {
    let answer = next.run(request).await;
    match Status::from_header_map(answer.headers()) {
        Some(status) if is_unreadable(&status) => blamed(status).into_http(),
        _ => answer,
    }
}

/// The same for one that comes later on a stream.
pub(super) fn blamed(status: Status) -> Status {
    match is_unreadable(&status) {
        true => Status::invalid_argument(Text::line(status.message())),
        false => status,
    }
}

fn is_unreadable(status: &Status) -> bool {
    status.code() == Code::Internal && status.message().starts_with(SAID)
}
