//! The gRPC services: validate at the edge, ask the component that knows, translate the answer.

mod campaigns;
mod checkpoints;
mod labels;
mod messages;
mod seats;
mod training;
mod work;

pub use campaigns::CampaignApi;
pub use checkpoints::CheckpointApi;
pub use labels::LabelApi;
pub(crate) use seats::Seat;
pub use seats::Seats;
pub use training::TrainerApi;
pub use work::WorkerApi;

use std::pin::Pin;
use tokio_stream::Stream;
use tonic::Status;

/// A server's stream of messages.
type Streamed<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;
