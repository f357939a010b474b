//! The gRPC services: validate at the edge, ask the component that knows, translate the answer.

mod campaigns;
mod messages;
mod work;

pub use campaigns::CampaignApi;
pub use work::WorkerApi;
