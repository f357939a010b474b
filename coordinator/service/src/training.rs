//! The service for trainers: their streams, and the pictures for their tasks.

use super::{
    Streamed, lease_id,
    work::{Peer, machine_of, serve},
};
use crate::status::OrStatus as _;
use murmuration_dispatch::Trainers;
use murmuration_engine::blocking::spawn;
use murmuration_model::{CampaignRecord, NextTraining, TrainingPictures};
use murmuration_proto::{
    PART_BYTES, TRAINER_VERSION,
    v1::{self, training_part},
};
use murmuration_store::{RoundPictures, Store, StoreError};
use murmuration_swarm::{EmbedderSource, FEATURE_NAMES, Invalid, Text};
use std::sync::Arc;
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Implements `murmuration.v1.TrainerService`.
#[derive(Debug, Clone)]
pub struct TrainerApi {
    /// The dispatcher that leases trainings to trainers.
    pub trainers: Trainers,
    pub store: Store,
}

#[tonic::async_trait]
impl v1::trainer_service_server::TrainerService for TrainerApi {
    type TrainStream = ReceiverStream<Result<v1::CoordinatorMessage, Status>>;

    async fn train(
        &self,
        request: Request<Streaming<v1::WorkerMessage>>,
    ) -> Result<Response<Self::TrainStream>, Status> {
        let trainer = Peer::Trainer(self.store.clone());
        serve(self.trainers.dispatch(), request, trainer, check_trainer).await
    }

    type FetchTrainingStream = Streamed<v1::TrainingPart>;

    async fn fetch_training(
        &self,
        request: Request<v1::FetchTrainingRequest>,
    ) -> Result<Response<Self::FetchTrainingStream>, Status> {
        let machine = machine_of(&request)?.machine;
        let (epoch, lease) = lease_id(request.into_inner().lease, "lease")?;
        let leased = self.trainers.dispatch().leased_training(machine, epoch, lease);
        let id = leased.await.ok_or_else(|| {
            Status::permission_denied("this trainer does not hold the lease of this training")
        })?;
        let record = self.store.run(move |store| store.campaign(id.as_str())).await;
        let record = record.or_status()?;
        let (parts, stream) = mpsc::channel(2);
        let store = self.store.clone();
        spawn(async move {
            if let Err(status) = send(store, record, &parts).await {
                // The trainer may have disconnected.
                let _ = parts.send(Err(status)).await;
            }
        });
        Ok(Response::new(Box::pin(ReceiverStream::new(stream))))
    }
}

fn check_trainer(hello: &v1::Hello) -> Result<(), Status> {
    if hello.trainer_version != TRAINER_VERSION {
        return Err(Status::failed_precondition(format!(
            "this coordinator needs trainers of version {TRAINER_VERSION}, trainer \"{}\" has version {}: run the \
             murmuration-trainer that came with the coordinator",
            hello.name,
            Text::line(&hello.trainer_version),
        )));
    }
    match hello.capacity {
        1 => Ok(()),
        other => Err(Invalid::new(
            "hello.capacity",
            other,
            "1: a trainer trains one embedder at a time",
        )
        .into()),
    }
}

/// Sends pictures, then their features if the recipe flattens, then labelled pictures, then the snapshot. Each part is read when
/// the client has taken the previous part, so that a client that takes nothing holds no thread. Sending ends early if the client
/// has disconnected.
async fn send(
    store: Store,
    record: CampaignRecord,
    parts: &mpsc::Sender<Result<v1::TrainingPart, Status>>,
) -> Result<(), Status> {
    let of = record.clone();
    let contents = store.run(move |store| Contents::of(store, &of)).await;
    let contents = Arc::new(contents.or_status()?);
    let mut next = contents.begin();
    while let Some(place) = next {
        let (record, read) = (record.clone(), Arc::clone(&contents));
        let part = store.run(move |store| read.part(store, &record, place)).await;
        let part = Some(part.or_status()?);
        if parts.send(Ok(v1::TrainingPart { part })).await.is_err() {
            return Ok(());
        }
        next = contents.after(place);
    }
    Ok(())
}

/// The contents of a training, in the order in which they are sent.
struct Contents {
    /// For each kind of item, the number of items in all and the number of items in one part.
    kinds: [(u64, u64); 4],
    round: RoundPictures,
    saved: Vec<u8>,
}

/// A part: the kind of its items, and its first item.
type Place = (usize, u64);

impl Contents {
    fn of(store: &Store, record: &CampaignRecord) -> Result<Self, StoreError> {
        let flattened = match record.spec.embedder() {
            Some(EmbedderSource::Trained { dataset, training })
                if training.recipe().flattening() > 0
                    && NextTraining::of(record) == Some(NextTraining::Pretraining) =>
            {
                dataset.controllers().into()
            }
            _ => 0,
        };
        let round = match NextTraining::of(record) {
            Some(NextTraining::FineTuning { cutoff, .. }) => store.round_pictures(record, cutoff)?,
            Some(NextTraining::Pretraining) | None => RoundPictures::default(),
        };
        let saved = store
            .saved_training(&record.id)?
            .map_or_else(Vec::new, |saved| saved.bytes);
        let pictures = (PART_BYTES / record.spec.image().bytes()).max(1) as u64;
        let features = (PART_BYTES / (FEATURE_NAMES.len() * size_of::<f64>())) as u64;
        let kinds = [
            (TrainingPictures::of(record).count(), pictures),
            (flattened, features),
            (round.pictures.len() as u64, pictures),
            (saved.len() as u64, PART_BYTES as u64),
        ];
        Ok(Self { kinds, round, saved })
    }

    fn begin(&self) -> Option<Place> {
        let kind = self.kinds.iter().position(|&(count, _)| count > 0)?;
        Some((kind, 0))
    }

    fn after(&self, (kind, first): Place) -> Option<Place> {
        let (count, each) = self.kinds[kind];
        if first + each < count {
            return Some((kind, first + each));
        }
        let further = self.kinds.iter().enumerate().skip(kind + 1);
        further
            .filter(|(_, (count, _))| *count > 0)
            .map(|(kind, _)| (kind, 0))
            .next()
    }

    fn part(
        &self,
        store: &Store,
        record: &CampaignRecord,
        (kind, first): Place,
    ) -> Result<training_part::Part, StoreError> {
        use training_part::Part;
        let (count, each) = self.kinds[kind];
        let until = count.min(first + each);
        let items = first as usize..until as usize;
        match kind {
            0 => Ok(Part::Pictures(
                store.training_images(record, first..first + each)?,
            )),
            1 => {
                let starts = match record.spec.embedder() {
                    Some(EmbedderSource::Trained { dataset, .. }) => dataset.starts().into(),
                    _ => 1,
                };
                let features = store.dataset_features(&record.id, starts, first..until)?;
                let features = features.into_iter().flatten().collect();
                Ok(Part::Features(v1::FeaturesPart { features }))
            }
            2 => {
                let mut message = v1::LabelledPart::default();
                for &(picture, class) in &self.round.pictures[items] {
                    message.classes.push(class);
                    message.pictures.extend(store.round_image(record, picture)?);
                }
                Ok(Part::Labelled(message))
            }
            _ => Ok(Part::Saved(self.saved[items].to_vec())),
        }
    }
}
