//! The gRPC services: validate at the edge, ask the component that knows, translate the answer.

mod campaigns;
mod checkpoints;
mod evaluations;
mod labels;
mod nearest;
mod recent;
pub mod report_data;
mod simulations;
mod snapshots;
mod spread;
mod status;
mod training;
mod transfers;
mod work;

pub use campaigns::CampaignApi;
pub use checkpoints::CheckpointApi;
pub use evaluations::EvaluationApi;
pub use labels::LabelApi;
pub use nearest::OtherBehaviour;
pub use recent::{Followed, Recent};
pub use status::{IntoStatus, OrStatus, blame_the_client};
pub use training::TrainerApi;
pub use transfers::TransferApi;
pub use work::WorkerApi;

use murmuration_dispatch::LeaseNumber;
use murmuration_proto::{Invalid, v1};
use std::pin::Pin;
use tokio_stream::Stream;
use tonic::{Response, Status};

/// A server's stream of messages.
type Streamed<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;

/// An answer in these parts.
fn in_parts<T: Send + 'static>(
    parts: impl IntoIterator<Item = T, IntoIter: Send + 'static>,
) -> Response<Streamed<T>> {
    Response::new(Box::pin(tokio_stream::iter(parts.into_iter().map(Ok))))
}

/// The coordinator's epoch that the lease of `field` was given in, and its number.
fn lease_id(lease: Option<v1::LeaseId>, field: &str) -> Result<(u64, LeaseNumber), Invalid> {
    let lease = lease.ok_or_else(|| Invalid::missing(field, "a lease id"))?;
    Ok((lease.epoch, LeaseNumber(lease.number)))
}
