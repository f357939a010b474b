//! Checkpoints: their bytes are in a blob store, under their digest; their descriptions are in the database.

mod blob_store;

pub use blob_store::{BlobStore, Condition};

use crate::{
    CheckpointRecord, Store, StoreError,
    blocking::Broken,
    objects::{NoPlace, Objects},
};
use bytes::Bytes;
use murmuration_model::EmbedderRef;
use murmuration_onnx::{EmbedderModel, ImageShape, ModelError};
use murmuration_swarm::{CheckpointDigest, ImageFormat, Lineage, PictureShape};
use std::{
    collections::HashMap,
    path::Path,
    sync::{Arc, Mutex, PoisonError, Weak},
    time::{SystemTime, UNIX_EPOCH},
};
use tokio::sync;

/// The store of published embedders; cheap to clone.
#[derive(Debug, Clone)]
pub struct Checkpoints {
    store: Store,
    blob_store: BlobStore,
    fetched: Arc<Mutex<HashMap<CheckpointDigest, Fetched>>>,
}

/// The bytes of a checkpoint while any caller holds them, so that concurrent callers share one copy.
type Fetched = Arc<sync::Mutex<Weak<Shared>>>;

#[derive(Debug)]
struct Shared(Bytes);

/// One holder of shared bytes.
struct Sharer(Arc<Shared>);

impl AsRef<[u8]> for Sharer {
    fn as_ref(&self) -> &[u8] {
        &self.0.0
    }
}

/// Why a checkpoint cannot be stored or read.
#[derive(Debug, thiserror::Error)]
pub enum CheckpointError {
    /// Checkpoints cannot be kept at the named location.
    #[error(
        "checkpoints cannot be kept at {location}: {reason}; make it reachable and writable, or name another with \
         --checkpoint-store"
    )]
    Location {
        /// Folder or URL.
        location: String,
        reason: String,
    },
    /// The database cannot be read or written, or lacks the checkpoint.
    #[error(transparent)]
    Store(#[from] StoreError),
    #[error("checkpoint store: {0}")]
    Objects(#[from] object_store::Error),
    /// The bytes are not an embedder that workers can run.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The bytes of a stored checkpoint are gone.
    #[error(
        "checkpoint {digest} is not at {place}: `murmuration checkpoints import` brings it back from a copy"
    )]
    Missing {
        digest: CheckpointDigest,
        /// The file or object that should have the checkpoint's bytes.
        place: String,
    },
    /// The bytes of a stored checkpoint have changed.
    #[error(
        "{place} is damaged (its bytes have digest {found}): `murmuration doctor` says what else is damaged"
    )]
    Damaged {
        /// The file or object that should have the checkpoint's bytes.
        place: String,
        /// The digest of the bytes at `place`.
        found: CheckpointDigest,
    },
    /// The received bytes do not have the announced digest.
    #[error("checkpoint {wanted}: the bytes that came have digest {found}; publish or import it again")]
    Mismatch {
        /// The announced digest.
        wanted: CheckpointDigest,
        /// The digest of the received bytes.
        found: CheckpointDigest,
    },
    /// The embedder takes smaller pictures than the campaign's, or pictures with other channels.
    #[error(
        "checkpoint {checkpoint} embeds pictures of {embedded}, the campaign's are of {pictures}: a picture may be smaller than \
         the embedder's, and grey for one of three channels, but not larger"
    )]
    Pictures {
        checkpoint: CheckpointDigest,
        /// The pictures that the embedder takes.
        embedded: ImageShape,
        /// The campaign's pictures.
        pictures: PictureShape,
    },
}

impl From<NoPlace> for CheckpointError {
    fn from(no_place: NoPlace) -> Self {
        let NoPlace { location, reason } = no_place;
        Self::Location { location, reason }
    }
}

impl From<Broken> for CheckpointError {
    fn from(broken: Broken) -> Self {
        Self::Store(broken.into())
    }
}

/// The place of the checkpoints in a mirror.
#[derive(Debug)]
pub struct CheckpointsOfMirror(pub(crate) Objects);

impl Checkpoints {
    /// Keeps checkpoints on the [`BlobStore`] at `location`.
    ///
    /// # Errors
    /// The errors of [`BlobStore::open`].
    pub fn open(store: Store, data: &Path, location: Option<&str>) -> Result<Self, CheckpointError> {
        let blob_store = BlobStore::open(data, location)?;
        Ok(Self {
            store,
            blob_store,
            fetched: Arc::default(),
        })
    }

    /// Keeps every checkpoint in a mirror too. Checkpoints that only the mirror has are copied from it.
    ///
    /// If that fails, it is only logged, so that the other campaigns go on: a campaign that needs the checkpoint fails.
    ///
    /// # Errors
    /// If a checkpoint cannot be copied to the mirror.
    pub async fn mirrored(mut self, mirror: CheckpointsOfMirror) -> Result<Self, CheckpointError> {
        self.blob_store.mirror_to(mirror.0);
        for record in self.list().await? {
            self.blob_store.copy_missing(record.digest).await?;
        }
        Ok(self)
    }

    /// Tests whether checkpoints can be kept at `location`, before they are.
    ///
    /// # Errors
    /// [`CheckpointError::Location`] if checkpoints cannot be kept there.
    pub async fn try_out(data: &Path, location: &str) -> Result<(), CheckpointError> {
        BlobStore::open(data, Some(location))?.try_out().await
    }

    /// Checks every checkpoint in a folder against its digest; checkpoints in a bucket are checked when they are fetched. A
    /// missing checkpoint is only logged: a campaign that needs it fails.
    ///
    /// # Errors
    /// [`CheckpointError::Damaged`], or if the checkpoints cannot be read.
    pub async fn verify(&self) -> Result<(), CheckpointError> {
        if !self.blob_store.is_folder() {
            return Ok(());
        }
        for record in self.list().await? {
            match self.blob_store.get(record.digest).await {
                Ok(_) => {}
                Err(missing @ CheckpointError::Missing { .. }) => tracing::warn!("{missing}"),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Stores a checkpoint, which is on disk when this returns. Publishing the same bytes again changes nothing. The checkpoint's
    /// labelled pictures then include the labelled pictures of its parent.
    ///
    /// # Errors
    /// [`CheckpointError::Model`] if the bytes are no embedder; [`StoreError::NoCheckpoint`] if the parent is not stored here;
    /// other errors if the checkpoint cannot be stored.
    pub async fn publish(
        &self,
        mut lineage: Lineage,
        bytes: Bytes,
    ) -> Result<CheckpointRecord, CheckpointError> {
        EmbedderModel::read(&bytes)?;
        if let Some(parent) = lineage.parent {
            lineage
                .labelled
                .join(&self.describe(parent).await?.lineage.labelled);
        }
        let digest = CheckpointDigest::of(&bytes);
        let created_ms = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64);
        let record = CheckpointRecord {
            digest,
            size: bytes.len() as u64,
            lineage,
            created_ms,
        };
        self.blob_store.put(digest, bytes).await?;
        let add = move |store: &Store| {
            store.add_checkpoint(&record)?;
            store.checkpoint(record.digest)
        };
        Ok(self.store.run(add).await?)
    }

    /// Stores the bytes of a checkpoint that has no description yet; they are on disk when this returns.
    ///
    /// # Errors
    /// If the bytes cannot be stored.
    pub(crate) async fn keep(&self, digest: CheckpointDigest, bytes: Bytes) -> Result<(), CheckpointError> {
        self.blob_store.put(digest, bytes).await
    }

    /// The description of a checkpoint.
    ///
    /// # Errors
    /// [`StoreError::NoCheckpoint`] if no checkpoint has this digest.
    pub async fn describe(&self, digest: CheckpointDigest) -> Result<CheckpointRecord, CheckpointError> {
        Ok(self.store.run(move |store| store.checkpoint(digest)).await?)
    }

    /// Every checkpoint, oldest first.
    ///
    /// # Errors
    /// If the database cannot be read.
    pub async fn list(&self) -> Result<Vec<CheckpointRecord>, CheckpointError> {
        Ok(self.store.run(Store::checkpoints).await?)
    }

    /// The ONNX bytes of a checkpoint, checked against its digest. Concurrent callers share one copy.
    ///
    /// # Errors
    /// If no checkpoint has this digest, or the checkpoint's bytes are missing or damaged.
    pub async fn fetch(&self, digest: CheckpointDigest) -> Result<Bytes, CheckpointError> {
        self.describe(digest).await?;
        let fetched = self.fetched(digest);
        let mut shared = fetched.lock().await;
        let bytes = match shared.upgrade() {
            Some(bytes) => bytes,
            None => Arc::new(Shared(self.blob_store.get(digest).await?)),
        };
        *shared = Arc::downgrade(&bytes);
        Ok(Bytes::from_owner(Sharer(bytes)))
    }

    /// The entry of a checkpoint in `fetched`. Drops the entries of checkpoints that no caller holds or waits for.
    fn fetched(&self, digest: CheckpointDigest) -> Fetched {
        let mut all = self.fetched.lock().unwrap_or_else(PoisonError::into_inner);
        let is_idle = |fetched: &Fetched| fetched.try_lock().is_ok_and(|bytes| bytes.strong_count() == 0);
        all.retain(|_, fetched| !is_idle(fetched));
        Arc::clone(all.entry(digest).or_default())
    }

    /// A checkpoint as an embedder of pictures in `format`.
    ///
    /// # Errors
    /// The errors of [`Checkpoints::fetch`], and [`CheckpointError::Pictures`] if the checkpoint takes other pictures.
    pub async fn embedder(
        &self,
        checkpoint: CheckpointDigest,
        format: &ImageFormat,
    ) -> Result<EmbedderRef, CheckpointError> {
        let model = EmbedderModel::read(&self.fetch(checkpoint).await?)?;
        let (embedded, pictures) = (model.images(), format.shape());
        if !embedded.takes(pictures.into()) {
            return Err(CheckpointError::Pictures {
                checkpoint,
                embedded,
                pictures,
            });
        }
        Ok(EmbedderRef {
            checkpoint,
            dimensions: model.dimensions(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DataDirectory;

    const MODEL: &[u8] = include_bytes!("../../../tests/models/small.onnx");

    fn open() -> (tempfile::TempDir, Checkpoints) {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let checkpoints = Checkpoints::open(store, folder.path(), None).unwrap();
        (folder, checkpoints)
    }

    #[tokio::test]
    async fn what_is_published_is_fetched_under_its_digest() {
        let (_folder, checkpoints) = open();
        let bytes = Bytes::from_static(MODEL);
        let lineage = Lineage {
            configuration: "x = 1".into(),
            ..Lineage::default()
        };
        let record = checkpoints.publish(lineage.clone(), bytes.clone()).await.unwrap();
        assert_eq!(
            (record.digest, record.size),
            (CheckpointDigest::of(&bytes), MODEL.len() as u64)
        );
        assert_eq!(checkpoints.fetch(record.digest).await.unwrap(), bytes);
        // Publishing the same bytes again changes nothing.
        let again = checkpoints.publish(Lineage::default(), bytes).await.unwrap();
        assert_eq!(
            (again.lineage, checkpoints.list().await.unwrap().len()),
            (lineage, 1)
        );
    }

    #[tokio::test]
    async fn all_who_have_a_checkpoint_at_once_share_its_bytes() {
        let (_folder, checkpoints) = open();
        let bytes = Bytes::from_static(MODEL);
        let digest = checkpoints
            .publish(Lineage::default(), bytes.clone())
            .await
            .unwrap()
            .digest;
        let (one, other) = tokio::join!(checkpoints.fetch(digest), checkpoints.fetch(digest));
        let (one, other) = (one.unwrap(), other.unwrap());
        assert_eq!((one.as_ptr(), &one), (other.as_ptr(), &bytes));
        drop(one);
        assert_eq!(checkpoints.fetch(digest).await.unwrap().as_ptr(), other.as_ptr());
        drop(other);
        assert_eq!(checkpoints.fetched(digest).lock().await.strong_count(), 0);
    }

    #[tokio::test]
    async fn damaged_bytes_are_not_handed_out() {
        let (folder, checkpoints) = open();
        let digest = checkpoints
            .publish(Lineage::default(), Bytes::from_static(MODEL))
            .await
            .unwrap()
            .digest;
        std::fs::write(
            folder.path().join(format!("checkpoints/{digest}.onnx")),
            b"another",
        )
        .unwrap();
        let error = checkpoints.fetch(digest).await.unwrap_err();
        assert!(
            matches!(&error, CheckpointError::Damaged { place, .. } if place.contains(&digest.to_string())),
            "{error}"
        );
        let message = checkpoints.verify().await.unwrap_err().to_string();
        assert!(message.contains("murmuration doctor"), "{message}");
        // A missing checkpoint does no harm until it is needed. Publishing the same bytes restores the checkpoint.
        std::fs::remove_file(folder.path().join(format!("checkpoints/{digest}.onnx"))).unwrap();
        checkpoints.verify().await.unwrap();
        let error = checkpoints.fetch(digest).await.unwrap_err();
        assert!(matches!(error, CheckpointError::Missing { .. }), "{error}");
        let again = Bytes::from_static(MODEL);
        checkpoints
            .publish(Lineage::default(), again.clone())
            .await
            .unwrap();
        assert_eq!(checkpoints.fetch(digest).await.unwrap(), again);
    }

    #[tokio::test]
    async fn a_checkpoint_that_is_not_there_is_named() {
        let (_folder, checkpoints) = open();
        let digest = CheckpointDigest::of(b"nothing");
        let message = checkpoints.fetch(digest).await.unwrap_err().to_string();
        assert!(message.contains(&digest.to_string()), "{message}");
    }

    #[test]
    fn a_place_that_is_none_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        for (location, shown) in [
            ("nonsense", "nonsense"),
            ("gopher://x/y", "gopher://x/y"),
            ("gopher://ana:swordfish@x/y", "gopher://***@x/y"),
        ] {
            let message = Checkpoints::open(store.clone(), folder.path(), Some(location))
                .unwrap_err()
                .to_string();
            assert!(
                message.starts_with(&format!("checkpoints cannot be kept at {shown}"))
                    && !message.contains("swordfish"),
                "{message}"
            );
        }
    }

    #[tokio::test]
    async fn what_is_no_embedder_is_refused() {
        let (_folder, checkpoints) = open();
        let refused = checkpoints
            .publish(Lineage::default(), Bytes::from_static(b"a model"))
            .await;
        assert!(matches!(refused, Err(CheckpointError::Model(_))));
        assert_eq!(checkpoints.list().await.unwrap(), []);
    }
}
