//! Fetches the inputs of a training from the coordinator: pictures, labelled pictures, the network to train further, and the
//! snapshot.

use super::{
    event::Undone,
    task::{FineTuningTask, Task},
};
use murmuration_link::{Calls, Coordinator, attempts, fetch_checkpoint, for_lease};
use murmuration_proto::v1::{self, trainer_service_client::TrainerServiceClient, training_part::Part};
use murmuration_swarm::CheckpointDigest;
use murmuration_train::{
    labelled_pictures::LabelledPictures, onnx, pictures::Pictures, training::FineTuning,
};
use std::sync::Arc;
use tonic::Status;

/// Maximum number of bytes of a snapshot. A snapshot has four numbers of four bytes for each of at most 16 Mi weights, and a few
/// other values.
const MAX_SAVED_BYTES: usize = 300 << 20;

pub(super) struct TrainingInputs {
    pub(super) pictures: Arc<Pictures>,
    /// Inputs of fine-tuning; `None` if the training does not learn from labels.
    pub(super) fine_tuning: Option<FineTuning>,
    /// Bytes of the snapshot; empty if the training has no snapshot.
    pub(super) saved: Vec<u8>,
}

/// The inputs of a task, merged from the parts that the coordinator sent.
#[derive(Default)]
struct Parts {
    pictures: Vec<u8>,
    features: Vec<f64>,
    labelled: Vec<u8>,
    classes: Vec<u32>,
    saved: Vec<u8>,
}

/// Fetches the inputs of `task`.
pub(super) async fn fetch(task: &Task, calls: &Calls) -> Result<TrainingInputs, Undone> {
    let mut parts = attempts(|| receive(task, calls.coordinator()))
        .await
        .map_err(|status| Undone::call("the training's dataset cannot be fetched", &status))?;
    let pictures = Pictures::new(task.pictures, task.views, std::mem::take(&mut parts.pictures))
        .map_err(Undone::fatal)?;
    let pictures = match task.features() {
        0 => pictures,
        _ => pictures
            .with_features(parts.features.as_chunks().0.to_vec())
            .map_err(Undone::fatal)?,
    };
    let fine_tuning = match &task.fine_tuning {
        None => None,
        Some(fine_tuning) => Some(FineTuning {
            labelled: labelled(task, fine_tuning, &mut parts)?,
            parent: parent(task, fine_tuning, calls).await?,
        }),
    };
    Ok(TrainingInputs {
        pictures: Arc::new(pictures),
        fine_tuning,
        saved: parts.saved,
    })
}

/// The labelled pictures from the received parts.
fn labelled(
    task: &Task,
    fine_tuning: &FineTuningTask,
    parts: &mut Parts,
) -> Result<Arc<LabelledPictures>, Undone> {
    let (pictures, classes) = (
        std::mem::take(&mut parts.labelled),
        std::mem::take(&mut parts.classes),
    );
    let labelled = LabelledPictures::new(task.pictures, pictures, classes).map_err(Undone::fatal)?;
    Ok(Arc::new(labelled.of_labels(fine_tuning.labels)))
}

/// The network of the checkpoint to train further.
async fn parent(
    task: &Task,
    fine_tuning: &FineTuningTask,
    calls: &Calls,
) -> Result<murmuration_train::network::Network, Undone> {
    let fetched = fetch_checkpoint(calls, fine_tuning.parent, task.lease).await;
    let bytes = fetched.map_err(|status| Undone::call("the checkpoint to train further", &status))?;
    if CheckpointDigest::of(&bytes) != fine_tuning.parent {
        return Err(Undone::retryable(
            "the received bytes are not the checkpoint to train further",
        ));
    }
    let architecture = task
        .configuration
        .architecture(task.pictures)
        .map_err(Undone::fatal)?;
    onnx::import(&bytes, architecture).map_err(Undone::fatal)
}

async fn receive(task: &Task, coordinator: Result<Coordinator, Status>) -> Result<Parts, Status> {
    let request = v1::FetchTrainingRequest {
        lease: Some(task.lease),
    };
    let labelled_bytes = task
        .fine_tuning
        .as_ref()
        .map_or(0, |fine_tuning| fine_tuning.bytes);
    let features = task.features();
    let mut messages = TrainerServiceClient::new(coordinator?)
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
            Some(Part::Features(part)) => {
                append(&mut parts.features, &part.features, "features", features)?;
            }
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
    if parts.features.len() != features {
        let came = parts.features.len();
        return Err(Status::data_loss(format!("{came} features came, not {features}")));
    }
    check_whole(&parts.labelled, "labelled pictures", labelled_bytes)?;
    Ok(parts)
}

fn append<T: Copy>(all: &mut Vec<T>, part: &[T], what: &str, most: usize) -> Result<(), Status> {
    if all.len() + part.len() > most {
        return Err(Status::data_loss(format!("received more than {most} of {what}")));
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
        "received {came} bytes of {what}, not {wanted}"
    )))
}
