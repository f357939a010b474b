//! What a training needs, fetched from the coordinator: its pictures, and what was put aside of it.

use super::{job::Undone, task::Task};
use crate::pictures::Pictures;
use murmuration_link::attempts;
use murmuration_proto::v1::{self, trainer_service_client::TrainerServiceClient, training_part::Part};
use tonic::{Status, transport::Channel};

/// Most bytes of a saved training: four numbers of four bytes for each of at most 16 Mi weights, and some figures.
const MAX_SAVED_BYTES: usize = 300 << 20;

/// The pictures of a task and the training that was put aside, empty if none was.
pub(super) async fn fetch(task: &Task, coordinator: &Channel) -> Result<(Pictures, Vec<u8>), Undone> {
    let (pictures, saved) = attempts(|| receive(task, coordinator.clone()))
        .await
        .map_err(|status| Undone::call("the training's dataset cannot be fetched", &status))?;
    let pictures = Pictures::new(task.side, task.views, pictures).map_err(Undone::fatal)?;
    Ok((pictures, saved))
}

async fn receive(task: &Task, coordinator: Channel) -> Result<(Vec<u8>, Vec<u8>), Status> {
    let request = v1::FetchTrainingRequest {
        campaign: task.campaign.clone(),
    };
    let mut client = TrainerServiceClient::new(coordinator);
    let mut parts = client.fetch_training(request).await?.into_inner();
    let (mut pictures, mut saved) = (Vec::new(), Vec::new());
    pictures
        .try_reserve_exact(task.bytes)
        .map_err(|_| Status::resource_exhausted(format!("no memory for {} bytes of pictures", task.bytes)))?;
    while let Some(message) = parts.message().await? {
        match message.part {
            Some(Part::Pictures(bytes)) => append(&mut pictures, &bytes, "pictures", task.bytes)?,
            Some(Part::Saved(bytes)) => append(&mut saved, &bytes, "a saved training", MAX_SAVED_BYTES)?,
            None => {}
        }
    }
    if pictures.len() != task.bytes {
        return Err(Status::data_loss(format!(
            "{} bytes of pictures came, not {}",
            pictures.len(),
            task.bytes
        )));
    }
    Ok((pictures, saved))
}

fn append(all: &mut Vec<u8>, bytes: &[u8], what: &str, most: usize) -> Result<(), Status> {
    if all.len() + bytes.len() > most {
        return Err(Status::data_loss(format!(
            "more than {most} bytes of {what} came"
        )));
    }
    all.extend_from_slice(bytes);
    Ok(())
}
