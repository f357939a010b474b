//! The doctor: finds which parts of a data directory are whole, and which parts are damaged. The doctor reads everything and
//! changes nothing.

mod campaign;

pub use campaign::{Amounts, CampaignCondition, CampaignFindings};

use crate::{
    DataDirectory, Store, StoreError,
    blocking::blocking,
    checkpoints::{BlobStore, CheckpointError, Condition},
    files::is_there,
};
use murmuration_swarm::CheckpointDigest;
use std::{
    fs,
    path::{Path, PathBuf},
};

/// Findings about a data directory.
#[derive(Debug)]
pub struct Findings {
    pub database: PathBuf,
    pub schema: u32,
    /// Faults of the database as a whole; empty if the database is sound.
    pub faults: Vec<String>,
    /// Every checkpoint that the database names, with its condition, oldest first.
    pub checkpoints: Vec<(CheckpointDigest, Condition)>,
    /// Every campaign, oldest first.
    pub campaigns: Vec<CampaignFindings>,
}

impl Findings {
    /// Whether nothing is wrong.
    #[must_use]
    pub fn is_healthy(&self) -> bool {
        self.faults.is_empty()
            && self
                .checkpoints
                .iter()
                .all(|(_, condition)| *condition == Condition::Whole)
            && self
                .campaigns
                .iter()
                .all(|campaign| campaign.condition == CampaignCondition::Whole)
    }
}

/// Examines the data directory (or backup) `data`. The checkpoints of `data` are at `location`, or in `data` itself if `location`
/// is `None`.
///
/// # Errors
/// [`StoreError::InUse`] while a coordinator holds `data`; other errors if `data` has no database, or the database cannot be
/// opened at all.
pub async fn examine(data: &Path, location: Option<&str>) -> Result<Findings, CheckpointError> {
    let folder = data.to_path_buf();
    let (watched, store, schema) = blocking(move || watch(&folder)).await??;
    let findings = findings(&store, schema, data, location).await;
    blocking(move || drop((store, watched))).await?;
    findings
}

/// Prevents other processes from holding a data directory while the doctor examines it.
struct Watched {
    _lock: Option<fs::File>,
    /// The file `-shm`, SQLite's index of its write-ahead log, which is removed after the examination; `None` if the file
    /// existed before.
    index: Option<PathBuf>,
}

impl Drop for Watched {
    fn drop(&mut self) {
        if let Some(index) = &self.index {
            // An index that stays does no harm: the next coordinator makes it anew.
            let _ = fs::remove_file(index);
        }
    }
}

fn watch(data: &Path) -> Result<(Watched, Store, u32), StoreError> {
    let lock = DataDirectory::watch(data)?;
    let index = data.join(format!("{}-shm", Store::FILE));
    let is_there = is_there(&index).map_err(|source| StoreError::File {
        doing: "find",
        path: index.clone(),
        source,
    })?;
    let watched = Watched {
        _lock: lock,
        index: (!is_there).then_some(index),
    };
    let (store, schema) = Store::look(data, true)?;
    Ok((watched, store, schema))
}

async fn findings(
    store: &Store,
    schema: u32,
    data: &Path,
    location: Option<&str>,
) -> Result<Findings, CheckpointError> {
    let looked_at = store.clone();
    let (mut faults, records) = blocking(move || {
        let store = looked_at;
        let mut faults = store.faults().unwrap_or_else(|error| vec![error.reason()]);
        faults.extend(store.dangling().unwrap_or_else(|error| vec![error.reason()]));
        (faults, store.checkpoints())
    })
    .await?;
    let mut checkpoints = Vec::new();
    let blobs = BlobStore::look(data, location)?;
    match records {
        Ok(records) => {
            for record in records {
                let condition = match &blobs {
                    Some(blobs) => blobs.condition(record.digest).await,
                    None => Condition::Missing,
                };
                checkpoints.push((record.digest, condition));
            }
        }
        Err(error) => faults.push(error.reason()),
    }
    let (looked_at, conditions) = (store.clone(), checkpoints.clone());
    let campaigns = blocking(move || {
        let ids = looked_at.campaign_ids()?;
        let findings = ids
            .iter()
            .map(|id| CampaignFindings::of(&looked_at, id, &conditions));
        Ok::<Vec<_>, StoreError>(findings.collect())
    })
    .await?;
    let campaigns = campaigns.unwrap_or_else(|error| {
        faults.push(error.reason());
        Vec::new()
    });
    faults.dedup();
    Ok(Findings {
        database: data.join(Store::FILE),
        schema,
        faults,
        checkpoints,
        campaigns,
    })
}

#[cfg(test)]
mod tests;
