//! What a training needs, fetched from the coordinator: its pictures, those with labels and the network to go on from,
//! and what was put aside of it.

use super::{
    event::Undone,
    task::{LessonTask, Task},
};
use crate::{labelled_pictures::LabelledPictures, onnx, pictures::Pictures, training::FineTuning};
use murmuration_link::{Coordinator, attempts, fetch_checkpoint, for_lease};
use murmuration_proto::{
    CheckpointDigest,
    v1::{self, trainer_service_client::TrainerServiceClient, training_part::Part},
};
use std::sync::Arc;
use tonic::Status;

/// Most bytes of a saved training: four numbers of four bytes for each of at most 16 Mi weights, and some figures.
const MAX_SAVED_BYTES: usize = 300 << 20;

/// All that a training begins with.
pub(super) struct TrainingInputs {
    pub(super) pictures: Arc<Pictures>,
    /// If it learns from labels.
    pub(super) fine_tuning: Option<FineTuning>,
    /// The training that was put aside; empty if none was.
    pub(super) saved: Vec<u8>,
}

/// What came of a task's parts.
#[derive(Default)]
struct Parts {
    pictures: Vec<u8>,
    labelled: Vec<u8>,
    classes: Vec<u32>,
    saved: Vec<u8>,
}

/// Fetches what `task` needs.
pub(super) async fn fetch(task: &Task, coordinator: &Coordinator) -> Result<TrainingInputs, Undone> {
    let parts = attempts(|| receive(task, coordinator.clone()))
        .await
        .map_err(|status| Undone::call("the training's dataset cannot be fetched", &status))?;
    let pictures = Pictures::new(task.side, task.views, parts.pictures).map_err(Undone::fatal)?;
    let fine_tuning = match &task.lesson {
        None => None,
        Some(lesson) => {
            let labelled = LabelledPictures::new(task.side, parts.labelled, parts.classes);
            Some(FineTuning {
                parent: parent(task, lesson, coordinator).await?,
                labelled: Arc::new(labelled.map_err(Undone::fatal)?.of_labels(lesson.labels)),
            })
        }
    };
    Ok(TrainingInputs {
        pictures: Arc::new(pictures),
        fine_tuning,
        saved: parts.saved,
    })
}

/// The network of the checkpoint to go on from.
async fn parent(
    task: &Task,
    lesson: &LessonTask,
    coordinator: &Coordinator,
) -> Result<crate::network::Network, Undone> {
    let fetched = fetch_checkpoint(coordinator, lesson.parent, task.lease).await;
    let bytes = fetched.map_err(|status| Undone::call("the checkpoint to go on from", &status))?;
    if CheckpointDigest::of(&bytes) != lesson.parent {
        return Err(Undone::retryable(
            "other bytes came than the checkpoint's to go on from",
        ));
    }
    let architecture = task
        .configuration
        .architecture(task.side)
        .map_err(Undone::fatal)?;
    onnx::import(&bytes, architecture).map_err(Undone::fatal)
}

async fn receive(task: &Task, coordinator: Coordinator) -> Result<Parts, Status> {
    let request = v1::FetchTrainingRequest {
        campaign: task.campaign.clone(),
    };
    let labelled_bytes = task.lesson.as_ref().map_or(0, |lesson| lesson.bytes);
    let mut messages = TrainerServiceClient::new(coordinator)
        .fetch_training(for_lease(request, task.lease))
        .await?
        .into_inner();
    let mut parts = Parts::default();
    parts
        .pictures
        .try_reserve_exact(task.bytes)
        .map_err(|_| Status::resource_exhausted(format!("no memory for {} bytes of pictures", task.bytes)))?;
    while let Some(message) = messages.message().await? {
        match message.part {
            Some(Part::Pictures(bytes)) => append(&mut parts.pictures, &bytes, "pictures", task.bytes)?,
            Some(Part::Labelled(labelled)) => {
                append(
                    &mut parts.labelled,
                    &labelled.pictures,
                    "labelled pictures",
                    labelled_bytes,
                )?;
                append(&mut parts.classes, &labelled.classes, "classes", labelled_bytes)?;
            }
            Some(Part::Saved(bytes)) => {
                append(&mut parts.saved, &bytes, "a saved training", MAX_SAVED_BYTES)?
            }
            None => {}
        }
    }
    check_whole(&parts.pictures, "pictures", task.bytes)?;
    check_whole(&parts.labelled, "labelled pictures", labelled_bytes)?;
    Ok(parts)
}

fn append<T: Copy>(all: &mut Vec<T>, part: &[T], what: &str, most: usize) -> Result<(), Status> {
    if all.len() + part.len() > most {
        return Err(Status::data_loss(format!("more than {most} of {what} came")));
    }
    all.extend_from_slice(part);
    Ok(())
}

fn check_whole(came: &[u8], what: &str, wanted: usize) -> Result<(), Status> {
    if came.len() == wanted {
        return Ok(());
    }
    let came = came.len();
    Err(Status::data_loss(format!(
        "{came} bytes of {what} came, not {wanted}"
    )))
}
