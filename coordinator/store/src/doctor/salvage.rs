//! What can be saved of a data directory, in a new one.

use super::{CampaignFindings, Findings, Prospect, findings, watch};
use crate::{
    DataDirectory, Store, StoreError,
    checkpoints::{BlobStore, CheckpointError, Condition},
    target::{TargetError, check_target},
};
use murmuration_model::CampaignId;
use murmuration_proto::{CheckpointDigest, counted};
use std::path::Path;

/// Why nothing, or not all that was whole, was saved.
#[derive(Debug, thiserror::Error)]
pub enum SalvageError {
    /// The old or the new store.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// The checkpoints of either.
    #[error("{0}")]
    Checkpoints(#[from] CheckpointError),
    /// Nothing can be copied into the folder that was named.
    #[error(transparent)]
    Target(#[from] TargetError),
}

/// What was found in a data directory, and what of it is in the new one.
#[derive(Debug)]
pub struct Salvaged {
    /// What was found.
    pub findings: Findings,
    /// The campaigns that are in the new one, whole or from their beginning on.
    pub campaigns: Vec<CampaignId>,
    /// The campaigns that are not, each with why.
    pub lost: Vec<(CampaignId, String)>,
    /// The checkpoints that are whole, and described in the new one; in it, unless they are kept elsewhere.
    pub checkpoints: Vec<CheckpointDigest>,
}

impl Salvaged {
    /// Whether there is nothing in the new one; it was not made then.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.campaigns.is_empty() && self.checkpoints.is_empty()
    }
}

/// Copies what is whole of the data directory `data` into the new one `target`, which then opens, and whose campaigns can
/// be resumed. Campaigns that are cut off somewhere have failed there, and say where. Where nothing can be copied no
/// `target` is made.
///
/// # Errors
/// See [`SalvageError`].
pub async fn salvage(data: &Path, location: Option<&str>, target: &Path) -> Result<Salvaged, SalvageError> {
    check_target(data, target)?;
    let (_watched, from, schema) = watch(data)?;
    let found = findings(&from, schema, data, location).await?;
    let whole = found
        .checkpoints
        .iter()
        .filter(|(_, condition)| *condition == Condition::Whole);
    let mut salvaged = Salvaged {
        checkpoints: whole.map(|(digest, _)| *digest).collect(),
        campaigns: Vec::new(),
        lost: Vec::new(),
        findings: found,
    };
    let mut campaigns = salvaged.findings.campaigns.iter();
    if salvaged.checkpoints.is_empty() && campaigns.all(|campaign| campaign.prospect == Prospect::Lost) {
        salvaged.lost = salvaged.findings.campaigns.iter().map(lost).collect();
        return Ok(salvaged);
    }
    let held = DataDirectory::hold(target)?;
    let to = Store::open(&held)?;
    to.take_checkpoints(&from)?;
    for campaign in &salvaged.findings.campaigns {
        if campaign.prospect == Prospect::Lost {
            salvaged.lost.push(lost(campaign));
            continue;
        }
        let cut = cut(campaign);
        match to.take_campaign(&from, &campaign.id, &campaign.remains, cut.as_deref()) {
            Ok(()) => salvaged.campaigns.push(campaign.id.clone()),
            // One campaign's damage is not to cost the others.
            Err(error @ StoreError::Damaged { .. }) => {
                salvaged.lost.push((campaign.id.clone(), error.reason()))
            }
            Err(error) => return Err(error.into()),
        }
    }
    if location.is_none()
        && let Some(blobs) = BlobStore::look(data, None)?
    {
        let new = BlobStore::open(target, None)?;
        for &digest in &salvaged.checkpoints {
            new.put(digest, blobs.get(digest).await?).await?;
        }
    }
    Ok(salvaged)
}

/// A campaign of which nothing can be copied, and why.
fn lost(campaign: &CampaignFindings) -> (CampaignId, String) {
    let why = campaign.problems.first().cloned();
    (
        campaign.id.clone(),
        why.unwrap_or_else(|| "it cannot be read".to_owned()),
    )
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
            "salvaged with {} of {}: `murmuration resume {id}` makes what is missing anew",
            remains.generations,
            counted(stored.generations.into(), "generation"),
        )
    })
}
