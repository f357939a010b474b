//! The gRPC services: they validate requests, call the component in charge, and convert its answer.

mod campaigns;
mod checkpoints;
mod evaluations;
mod labels;
mod nearest;
pub mod nodes;
mod recent;
pub mod report_data;
mod scaler;
mod simulations;
mod snapshots;
mod status;
mod studies;
mod training;
mod transfers;
mod work;

pub use campaigns::CampaignApi;
pub use checkpoints::CheckpointApi;
pub use evaluations::EvaluationApi;
pub use labels::LabelApi;
pub use nearest::OtherBehaviour;
pub use nodes::NodeApi;
pub use recent::{Followed, Recent};
pub use scaler::ScalerApi;
pub use status::{IntoStatus, OrStatus, blame_the_client};
pub use studies::StudyApi;
pub use training::TrainerApi;
pub use transfers::TransferApi;
pub use work::WorkerApi;

use murmuration_dispatch::LeaseNumber;
use murmuration_engine::blocking::spawn;
use murmuration_proto::v1;
use murmuration_swarm::Invalid;
use std::pin::Pin;
use tokio::sync::mpsc;
use tokio_stream::{Stream, wrappers::ReceiverStream};
use tonic::{Response, Status};

/// A server's stream of messages.
type Streamed<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// An answer in parts.
fn in_parts<T: Send + 'static>(
    parts: impl IntoIterator<Item = T, IntoIter: Send + 'static>,
) -> Response<Streamed<T>> {
    Response::new(Box::pin(tokio_stream::iter(parts.into_iter().map(Ok))))
}

/// An answer that is read part by part while its client takes it. `read` gets the beginning of the next part, from 0, and returns
/// the part and the beginning of the following part.
fn as_taken<T, R>(mut read: impl FnMut(u64) -> R + Send + 'static) -> Response<Streamed<T>>
where
    T: Send + 'static,
    R: Future<Output = Result<(T, Option<u64>), Status>> + Send,
{
    let (parts, stream) = mpsc::channel(2);
    spawn(async move {
        let mut next = Some(0);
        while let Some(begins) = next {
            let (part, following) = match read(begins).await {
                Ok((part, following)) => (Ok(part), following),
                Err(error) => (Err(error), None),
            };
            if parts.send(part).await.is_err() {
                return;
            }
            next = following;
        }
    });
    Response::new(Box::pin(ReceiverStream::new(stream)))
}

/// The number of the lease in `field`, and the coordinator's epoch in which the lease was granted.
fn lease_id(lease: Option<v1::LeaseId>, field: &str) -> Result<(u64, LeaseNumber), Invalid> {
    let lease = lease.ok_or_else(|| Invalid::missing(field, "a lease id"))?;
    Ok((lease.epoch, LeaseNumber(lease.number)))
}
