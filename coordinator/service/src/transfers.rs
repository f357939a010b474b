//! The export and import of whole campaigns.

use super::Streamed;
use crate::status::{IntoStatus, OrStatus as _};
use murmuration_engine::{
    blocking::{in_background, spawn},
    campaign::Campaigns,
};
use murmuration_model::CampaignId;
use murmuration_proto::{PART_BYTES, v1};
use murmuration_store::{
    Store,
    checkpoints::Checkpoints,
    transfer::{Arriving, ImportError, Unsound, export},
};
use murmuration_swarm::{Invalid, counted};
use std::{
    io::Read as _,
    path::Path,
    sync::Arc,
    time::{Duration, Instant},
};
use tokio::{
    sync::{Semaphore, mpsc},
    time::timeout_at,
};
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Implements `murmuration.v1.TransferService`.
#[derive(Debug, Clone)]
pub struct TransferApi {
    pub campaigns: Campaigns,
    pub store: Store,
    /// The store of checkpoints.
    pub checkpoints: Checkpoints,
    /// The data directory, in which databases of campaigns are assembled.
    pub data: Arc<Path>,
    /// Permits for exports. Each export has a copy of its campaign on disk until the client has taken the export.
    pub exports: Arc<Semaphore>,
}

/// Time that a client has to take an export, in addition to the time for the export's bytes.
const EXPORT_TIME: Duration = Duration::from_secs(60);
/// Slowest pace of a client that takes an export, in bytes a second.
const EXPORT_PACE: u64 = 1 << 20;

#[tonic::async_trait]
impl v1::transfer_service_server::TransferService for TransferApi {
    type ExportCampaignStream = Streamed<v1::CampaignPart>;

    async fn export_campaign(
        &self,
        request: Request<v1::ExportCampaignRequest>,
    ) -> Result<Response<Self::ExportCampaignStream>, Status> {
        let id = request.into_inner().campaign;
        let record = self.store.run(move |store| store.campaign(&id)).await;
        let record = record.or_status()?;
        let (parts, stream) = mpsc::channel(2);
        let api = self.clone();
        spawn(async move {
            if let Err(status) = api.send(record.id, &parts).await {
                // The client may have disconnected.
                let _ = parts.send(Err(status)).await;
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }

    async fn import_campaign(
        &self,
        request: Request<Streaming<v1::CampaignPart>>,
    ) -> Result<Response<v1::Campaign>, Status> {
        let mut parts = request.into_inner();
        let first = next(&mut parts).await?.unwrap_or_default();
        let campaign: CampaignId = first.campaign.parse()?;
        let begun = Arriving::begin(&self.store, &self.data, campaign).await;
        let mut arriving = begun.or_status()?.add(first.data).await.or_status()?;
        while let Some(part) = next(&mut parts).await? {
            arriving = arriving.add(part.data).await.or_status()?;
        }
        let id = arriving.finish(&self.checkpoints).await.or_status()?;
        let status = self.campaigns.status(id.as_str()).await.or_status()?;
        Ok(Response::new(status.into()))
    }
}

impl TransferApi {
    /// Maximum number of exports at once.
    pub const MOST_EXPORTS: usize = 2;

    /// Sends the database of a campaign.
    async fn send(
        &self,
        campaign: CampaignId,
        parts: &mpsc::Sender<Result<v1::CampaignPart, Status>>,
    ) -> Result<(), Status> {
        let ending = |_| Status::unavailable("the coordinator is shutting down");
        let _place = tokio::select! {
            place = Arc::clone(&self.exports).acquire_owned() => place.map_err(ending)?,
            () = parts.closed() => return Ok(()),
        };
        let mut file = export(&self.store, &self.checkpoints, &self.data, &campaign)
            .await
            .or_status()?;
        let mut campaign = campaign.to_string();
        let (begun, mut sent) = (Instant::now(), 0);
        loop {
            let read;
            (file, read) = in_background(move |_| {
                let mut data = Vec::new();
                let read = (&mut file).take(PART_BYTES as u64).read_to_end(&mut data);
                (file, read.map(|_| data))
            })
            .await
            .or_status()?;
            let data = read.map_err(|error| Status::internal(format!("cannot read the export: {error}")))?;
            if data.is_empty() {
                return Ok(());
            }
            let campaign = std::mem::take(&mut campaign);
            sent += data.len() as u64;
            let until = begun + EXPORT_TIME + Duration::from_secs(sent / EXPORT_PACE);
            let part = v1::CampaignPart { campaign, data };
            match timeout_at(until.into(), parts.send(Ok(part))).await {
                Ok(Ok(())) => {}
                Ok(Err(_)) => return Ok(()),
                Err(_) => {
                    let message = "the export was taken too slowly, and others wait for its place";
                    return Err(Status::deadline_exceeded(message));
                }
            }
        }
    }
}

async fn next(parts: &mut Streaming<v1::CampaignPart>) -> Result<Option<v1::CampaignPart>, Status> {
    match parts.message().await? {
        Some(part) if part.data.len() > PART_BYTES => {
            let found = counted(part.data.len() as u64, "byte");
            Err(Invalid::new("data", found, format!("at most {PART_BYTES} bytes a part")).into())
        }
        part => Ok(part),
    }
}

impl IntoStatus for ImportError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            Self::Store(error) => error.into_status(),
            Self::Checkpoint(error) => error.into_status(),
            Self::Exists(_) => Status::already_exists(message),
            Self::Unsound(Unsound::Digest { .. }) => Status::data_loss(message),
            Self::Unsound(_) => Status::invalid_argument(message),
        }
    }
}
