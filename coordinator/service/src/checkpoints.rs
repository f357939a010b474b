//! The service for checkpoints: trainers publish them, workers fetch them, people list them.

use super::{Streamed, in_parts};
use crate::status::{IntoStatus as _, OrStatus as _};
use bytes::{Bytes, BytesMut};
use murmuration_access::ByCertificate;
use murmuration_dispatch::{Publication, Trainers};
use murmuration_onnx::MAX_MODEL_BYTES;
use murmuration_proto::{PART_BYTES, parts::parts, v1};
use murmuration_store::checkpoints::{CheckpointError, Checkpoints};
use murmuration_swarm::{CheckpointDigest, Invalid, Lineage};
use tonic::{Request, Response, Status, Streaming};

/// Implements `murmuration.v1.CheckpointService`.
#[derive(Debug, Clone)]
pub struct CheckpointApi {
    /// The store of checkpoints.
    pub checkpoints: Checkpoints,
    /// The dispatcher that leases trainings to the trainers that publish checkpoints.
    pub trainers: Trainers,
}

#[tonic::async_trait]
impl v1::checkpoint_service_server::CheckpointService for CheckpointApi {
    type ListCheckpointsStream = Streamed<v1::ListCheckpointsResponse>;

    async fn list_checkpoints(
        &self,
        _: Request<v1::ListCheckpointsRequest>,
    ) -> Result<Response<Self::ListCheckpointsStream>, Status> {
        let checkpoints = self
            .checkpoints
            .list()
            .await
            .or_status()?
            .into_iter()
            .map(|record| v1::Checkpoint {
                labelled: Vec::new(),
                ..record.into()
            });
        let part = |checkpoints| v1::ListCheckpointsResponse { checkpoints };
        Ok(in_parts(parts(checkpoints, part)))
    }

    async fn get_checkpoint(
        &self,
        request: Request<v1::GetCheckpointRequest>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        let digest = request.get_ref().digest.parse::<CheckpointDigest>()?;
        Ok(Response::new(
            self.checkpoints.describe(digest).await.or_status()?.into(),
        ))
    }

    type FetchCheckpointStream = Streamed<v1::CheckpointChunk>;

    async fn fetch_checkpoint(
        &self,
        request: Request<v1::FetchCheckpointRequest>,
    ) -> Result<Response<Self::FetchCheckpointStream>, Status> {
        let digest = request.get_ref().digest.parse::<CheckpointDigest>()?;
        let mut rest = self.checkpoints.fetch(digest).await.or_status()?;
        let chunks = std::iter::from_fn(move || {
            let data = rest.split_to(PART_BYTES.min(rest.len())).to_vec();
            (!data.is_empty()).then_some(Ok(v1::CheckpointChunk { data }))
        });
        Ok(Response::new(Box::pin(tokio_stream::iter(chunks))))
    }

    async fn publish_checkpoint(
        &self,
        request: Request<Streaming<v1::PublishCheckpointRequest>>,
    ) -> Result<Response<v1::Checkpoint>, Status> {
        let trainer = request.extensions().get::<ByCertificate>().copied();
        let mut parts = request.into_inner();
        let first = parts.message().await?.and_then(|first| first.part);
        let Some(v1::publish_checkpoint_request::Part::Description(description)) = first else {
            return Err(Status::invalid_argument(
                "the first message must be the description",
            ));
        };
        let announced = description.digest.parse::<CheckpointDigest>()?;
        let lineage = Lineage::try_from(description)?;
        let bytes = collect(&mut parts).await?;
        let found = CheckpointDigest::of(&bytes);
        if found != announced {
            return Err(CheckpointError::Mismatch {
                wanted: announced,
                found,
            }
            .into_status());
        }
        if let Some(ByCertificate(machine)) = trainer {
            let publication = Publication {
                machine,
                configuration: lineage.configuration.clone(),
                parent: lineage.parent,
                bytes: bytes.len(),
            };
            if !self.trainers.dispatch().may_publish(publication).await {
                let message = "this trainer does not hold the lease of a training with this result";
                return Err(Status::permission_denied(message));
            }
        }
        Ok(Response::new(
            self.checkpoints.publish(lineage, bytes).await.or_status()?.into(),
        ))
    }
}

async fn collect(parts: &mut Streaming<v1::PublishCheckpointRequest>) -> Result<Bytes, Status> {
    let mut bytes = BytesMut::new();
    while let Some(message) = parts.message().await? {
        let Some(v1::publish_checkpoint_request::Part::Chunk(chunk)) = message.part else {
            return Err(Status::invalid_argument("only chunks may follow the description"));
        };
        if bytes.len() + chunk.data.len() > MAX_MODEL_BYTES {
            let allowed = format!("at most {MAX_MODEL_BYTES} bytes");
            return Err(Invalid::new("checkpoint", "more", allowed).into());
        }
        bytes.extend_from_slice(&chunk.data);
    }
    Ok(bytes.freeze())
}
