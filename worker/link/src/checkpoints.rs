//! Fetches checkpoints from the coordinator.

use crate::{Calls, Coordinator, attempts, for_lease};
use murmuration_onnx::MAX_MODEL_BYTES;
use murmuration_proto::v1::{self, checkpoint_service_client::CheckpointServiceClient};
use murmuration_swarm::CheckpointDigest;
use tonic::Status;

/// Fetches the bytes of a checkpoint for `lease`, at most [`MAX_MODEL_BYTES`], without checking them. Tries again if the
/// coordinator is unavailable for a moment.
///
/// # Errors
/// Fails if the coordinator has no checkpoint with this digest, or is unavailable for too long.
pub async fn fetch_checkpoint(
    calls: &Calls,
    digest: CheckpointDigest,
    lease: v1::LeaseId,
) -> Result<Vec<u8>, Status> {
    attempts(|| receive(calls.coordinator(), digest, lease)).await
}

async fn receive(
    coordinator: Result<Coordinator, Status>,
    digest: CheckpointDigest,
    lease: v1::LeaseId,
) -> Result<Vec<u8>, Status> {
    let request = v1::FetchCheckpointRequest {
        digest: digest.to_string(),
    };
    let mut chunks = CheckpointServiceClient::new(coordinator?)
        .fetch_checkpoint(for_lease(request, lease))
        .await?
        .into_inner();
    let mut bytes = Vec::new();
    while let Some(chunk) = chunks.message().await? {
        if bytes.len() + chunk.data.len() > MAX_MODEL_BYTES {
            return Err(Status::data_loss(format!(
                "more than {MAX_MODEL_BYTES} bytes came"
            )));
        }
        bytes.extend_from_slice(&chunk.data);
    }
    Ok(bytes)
}
