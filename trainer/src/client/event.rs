//! Events of a training, and its outcome.

use murmuration_link::may_pass_elsewhere;
use murmuration_proto::v1::{self, batch_result::Outcome};
use std::fmt;
use tokio::task::JoinError;
use tonic::Status;

#[derive(Debug)]
pub(super) enum Event {
    Progress(v1::TrainingProgress),
    /// A snapshot of the training after `epoch` epochs.
    Snapshot {
        epoch: u64,
        bytes: Vec<u8>,
    },
    Done(Outcome),
}

/// Why a training failed.
#[derive(Debug)]
pub(super) struct Undone {
    class: v1::FailureClass,
    message: String,
}

impl Undone {
    /// As far as this trainer can judge, the training would fail on every trainer. The coordinator tries another trainer.
    pub(super) fn fatal(message: impl fmt::Display) -> Self {
        Self {
            class: v1::FailureClass::Fatal,
            message: message.to_string(),
        }
    }

    /// Another trainer, or a later attempt, may succeed.
    pub(super) fn retryable(message: impl fmt::Display) -> Self {
        Self {
            class: v1::FailureClass::Retryable,
            message: message.to_string(),
        }
    }

    /// A call failed for good, or the coordinator was unavailable for too long, or did not admit this trainer.
    pub(super) fn call(what: &str, status: &Status) -> Self {
        let message = format!("{what}: {}", status.message());
        match may_pass_elsewhere(status) {
            true => Self::retryable(message),
            false => Self::fatal(message),
        }
    }
}

impl fmt::Display for Undone {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<JoinError> for Undone {
    fn from(error: JoinError) -> Self {
        Self::fatal(format!("the training broke: {error}"))
    }
}

impl From<Undone> for Outcome {
    fn from(Undone { class, message }: Undone) -> Self {
        Self::Failure(v1::Failure {
            class: class.into(),
            message,
        })
    }
}
