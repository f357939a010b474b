//! The service for clients: campaigns, archives, taxonomies, replays.

use super::{Recent, Streamed, as_taken, in_parts};
use crate::status::OrStatus as _;
use murmuration_dispatch::{Dispatch, ReplayJob};
use murmuration_engine::{
    blocking::in_background,
    campaign::{CampaignError, Campaigns},
    queries::Queries,
    taxonomy::{Names, Taxonomy},
};
use murmuration_model::{ArchiveVersion, CampaignId, CampaignRecord, NewCampaign, NotesChange, study_name};
use murmuration_proto::{PART_BYTES, parts::parts, v1};
use murmuration_search::interrupt::Interrupt;
use murmuration_store::{
    Store, StoreError,
    digest::{ArchiveDigest, digest},
    kept::LatestAnswers,
};
use murmuration_swarm::Frames;
use prost::Message as _;
use std::{sync::Arc, time::Duration};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status};

/// Minimum interval between two messages to one watcher.
const WATCH_INTERVAL: Duration = Duration::from_millis(100);

/// Number of campaigns in a part of a list.
const LISTED_AT_ONCE: usize = 50;

/// Size in bytes of a digest in the cache.
const DIGEST_BYTES: usize = 64;

/// Implements `murmuration.v1.CampaignService`.
#[derive(Debug, Clone)]
pub struct CampaignApi {
    pub campaigns: Campaigns,
    pub store: Store,
    /// The dispatcher of the workers that simulate replays.
    pub dispatch: Dispatch,
    /// The source of the clusters of archives.
    pub queries: Queries,
    /// Digests of archives, by the archive's version and number of individuals.
    pub digests: LatestAnswers<(ArchiveVersion, u64), ArchiveDigest>,
    /// The statuses of watched campaigns.
    pub watched: Recent<(v1::Campaign, bool)>,
}

type Answer<T> = Result<Response<T>, Status>;

/// The part of a list of campaigns that begins with the campaign at `begins`, and the place at which the next part begins.
async fn listed(
    campaigns: &Campaigns,
    ids: &[CampaignId],
    begins: usize,
) -> Result<(v1::ListCampaignsResponse, Option<u64>), Status> {
    let until = ids.len().min(begins + LISTED_AT_ONCE);
    let statuses = campaigns
        .statuses(ids[begins..until].to_vec())
        .await
        .or_status()?;
    let (mut part, mut bytes) = (Vec::with_capacity(statuses.len()), 0);
    for campaign in statuses.into_iter().map(v1::Campaign::from) {
        bytes += campaign.encoded_len();
        // Specifications can be long.
        if bytes > PART_BYTES && !part.is_empty() {
            let next = ids.iter().position(|id| id.as_str() == campaign.id);
            return Ok((
                v1::ListCampaignsResponse { campaigns: part },
                next.map(|next| next as u64),
            ));
        }
        part.push(campaign);
    }
    let next = (until < ids.len()).then_some(until as u64);
    Ok((v1::ListCampaignsResponse { campaigns: part }, next))
}

impl CampaignApi {
    pub(super) async fn record(&self, id: &str) -> Result<CampaignRecord, Status> {
        Ok(self.campaigns.status(id).await.or_status()?.record)
    }

    /// Runs a query whose time grows with the archive.
    async fn read_archive<T: Send + 'static>(
        &self,
        query: impl FnOnce(&Store, &Interrupt) -> Result<T, StoreError> + Send + 'static,
    ) -> Result<T, Status> {
        let store = self.store.clone();
        let read = in_background(move |interrupt| query(&store, interrupt));
        read.await.or_status()?.or_status()
    }
}

#[tonic::async_trait]
impl v1::campaign_service_server::CampaignService for CampaignApi {
    async fn create_campaign(&self, request: Request<v1::CreateCampaignRequest>) -> Answer<v1::Campaign> {
        let new = NewCampaign::try_from(request.into_inner())?;
        Ok(Response::new(
            self.campaigns.create(new).await.or_status()?.into(),
        ))
    }

    async fn get_campaign(&self, request: Request<v1::GetCampaignRequest>) -> Answer<v1::Campaign> {
        let status = self
            .campaigns
            .status(&request.get_ref().campaign)
            .await
            .or_status()?;
        let toml = status.record.spec.to_toml();
        Ok(Response::new(v1::Campaign {
            toml: Some(toml),
            ..status.into()
        }))
    }

    type ListCampaignsStream = Streamed<v1::ListCampaignsResponse>;

    async fn list_campaigns(
        &self,
        _: Request<v1::ListCampaignsRequest>,
    ) -> Answer<Self::ListCampaignsStream> {
        let ids: Arc<[CampaignId]> = self.store.run(Store::campaign_ids).await.or_status()?.into();
        let campaigns = self.campaigns.clone();
        Ok(as_taken(move |begins| {
            let (campaigns, ids) = (campaigns.clone(), Arc::clone(&ids));
            async move { listed(&campaigns, &ids, begins as usize).await }
        }))
    }

    type WatchCampaignStream = Streamed<v1::Campaign>;

    async fn watch_campaign(
        &self,
        request: Request<v1::WatchCampaignRequest>,
    ) -> Answer<Self::WatchCampaignStream> {
        let campaigns = self.campaigns.clone();
        let id = self.record(&request.get_ref().campaign).await?.id;
        let watched = self.watched.follow(id.to_string());
        let (messages, stream) = mpsc::channel(1);
        tokio::spawn(async move {
            // The first message is always new, even if other clients watch the same campaign.
            let mut age = Duration::ZERO;
            loop {
                let look = async {
                    let status = campaigns.status(id.as_str()).await?;
                    let active = status.active;
                    Ok((status.into(), active))
                };
                let looked: Result<_, CampaignError> = watched.within(age, look).await;
                let goes_on = matches!(looked, Ok((_, true)));
                let message = looked.map(|(status, _)| status).or_status();
                if messages.send(message).await.is_err() || !goes_on {
                    return;
                }
                age = WATCH_INTERVAL;
                tokio::select! {
                    () = messages.closed() => return,
                    () = async { tokio::join!(campaigns.changed(&id), tokio::time::sleep(WATCH_INTERVAL)); } => {}
                }
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }

    async fn pause_campaign(&self, request: Request<v1::PauseCampaignRequest>) -> Answer<v1::Campaign> {
        let paused = self
            .campaigns
            .pause(&request.get_ref().campaign)
            .await
            .or_status()?;
        Ok(Response::new(paused.into()))
    }

    async fn resume_campaign(&self, request: Request<v1::ResumeCampaignRequest>) -> Answer<v1::Campaign> {
        let resumed = self
            .campaigns
            .resume(&request.get_ref().campaign)
            .await
            .or_status()?;
        Ok(Response::new(resumed.into()))
    }

    async fn cancel_campaign(&self, request: Request<v1::CancelCampaignRequest>) -> Answer<v1::Campaign> {
        let cancelled = self
            .campaigns
            .cancel(&request.get_ref().campaign)
            .await
            .or_status()?;
        Ok(Response::new(cancelled.into()))
    }

    async fn delete_campaign(
        &self,
        request: Request<v1::DeleteCampaignRequest>,
    ) -> Answer<v1::DeleteCampaignResponse> {
        let v1::DeleteCampaignRequest {
            campaign,
            study,
            preview,
        } = request.into_inner();
        let id: CampaignId = campaign.parse()?;
        let study = study_name(study)?;
        let deletion = match preview {
            true => self.campaigns.deletion(&id).await,
            false => self.campaigns.delete(id, study).await,
        };
        let deletion = deletion.or_status()?;
        Ok(Response::new(v1::DeleteCampaignResponse {
            campaign,
            individuals: deletion.individuals,
            pictures: deletion.pictures,
            labelled: deletion.labelled,
            taxonomy: deletion.taxonomy,
        }))
    }

    async fn adopt_checkpoint(&self, request: Request<v1::AdoptCheckpointRequest>) -> Answer<v1::Campaign> {
        let v1::AdoptCheckpointRequest { campaign, checkpoint } = request.into_inner();
        let moved = self
            .campaigns
            .adopt(&campaign, checkpoint.parse()?)
            .await
            .or_status()?;
        Ok(Response::new(moved.into()))
    }

    async fn refine_campaign(&self, request: Request<v1::RefineCampaignRequest>) -> Answer<v1::Campaign> {
        let refined = self
            .campaigns
            .refine(&request.get_ref().campaign)
            .await
            .or_status()?;
        Ok(Response::new(refined.into()))
    }

    async fn extend_campaign(&self, request: Request<v1::ExtendCampaignRequest>) -> Answer<v1::Campaign> {
        let v1::ExtendCampaignRequest {
            campaign,
            generations,
        } = request.into_inner();
        let extended = self.campaigns.extend(&campaign, generations).await.or_status()?;
        Ok(Response::new(extended.into()))
    }

    async fn note_campaign(&self, request: Request<v1::NoteCampaignRequest>) -> Answer<v1::Campaign> {
        let request = request.into_inner();
        let campaign = request.campaign.clone();
        let change = NotesChange::try_from(request)?;
        let noted = self.campaigns.note(&campaign, change).await.or_status()?;
        Ok(Response::new(noted.into()))
    }

    type ListGenerationsStream = Streamed<v1::ListGenerationsResponse>;

    async fn list_generations(
        &self,
        request: Request<v1::ListGenerationsRequest>,
    ) -> Answer<Self::ListGenerationsStream> {
        let id = self.record(&request.get_ref().campaign).await?.id;
        let generations = self.store.run(move |store| store.generations(&id)).await;
        let generations = generations
            .or_status()?
            .into_iter()
            .map(v1::GenerationSummary::from);
        let part = |generations| v1::ListGenerationsResponse { generations };
        Ok(in_parts(parts(generations, part)))
    }

    type GetArchiveStream = Streamed<v1::ArchiveChunk>;

    async fn get_archive(&self, request: Request<v1::GetArchiveRequest>) -> Answer<Self::GetArchiveStream> {
        let v1::GetArchiveRequest { campaign, images } = request.into_inner();
        let record = self.record(&campaign).await?;
        let chunk = if images {
            (PART_BYTES / record.spec.image().bytes()).clamp(1, 1000)
        } else {
            1000
        } as u64;
        let api = self.clone();
        Ok(as_taken(move |begins| {
            let (api, id, model) = (api.clone(), record.id.clone(), record.spec.model().clone());
            async move {
                let range = begins..begins + chunk;
                let read = api.read_archive(move |store, _| store.individuals(&id, &model, range, images));
                let individuals = read.await?;
                let more = individuals.len() as u64 == chunk;
                let individuals = individuals.into_iter().map(Into::into).collect();
                Ok((v1::ArchiveChunk { individuals }, more.then_some(begins + chunk)))
            }
        }))
    }

    async fn get_digest(&self, request: Request<v1::GetDigestRequest>) -> Answer<v1::GetDigestResponse> {
        let record = self.record(&request.get_ref().campaign).await?;
        let (id, state) = (
            record.id.clone(),
            (record.archive_version(), record.individuals()),
        );
        let (of, model) = (id.clone(), record.spec.model().clone());
        let made = self.read_archive(move |store, interrupt| digest(store, &of, &model, interrupt));
        let found = self.digests.of(&id, state, |_| DIGEST_BYTES, made).await?;
        let repetition = self.store.run(move |store| store.repetition(&record)).await;
        let repetition = repetition.or_status()?;
        Ok(Response::new(v1::GetDigestResponse {
            digest: found.digest,
            evaluations: found.evaluations,
            rounds: repetition.rounds.into_iter().map(Into::into).collect(),
            attended: repetition.attended,
            adopted: repetition.adopted,
        }))
    }

    type GetTaxonomyStream = Streamed<v1::Taxonomy>;

    async fn get_taxonomy(
        &self,
        request: Request<v1::GetTaxonomyRequest>,
    ) -> Answer<Self::GetTaxonomyStream> {
        let record = self.record(&request.get_ref().campaign).await?;
        let message = format!(
            "campaign {} has no taxonomy yet: it is {}, and only completed campaigns have one",
            record.id,
            record.state.name()
        );
        let read = move |store: &Store| -> Result<_, StoreError> {
            let taxonomy = Taxonomy::read(store, &record.id, &record.spec)?;
            Ok((taxonomy, Names::standing(store, &record.id)?))
        };
        let (taxonomy, names) = self.store.run(read).await.or_status()?;
        let taxonomy = taxonomy.ok_or_else(|| Status::failed_precondition(message))?;
        Ok(in_parts(taxonomy.into_parts(names)))
    }

    async fn get_individual(&self, request: Request<v1::GetIndividualRequest>) -> Answer<v1::Individual> {
        let v1::GetIndividualRequest { campaign, index } = request.into_inner();
        let record = self.record(&campaign).await?;
        let read = move |store: &Store| store.individual(&record.id, record.spec.model(), index);
        let found = self.store.run(read).await.or_status()?;
        Ok(Response::new(found.into()))
    }

    type GetReplayStream = Streamed<v1::Replay>;

    async fn get_replay(&self, request: Request<v1::GetReplayRequest>) -> Answer<Self::GetReplayStream> {
        let v1::GetReplayRequest {
            campaign,
            index,
            stride,
        } = request.into_inner();
        let record = self.record(&campaign).await?;
        let world = record.spec.world().clone();
        let frames = Frames::new(0, stride, &world)?;
        let id = record.id.clone();
        let read = move |store: &Store| store.individual(&id, record.spec.model(), index);
        let found = self.store.run(read).await.or_status()?;
        let job = ReplayJob {
            campaign: record.id,
            controller: found.controller,
            world,
            seed: found.seed,
            frames,
        };
        let replay = self
            .dispatch
            .while_staffed(self.dispatch.replay(job))
            .await
            .or_status()?
            .or_status()?;
        Ok(in_parts(replay.into_parts()))
    }

    async fn find_nearest(
        &self,
        request: Request<v1::FindNearestRequest>,
    ) -> Answer<v1::FindNearestResponse> {
        let found = self.find_nearest_of(request.into_inner()).await?;
        Ok(Response::new(found))
    }
}
