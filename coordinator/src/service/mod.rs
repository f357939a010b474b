//! The gRPC services: validate at the edge, ask the component that knows, translate the answer.

mod campaigns;
mod checkpoints;
mod labels;
mod messages;
mod training;
mod work;

pub use campaigns::CampaignApi;
pub use checkpoints::CheckpointApi;
pub use labels::LabelApi;
pub(crate) use labels::MAX_LABEL_MESSAGE;
pub use training::TrainerApi;
pub use work::WorkerApi;

use std::pin::Pin;
use tokio_stream::Stream;
use tonic::Status;

/// A server's stream of messages.
type Streamed<T> = Pin<Box<dyn Stream<Item = Result<T, Status>> + Send>>;
