//! Whole campaigns, to a client that exports one, and from a client that imports one.

use super::{Permits, Streamed};
use crate::status::{IntoStatus, OrStatus as _};
use murmuration_engine::{blocking::blocking, campaign::Campaigns};
use murmuration_proto::{Invalid, PART_BYTES, v1};
use murmuration_store::{
    Store,
    checkpoints::Checkpoints,
    transfer::{ImportError, Incoming, Outgoing, OutgoingError, Part, Sequence},
};
use std::{path::Path, sync::Arc, time::Duration};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Time that a client has to send, or to take, the next part.
const PART_LIMIT: Duration = Duration::from_secs(60);

/// Implements `murmuration.v1.TransferService`.
#[derive(Debug, Clone)]
pub struct TransferApi {
    /// The registry.
    pub campaigns: Campaigns,
    /// What is on disk.
    pub store: Store,
    /// Where embedders are.
    pub checkpoints: Checkpoints,
    /// The data directory, in which imported campaigns are put together.
    pub data: Arc<Path>,
    /// How many may export or import at once.
    pub permits: Permits,
}

#[tonic::async_trait]
impl v1::transfer_service_server::TransferService for TransferApi {
    type ExportCampaignStream = Streamed<v1::CampaignPart>;

    async fn export_campaign(
        &self,
        request: Request<v1::ExportCampaignRequest>,
    ) -> Result<Response<Self::ExportCampaignStream>, Status> {
        let permit = self.permits.export()?;
        let (store, id) = (self.store.clone(), request.into_inner().campaign);
        let outgoing = blocking(move || Outgoing::of(&store, &id))
            .await
            .or_status()?
            .or_status()?;
        let (parts, stream) = mpsc::channel(2);
        let checkpoints = self.checkpoints.clone();
        tokio::spawn(async move {
            let _held = permit;
            if let Err(status) = send(outgoing, &checkpoints, &parts).await {
                // The receiver is gone, or gets the status; one that takes nothing is not waited for.
                let _ = tokio::time::timeout(PART_LIMIT, parts.send(Err(status))).await;
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }

    async fn import_campaign(
        &self,
        request: Request<Streaming<v1::CampaignPart>>,
    ) -> Result<Response<v1::Campaign>, Status> {
        let _permit = self.permits.import()?;
        let mut parts = request.into_inner();
        let first = next(&mut parts).await?.unwrap_or_default();
        let (mut sequence, first) = checked(Sequence::default(), first).await?;
        let Part::Campaign(campaign) = first else {
            let allowed = "the campaign, in the first part";
            return Err(Invalid::new("part", "something else", allowed).into());
        };
        let mut incoming = Incoming::begin(&self.store, &self.data, *campaign)
            .await
            .or_status()?;
        while let Some(message) = next(&mut parts).await? {
            let part;
            (sequence, part) = checked(sequence, message).await?;
            match sequence.take_checkpoint() {
                Some((record, bytes)) => incoming.add_checkpoint(record, bytes).await,
                None => incoming.add(part).await,
            }
            .or_status()?;
        }
        sequence.end()?;
        let id = incoming
            .finish(self.store.clone(), &self.checkpoints)
            .await
            .or_status()?;
        let status = self.campaigns.status(id.as_str()).await.or_status()?;
        Ok(Response::new(status.into()))
    }
}

/// The next part of a sequence, checked on a thread that may compute: to check a checkpoint, all of it is read.
async fn checked(mut sequence: Sequence, message: v1::CampaignPart) -> Result<(Sequence, Part), Status> {
    let (sequence, part) = blocking(move || {
        let part = sequence.next(message);
        (sequence, part)
    })
    .await
    .or_status()?;
    Ok((sequence, part?))
}

/// Sends everything of a campaign.
async fn send(
    mut outgoing: Outgoing,
    checkpoints: &Checkpoints,
    parts: &mpsc::Sender<Result<v1::CampaignPart, Status>>,
) -> Result<(), Status> {
    let campaign = Part::Campaign(Box::new(outgoing.campaign().clone()));
    send_part(parts, campaign).await?;
    for record in outgoing.checkpoints().to_vec() {
        let bytes = checkpoints.fetch(record.digest).await.or_status()?;
        send_part(parts, Part::Checkpoint(record)).await?;
        for chunk in bytes.chunks(PART_BYTES) {
            send_part(parts, Part::Chunk(chunk.to_vec())).await?;
        }
    }
    loop {
        let (read, next) = blocking(move || {
            let next = outgoing.next_part();
            (outgoing, next)
        })
        .await
        .or_status()?;
        outgoing = read;
        match next.or_status()? {
            Some(part) => send_part(parts, part).await?,
            None => return Ok(()),
        }
    }
}

/// Sends a part to a client that takes it in time.
async fn send_part(parts: &mpsc::Sender<Result<v1::CampaignPart, Status>>, part: Part) -> Result<(), Status> {
    match tokio::time::timeout(PART_LIMIT, parts.send(Ok(part.into()))).await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) => Err(Status::cancelled("the client is gone")),
        Err(_) => Err(Status::deadline_exceeded(
            "the client did not take the next part of the campaign within 60 seconds",
        )),
    }
}

async fn next(parts: &mut Streaming<v1::CampaignPart>) -> Result<Option<v1::CampaignPart>, Status> {
    tokio::time::timeout(PART_LIMIT, parts.message())
        .await
        .map_err(|_| Status::deadline_exceeded("no part of the campaign within 60 seconds"))?
}

impl IntoStatus for OutgoingError {
    fn into_status(self) -> Status {
        let message = self.to_string();
        match self {
            Self::Store(error) => error.into_status(),
            Self::Changed(_) => Status::aborted(message),
        }
    }
}

impl IntoStatus for ImportError {
    fn into_status(self) -> Status {
        let said = self.to_string();
        match self {
            Self::Store(error) => error.into_status(),
            Self::Checkpoint(error) => error.into_status(),
            Self::Exists(_) => Status::already_exists(said),
            Self::Damaged(_) => Status::invalid_argument(said),
            Self::Digest { .. } => Status::data_loss(said),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tonic::Code;

    #[tokio::test(start_paused = true)]
    async fn a_client_that_takes_no_part_is_not_waited_for() {
        let (parts, mut stream) = mpsc::channel(1);
        send_part(&parts, Part::Chunk(vec![1])).await.unwrap();
        let refused = send_part(&parts, Part::Chunk(vec![2])).await.unwrap_err();
        assert_eq!(refused.code(), Code::DeadlineExceeded, "{refused}");
        assert!(stream.recv().await.unwrap().is_ok());
        send_part(&parts, Part::Chunk(vec![3])).await.unwrap();
        drop(stream);
        let refused = send_part(&parts, Part::Chunk(vec![4])).await.unwrap_err();
        assert_eq!(refused.code(), Code::Cancelled, "{refused}");
    }
}
