//! The gRPC services: validate at the edge, ask the component that knows, translate the answer.

mod campaigns;
mod checkpoints;
mod evaluations;
mod labels;
mod lease_id;
mod nearest;
mod permits;
pub mod report_data;
mod simulations;
mod snapshots;
mod spread;
mod status;
mod training;
mod transfers;
mod unreadable;
mod work;

pub use campaigns::CampaignApi;
pub use checkpoints::CheckpointApi;
pub use evaluations::EvaluationApi;
pub use labels::LabelApi;
pub use nearest::OtherBehaviour;
pub use permits::{Permit, Permits, is_over};
pub use status::{IntoStatus, OrStatus};
pub use training::TrainerApi;
pub use transfers::TransferApi;
pub use unreadable::blame_the_client;
pub use work::WorkerApi;

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
