//! How `study` asks a coordinator.

use super::super::connection::{CheckpointClient, Client, LabelClient};

/// How a coordinator is asked; cheap to clone.
#[derive(Clone)]
pub(super) struct Clients {
    pub(super) campaigns: Client,
    pub(super) checkpoints: CheckpointClient,
    pub(super) labels: LabelClient,
}
