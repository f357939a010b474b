//! What can be saved of a data directory, in a new one.

use super::{CampaignFindings, Findings, Prospect, findings, watch};
use crate::{
    checkpoints::{CheckpointError, Condition, Shelf},
    store::{DataDirectory, Store, StoreError},
};
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Why nothing, or not all that was whole, was saved.
#[derive(Debug, thiserror::Error)]
pub enum SalvageError {
    /// The old or the new store.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The checkpoints of either.
    #[error("{0}")]
    Checkpoints(#[from] CheckpointError),
    /// Something is there already.
    #[error("{0} is not empty: name a folder that does not exist yet")]
    NotEmpty(PathBuf),
}

/// Copies what is whole of the data directory `data` into the new one `target`, which then opens, and whose campaigns can
/// be resumed; what was found in `data`. Campaigns that are cut off somewhere have failed there, and say where.
///
/// # Errors
/// See [`SalvageError`].
pub async fn salvage(data: &Path, location: Option<&str>, target: &Path) -> Result<Findings, SalvageError> {
    if !is_empty(target) {
        return Err(SalvageError::NotEmpty(target.to_path_buf()));
    }
    let (_watched, from, schema) = watch(data)?;
    let found = findings(&from, schema, data, location).await?;
    let held = DataDirectory::hold(target)?;
    let to = Store::open(&held)?;
    to.take_checkpoints(&from)?;
    for campaign in &found.campaigns {
        if campaign.prospect != Prospect::Lost {
            let cut = cut(campaign);
            to.take_campaign(&from, &campaign.id, &campaign.remains, cut.as_deref())?;
        }
    }
    if location.is_none()
        && let Some(shelf) = Shelf::look(data, None)?
    {
        let new = Shelf::open(target, None)?;
        for (digest, condition) in &found.checkpoints {
            if *condition == Condition::Whole {
                new.put(*digest, shelf.get(*digest).await?).await?;
            }
        }
    }
    Ok(found)
}

/// Why a campaign has to be resumed: what of it is missing that its stages make. Labels are made by people.
fn cut(campaign: &CampaignFindings) -> Option<String> {
    let CampaignFindings {
        stored, remains, id, ..
    } = campaign;
    let missing = remains.pictures < stored.pictures
        || remains.generations < stored.generations
        || (stored.taxonomy && !remains.taxonomy);
    missing.then(|| {
        format!(
            "salvaged with {} of {} generations: `murmuration resume {id}` makes what is missing anew",
            remains.generations, stored.generations,
        )
    })
}

/// Whether there is no such folder, or nothing in it.
pub(crate) fn is_empty(folder: &Path) -> bool {
    match fs::read_dir(folder) {
        Ok(mut entries) => entries.next().is_none(),
        Err(error) => error.kind() == std::io::ErrorKind::NotFound,
    }
}
