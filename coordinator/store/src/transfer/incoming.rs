//! A campaign that comes from elsewhere: kept in a data directory of its own until it is whole and checked, and taken over then.
//!
//! Parts are written as they come. In memory are a part, a whole checkpoint while it comes, the places of all individuals in the
//! taxonomy, and what the label log comes to: see [`Sequence`](super::Sequence).

use super::{Medoids, Member, Part};
use crate::{
    CheckpointRecord, DataDirectory, Store, StoreError,
    blocking::blocking,
    checkpoints::{BlobStore, CheckpointError, Checkpoints},
    digest::digest,
    doctor,
    taxonomies::StoredTaxonomy,
};
use murmuration_model::{CampaignId, ExportedCampaign};
use murmuration_proto::CheckpointDigest;
use std::{
    fs,
    path::{Path, PathBuf},
    sync::Arc,
};
use tempfile::TempDir;
use tokio::runtime::Handle;

/// What the name of the folder begins with that a campaign is put together in.
const PREFIX: &str = ".importing-";

/// Removes what imports and deletions that did not end have left in a data directory that is held: the folders of imports, and
/// rows. What cannot be removed stays until the next time.
pub(crate) fn remove_leftovers(store: &Store, data: &Path) {
    let folders = fs::read_dir(data).into_iter().flatten().flatten();
    for folder in folders.filter(|folder| folder.file_name().to_string_lossy().starts_with(PREFIX)) {
        if let Err(error) = fs::remove_dir_all(folder.path()) {
            tracing::warn!(path = %folder.path().display(), %error, "an import's folder is not removed");
        }
    }
    if let Err(error) = store.remove_all_hidden() {
        tracing::warn!(%error, "what imports and deletions left in the database is not removed");
    }
}

/// Why a campaign was not imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The store cannot be read or written.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// Its checkpoints cannot be kept.
    #[error("{0}")]
    Checkpoint(#[from] CheckpointError),
    /// There is a campaign of that id.
    #[error(
        "there is a campaign {0} already: import into another data directory (--data DIR), or compare the two with \
         `murmuration digest`"
    )]
    Exists(CampaignId),
    /// What came does not make a campaign.
    #[error("what was exported is not whole: {0}")]
    Damaged(String),
    /// The archive has another digest than it should have.
    #[error(
        "the archive that came has digest {found}, and was exported with {wanted}: the files were changed"
    )]
    Digest {
        /// The digest that was announced.
        wanted: String,
        /// The digest of what came.
        found: String,
    },
}

/// A campaign of which parts are still to come.
#[derive(Debug)]
pub struct Incoming {
    store: Store,
    blobs: BlobStore,
    place: Place,
    campaign: Arc<ExportedCampaign>,
    is_stored: bool,
    checkpoints: Vec<CheckpointDigest>,
    clusters: Vec<u32>,
    robust_trials: Vec<u8>,
}

/// The data directory that a campaign is put together in. To close its database and to remove it takes a while, which nothing on
/// the network waits for.
#[derive(Debug)]
struct Place {
    path: PathBuf,
    there: Option<Opened>,
}

/// What is dropped with it, in this order.
#[derive(Debug)]
struct Opened {
    held: Option<(Store, DataDirectory)>,
    _folder: TempDir,
}

impl Place {
    /// Closes its database, so that others can look at it.
    fn close(&mut self) {
        if let Some(opened) = &mut self.there {
            drop(opened.held.take());
        }
    }

    /// Removes it, on a thread that may wait.
    fn remove(mut self) {
        drop(self.there.take());
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        if let (Some(opened), Ok(runtime)) = (self.there.take(), Handle::try_current()) {
            drop(runtime.spawn_blocking(move || drop(opened)));
        }
    }
}

impl Incoming {
    /// Nothing yet of a campaign, in a folder of its own in the data directory `data`.
    ///
    /// # Errors
    /// [`ImportError::Exists`], or if the folder cannot be made.
    pub async fn begin(store: &Store, data: &Path, campaign: ExportedCampaign) -> Result<Self, ImportError> {
        let (store, data) = (store.clone(), data.to_path_buf());
        on_disk(move || {
            check_new(&store, &campaign.record.id)?;
            let folder = tempfile::Builder::new()
                .prefix(PREFIX)
                .tempdir_in(&data)
                .map_err(|error| StoreError::from_io(error, "make a folder in", &data))?;
            let path = folder.path().to_path_buf();
            let held = DataDirectory::hold(&path)?;
            let store = Store::open(&held)?.without_sync()?;
            Ok(Self {
                blobs: BlobStore::open(&path, None)?,
                place: Place {
                    path,
                    there: Some(Opened {
                        held: Some((store.clone(), held)),
                        _folder: folder,
                    }),
                },
                store,
                campaign: Arc::new(campaign),
                is_stored: false,
                checkpoints: Vec::new(),
                clusters: Vec::new(),
                robust_trials: Vec::new(),
            })
        })
        .await
    }

    /// Takes in the next part, as a [`Sequence`](super::Sequence) returned it; checkpoints come by [`Incoming::add_checkpoint`].
    ///
    /// # Errors
    /// If it cannot be written.
    pub async fn add(&mut self, part: Part) -> Result<(), ImportError> {
        match part {
            Part::Campaign(_) | Part::Checkpoint(_) | Part::Chunk(_) => Ok(()),
            Part::Generation(record) => {
                let campaign = self.stored().await?;
                self.write(move |store| store.add_generation(&campaign.record.id, &record))
                    .await
            }
            Part::Individuals(members) => self.add_members(members).await,
            Part::Labels(entries) => {
                let campaign = self.stored().await?;
                self.write(move |store| store.add_entries(&campaign.record.id, &entries))
                    .await
            }
            Part::Taxonomy(taxonomy) => self.complete(taxonomy).await,
        }
    }

    /// Takes in a whole checkpoint, as a [`Sequence`](super::Sequence) handed it over.
    ///
    /// # Errors
    /// If it cannot be written.
    pub async fn add_checkpoint(
        &mut self,
        record: CheckpointRecord,
        bytes: Vec<u8>,
    ) -> Result<(), ImportError> {
        self.checkpoints.push(record.digest);
        self.blobs.put(record.digest, bytes.into()).await?;
        self.write(move |store| store.add_checkpoint(&record)).await
    }

    /// Checks everything that has come, and takes it over into `store`, whose checkpoints are these.
    ///
    /// # Errors
    /// [`ImportError`]; the store has no such campaign. Where the disk is full, or another campaign of that id came at the same
    /// time, checkpoints may have stayed.
    pub async fn finish(
        mut self,
        store: Store,
        checkpoints: &Checkpoints,
    ) -> Result<CampaignId, ImportError> {
        self.stored().await?;
        let Self {
            store: own,
            blobs,
            mut place,
            campaign,
            checkpoints: digests,
            ..
        } = self;
        // The doctor looks only at what nobody holds.
        let place = on_disk(move || {
            drop(own);
            place.close();
            Ok(place)
        })
        .await?;
        let found = doctor::examine(&place.path, None).await?;
        if !found.is_healthy() {
            let campaigns = found.campaigns.into_iter().flat_map(|campaign| campaign.problems);
            let mut problems = found.faults.into_iter().chain(campaigns);
            let first = problems.next();
            let first = first.unwrap_or_else(|| "its checkpoints are damaged".to_owned());
            return Err(ImportError::Damaged(first));
        }
        let (path, expected) = (place.path.clone(), Arc::clone(&campaign));
        on_disk(move || check_digest(&path, &expected)).await?;
        let (into, id) = (store.clone(), campaign.record.id.clone());
        on_disk(move || check_new(&into, &id)).await?;
        for digest in digests {
            checkpoints.keep(digest, blobs.get(digest).await?).await?;
        }
        on_disk(move || {
            let id = campaign.record.id.clone();
            let taken = Store::look(&place.path, true).and_then(|(own, _)| store.take_transferred(&own, &id));
            place.remove();
            match taken? {
                true => Ok(id),
                false => Err(ImportError::Exists(id)),
            }
        })
        .await
    }

    /// The campaign, stored once its checkpoints have come.
    async fn stored(&mut self) -> Result<Arc<ExportedCampaign>, ImportError> {
        if !std::mem::replace(&mut self.is_stored, true) {
            let campaign = Arc::clone(&self.campaign);
            self.write(move |store| store.add_transferred(&campaign)).await?;
        }
        Ok(Arc::clone(&self.campaign))
    }

    async fn add_members(&mut self, members: Vec<Member>) -> Result<(), ImportError> {
        let campaign = self.stored().await?;
        let mut individuals = Vec::with_capacity(members.len());
        for member in members {
            self.clusters.extend(member.cluster);
            self.robust_trials.extend(member.robust_trials);
            individuals.push(member.individual);
        }
        self.write(move |store| store.add_individuals(&campaign.record.id, &individuals))
            .await
    }

    async fn complete(&mut self, taxonomy: Medoids) -> Result<(), ImportError> {
        let campaign = self.stored().await?;
        let (medoids, measures) = taxonomy.medoids.into_iter().unzip();
        let stored = StoredTaxonomy {
            medoids,
            clusters: std::mem::take(&mut self.clusters),
            loss: taxonomy.loss,
            measures,
            robust_trials: std::mem::take(&mut self.robust_trials),
        };
        self.write(move |store| store.add_taxonomy(&campaign.record.id, &stored))
            .await
    }

    async fn write(
        &self,
        change: impl FnOnce(&Store) -> Result<(), StoreError> + Send + 'static,
    ) -> Result<(), ImportError> {
        let store = self.store.clone();
        on_disk(move || Ok(change(&store)?)).await
    }
}

/// Whether there is no campaign of that id.
fn check_new(store: &Store, id: &CampaignId) -> Result<(), ImportError> {
    match store.campaign(id.as_str()) {
        Ok(_) => Err(ImportError::Exists(id.clone())),
        Err(StoreError::NoCampaign(_)) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

/// Whether the archive has the digest that was announced.
fn check_digest(folder: &Path, campaign: &ExportedCampaign) -> Result<(), ImportError> {
    let (own, _) = Store::look(folder, true)?;
    let record = &campaign.record;
    let found = digest(&own, &record.id, record.spec.model())?.digest;
    match found == campaign.digest {
        true => Ok(()),
        false => Err(ImportError::Digest {
            wanted: campaign.digest.clone(),
            found,
        }),
    }
}

async fn on_disk<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ImportError> + Send + 'static,
) -> Result<T, ImportError> {
    blocking(work).await.map_err(CheckpointError::from)?
}
