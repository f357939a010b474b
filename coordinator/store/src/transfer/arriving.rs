//! Import of a campaign: a temporary folder keeps the campaign's database until the database is complete and checked. The checked
//! campaign is copied into the store.

use super::{ReceivedCampaign, Unsound, new_folder};
use crate::{
    Store, StoreError,
    blocking::blocking,
    checkpoints::{CheckpointError, Checkpoints},
};
use murmuration_model::CampaignId;
use std::{
    fs::File,
    io::Write as _,
    path::{Path, PathBuf},
    sync::Arc,
};
use tempfile::TempDir;

/// Why a campaign was not imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The store cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The campaign's checkpoints cannot be kept.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A campaign with this id exists already.
    #[error(
        "there is a campaign {0} already: import into another data directory (--data DIR), or compare the two with \
         `murmuration digest`"
    )]
    Exists(CampaignId),
    /// The file that arrived is no database of a campaign.
    #[error("the database of the campaign cannot be imported: {0}")]
    Unsound(#[from] Unsound),
}

/// The partly received database of a campaign.
#[derive(Debug)]
pub struct Arriving {
    store: Store,
    campaign: CampaignId,
    path: PathBuf,
    file: File,
    folder: TempDir,
}

impl Arriving {
    /// Begins to receive the database of this campaign, in a temporary folder of the data directory `data`.
    ///
    /// # Errors
    /// [`ImportError::Exists`], or if the folder cannot be made.
    pub async fn begin(store: &Store, data: &Path, campaign: CampaignId) -> Result<Self, ImportError> {
        let data = data.to_path_buf();
        let begin = move |store: &Store| {
            check_new(store, &campaign)?;
            let folder = new_folder(&data)?;
            let path = folder.path().join("campaign.sqlite");
            let file = File::create_new(&path).map_err(|error| StoreError::from_io(error, "write", &path))?;
            Ok(Self {
                store: store.clone(),
                campaign,
                path,
                file,
                folder,
            })
        };
        store.run(begin).await
    }

    /// Adds the next bytes of the database.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub async fn add(self, bytes: Vec<u8>) -> Result<Self, ImportError> {
        on_disk(move || {
            let written = (&self.file).write_all(&bytes);
            written.map_err(|error| StoreError::from_io(error, "write", &self.path))?;
            Ok(self)
        })
        .await
    }

    /// Checks the received database, and copies the campaign into the store and its checkpoints into `checkpoints`.
    ///
    /// # Errors
    /// [`ImportError`]; the campaign is not imported then. Some of its checkpoints can stay if the disk is full, or if another
    /// campaign with this id came at the same time.
    pub async fn finish(self, checkpoints: &Checkpoints) -> Result<CampaignId, ImportError> {
        let Self {
            store,
            campaign,
            path,
            file,
            folder,
        } = self;
        drop(file);
        let (campaign, received) = on_disk(move || {
            let received = ReceivedCampaign::open(&path)?;
            let found = &received.campaign().record.id;
            if *found != campaign {
                let message = format!("it holds campaign {found}, and not {campaign}");
                return Err(Unsound::Foreign(message).into());
            }
            received.archive::<Unsound>(|_| Ok(()))?;
            Ok((campaign, Arc::new(received)))
        })
        .await?;
        for record in received.checkpoints() {
            let (from, record) = (Arc::clone(&received), record.clone());
            let digest = record.digest;
            let model = on_disk(move || Ok(from.model(&record)?)).await?;
            checkpoints.keep(digest, model.into()).await?;
        }
        let take_over = move |store: &Store| {
            let taken = store.take_over(received.store(), received.campaign());
            drop((received, folder));
            match taken? {
                true => Ok(campaign),
                false => Err(ImportError::Exists(campaign)),
            }
        };
        store.change(take_over).await
    }
}

/// Checks that no campaign has this id.
fn check_new(store: &Store, id: &CampaignId) -> Result<(), ImportError> {
    match store.campaign(id.as_str()) {
        Ok(_) => Err(ImportError::Exists(id.clone())),
        Err(StoreError::NoCampaign(_)) => Ok(()),
        Err(error) => Err(error.into()),
    }
}

async fn on_disk<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ImportError> + Send + 'static,
) -> Result<T, ImportError> {
    blocking(work).await.map_err(StoreError::from)?
}
