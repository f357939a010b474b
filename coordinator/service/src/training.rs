//! The service for trainers: their streams, and the pictures for their tasks.

use super::{
    Streamed, lease_id,
    work::{Peer, machine_of, serve},
};
use crate::status::{IntoStatus as _, OrStatus as _};
use murmuration_dispatch::Trainers;
use murmuration_engine::blocking::blocking;
use murmuration_model::{CampaignRecord, NextTraining, TrainingPictures};
use murmuration_proto::{PART_BYTES, TRAINER_VERSION, v1};
use murmuration_store::{RoundPictures, Store, StoreError};
use murmuration_swarm::{EmbedderSource, FEATURE_NAMES, Invalid, Text};
use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

/// Implements `murmuration.v1.TrainerService`.
#[derive(Debug, Clone)]
pub struct TrainerApi {
    /// Leases trainings to trainers.
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
        serve(self.trainers.dispatch(), request, (trainer, check_trainer)).await
    }

    type FetchTrainingStream = Streamed<v1::TrainingPart>;

    async fn fetch_training(
        &self,
        request: Request<v1::FetchTrainingRequest>,
    ) -> Result<Response<Self::FetchTrainingStream>, Status> {
        let machine = machine_of(&request)?.machine;
        let (epoch, lease) = lease_id(request.into_inner().lease, "lease")?;
        let leased = self.trainers.dispatch().leased_training(machine, epoch, lease);
        let id = leased
            .await
            .ok_or_else(|| Status::permission_denied("this trainer holds no such lease of a training"))?;
        let store = self.store.clone();
        let record = blocking(move || store.campaign(id.as_str()))
            .await
            .or_status()?
            .or_status()?;
        let (parts, stream) = mpsc::channel(4);
        let store = self.store.clone();
        tokio::task::spawn_blocking(move || {
            if let Err(error) = send(&store, &record, &parts) {
                // The trainer may have gone.
                let _ = parts.blocking_send(Err(error.into_status()));
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

/// Sends pictures, then their features if the recipe flattens, then labelled pictures, then the snapshot. Ends early when the
/// client has gone.
fn send(
    store: &Store,
    record: &CampaignRecord,
    parts: &mpsc::Sender<Result<v1::TrainingPart, Status>>,
) -> Result<(), StoreError> {
    use v1::training_part::Part;
    let send = |part| {
        parts
            .blocking_send(Ok(v1::TrainingPart { part: Some(part) }))
            .is_ok()
    };
    let each = (PART_BYTES / record.spec.image().bytes()).max(1);
    for place in (0..TrainingPictures::of(record).count()).step_by(each) {
        let images = store.training_images(record, place..place + each as u64)?;
        if !send(Part::Pictures(images)) {
            return Ok(());
        }
    }
    if let Some(EmbedderSource::Trained { dataset, training }) = record.spec.embedder()
        && training.recipe().flattening() > 0
        && NextTraining::of(record) == Some(NextTraining::Pretraining)
    {
        let all = u64::from(dataset.controllers());
        let each = PART_BYTES / (FEATURE_NAMES.len() * size_of::<f64>());
        for first in (0..all).step_by(each) {
            let range = first..all.min(first + each as u64);
            let features = store.dataset_features(&record.id, dataset.starts().into(), range)?;
            let features = features.into_iter().flatten().collect();
            if !send(Part::Features(v1::FeaturesPart { features })) {
                return Ok(());
            }
        }
    }
    let round = match NextTraining::of(record) {
        Some(NextTraining::FineTuning { cutoff, .. }) => store.round_pictures(record, cutoff)?,
        Some(NextTraining::Pretraining) | None => RoundPictures::default(),
    };
    for part in round.pictures.chunks(each) {
        let mut message = v1::LabelledPart::default();
        for &(picture, class) in part {
            message.classes.push(class);
            message.pictures.extend(store.round_image(record, picture)?);
        }
        if !send(Part::Labelled(message)) {
            return Ok(());
        }
    }
    if let Some(saved) = store.saved_training(&record.id)? {
        for part in saved.bytes.chunks(PART_BYTES) {
            if !send(Part::Saved(part.to_vec())) {
                return Ok(());
            }
        }
    }
    Ok(())
}
