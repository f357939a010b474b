//! The blob store: keeps bytes under their digest in a folder of the data directory, in a folder that a `file://` URL names, or
//! in a bucket.

use super::CheckpointError;
use crate::{
    StoreError,
    files::is_there,
    objects::{NoPlace, Objects, SLOWEST, folder_of},
};
use bytes::Bytes;
use murmuration_swarm::CheckpointDigest;
use object_store::{ObjectStoreExt as _, path::Path as ObjectPath};
use std::{error::Error, io, path::Path, time::Duration};

/// Time limit for the trial of a blob store.
const TRIAL_LIMIT: Duration = Duration::from_secs(30);

/// Storage of the bytes of checkpoints; cheap to clone.
#[derive(Debug, Clone)]
pub struct BlobStore {
    objects: Objects,
    /// Where each checkpoint is kept a second time, if anywhere.
    mirror: Option<Objects>,
}

/// Condition of the bytes of a checkpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Condition {
    /// The bytes have the checkpoint's digest.
    Whole,
    Missing,
    Damaged,
    /// The bytes could not be read, for this reason.
    Unread(String),
}

impl BlobStore {
    /// Name of the checkpoints' folder in a data directory.
    pub const FOLDER: &str = "checkpoints";

    /// The blob store at `location`, a URL such as `s3://BUCKET/PREFIX` or `file:///FOLDER`; if `location` is `None`, a folder of
    /// the data directory. The credentials of a bucket are in the AWS tools' environment variables. A missing folder is made.
    ///
    /// # Errors
    /// [`CheckpointError::Location`] if checkpoints cannot be kept at the location.
    pub fn open(data: &Path, location: Option<&str>) -> Result<Self, CheckpointError> {
        let objects = match location {
            None => Objects::in_folder(data.join(Self::FOLDER))?,
            Some(location) => Objects::open(location)?,
        };
        Ok(Self {
            objects,
            mirror: None,
        })
    }

    /// The blob store at `location`, as in [`BlobStore::open`], but without making a folder: `None` if the folder is missing.
    ///
    /// # Errors
    /// The errors of [`BlobStore::open`].
    pub fn look(data: &Path, location: Option<&str>) -> Result<Option<Self>, CheckpointError> {
        let folder = match location {
            None => Some(data.join(Self::FOLDER)),
            Some(location) => folder_of(location)?,
        };
        if let Some(folder) = folder
            && !is_there(&folder).map_err(|error| NoPlace::new(folder.display(), &error))?
        {
            return Ok(None);
        }
        Self::open(data, location).map(Some)
    }

    /// Tries the blob store out: writes an object, reads it again, and removes it.
    ///
    /// # Errors
    /// [`CheckpointError::Location`] if the trial fails, or takes longer than 30 seconds.
    pub async fn try_out(&self) -> Result<(), CheckpointError> {
        let failed = |reason: &dyn std::fmt::Display| NoPlace::new(&self.objects, reason).into();
        match tokio::time::timeout(TRIAL_LIMIT, self.write_and_read()).await {
            Ok(tried) => tried.map_err(|error| failed(&error)),
            Err(_) => {
                let limit = TRIAL_LIMIT.as_secs();
                Err(failed(&format!("it has not answered for {limit} seconds")))
            }
        }
    }

    async fn write_and_read(&self) -> Result<(), object_store::Error> {
        let name = format!("trial-{:016x}", getrandom::u64().unwrap_or(0));
        let object = self.objects.path(&name);
        let written = Bytes::from_static(b"murmuration tries whether checkpoints can be kept here");
        self.objects.store.put(&object, written.clone().into()).await?;
        let read = self.objects.store.get(&object).await?.bytes().await?;
        // Checkpoints are never removed, so a store that does not allow removal will do.
        if let Err(error) = self.objects.store.delete(&object).await {
            tracing::warn!(%error, %object, "the trial object could not be removed from the checkpoint store");
        }
        match read == written {
            true => Ok(()),
            false => Err(object_store::Error::Generic {
                store: "checkpoint store",
                source: "it does not give back what was written".into(),
            }),
        }
    }

    /// Keeps each checkpoint in a mirror too from now on.
    pub(super) fn mirror_to(&mut self, mirror: Objects) {
        self.mirror = Some(mirror);
    }

    /// Copies a checkpoint between the blob store and its mirror, if one of them lacks it, or the mirror has it in part.
    pub(super) async fn copy_missing(&self, digest: CheckpointDigest) -> Result<(), CheckpointError> {
        let Some(mirror) = &self.mirror else { return Ok(()) };
        let other = Self {
            objects: mirror.clone(),
            mirror: None,
        };
        match (self.get(digest).await, other.size(digest).await?) {
            (Ok(bytes), size) if size != Some(bytes.len() as u64) => other.put(digest, bytes).await,
            (Ok(_), _) | (Err(CheckpointError::Missing { .. }), None) => Ok(()),
            (Err(damaged @ CheckpointError::Damaged { .. }), None) => {
                tracing::warn!("{damaged}");
                Ok(())
            }
            (Err(CheckpointError::Missing { .. } | CheckpointError::Damaged { .. }), Some(_)) => {
                let copy = async { self.put(digest, other.get(digest).await?).await };
                if let Err(error) = copy.await {
                    tracing::warn!(%digest, %error, "a checkpoint of the mirror could not be copied");
                }
                Ok(())
            }
            (Err(error), _) => Err(error),
        }
    }

    /// Number of bytes that are kept for a checkpoint; `None` if there are none.
    async fn size(&self, digest: CheckpointDigest) -> Result<Option<u64>, CheckpointError> {
        match self.objects.store.head(&self.object(digest)).await {
            Ok(found) => Ok(Some(found.size)),
            Err(object_store::Error::NotFound { .. }) => Ok(None),
            Err(error) => Err(error.into()),
        }
    }

    #[must_use]
    pub(crate) fn is_folder(&self) -> bool {
        self.objects.folder().is_some()
    }

    /// Keeps bytes under their digest; they are on disk when this returns.
    ///
    /// # Errors
    /// If the bytes cannot be kept; a full disk gives a [`StoreError::DiskFull`].
    pub async fn put(&self, digest: CheckpointDigest, bytes: Bytes) -> Result<(), CheckpointError> {
        let name = file_name(digest);
        let put = self
            .objects
            .store
            .put(&self.objects.path(&name), bytes.clone().into())
            .await;
        put.map_err(|error| self.not_put(error))?;
        if let Some(mirror) = &self.mirror {
            let put = async {
                let path = mirror.path(&name);
                let limit = TRIAL_LIMIT + Duration::from_secs(bytes.len() as u64 / SLOWEST);
                let put = mirror.store.put(&path, bytes.into());
                match tokio::time::timeout(limit, put).await {
                    Ok(put) => put.map(drop).map_err(|error| error.to_string()),
                    Err(_) => Err("it does not answer".to_owned()),
                }
            };
            put.await.map_err(|reason| StoreError::NoMirror {
                place: mirror.to_string(),
                reason,
            })?;
        }
        Ok(())
    }

    /// The bytes of a checkpoint, checked against its digest.
    ///
    /// # Errors
    /// [`CheckpointError::Missing`], [`CheckpointError::Damaged`], or if the blob store cannot be reached.
    pub async fn get(&self, digest: CheckpointDigest) -> Result<Bytes, CheckpointError> {
        let found = match self.objects.store.get(&self.object(digest)).await {
            Ok(found) => found,
            Err(object_store::Error::NotFound { .. }) => {
                let place = self.name(digest);
                return Err(CheckpointError::Missing { digest, place });
            }
            Err(error) => return Err(error.into()),
        };
        let bytes = found.bytes().await?;
        match CheckpointDigest::of(&bytes) {
            found if found == digest => Ok(bytes),
            found => Err(CheckpointError::Damaged {
                place: self.name(digest),
                found,
            }),
        }
    }

    /// Condition of the bytes of a checkpoint.
    pub async fn condition(&self, digest: CheckpointDigest) -> Condition {
        match self.get(digest).await {
            Ok(_) => Condition::Whole,
            Err(CheckpointError::Missing { .. }) => Condition::Missing,
            Err(CheckpointError::Damaged { .. }) => Condition::Damaged,
            Err(error) => Condition::Unread(error.to_string()),
        }
    }

    fn object(&self, digest: CheckpointDigest) -> ObjectPath {
        self.objects.path(&file_name(digest))
    }

    /// Path or address of a checkpoint, for people.
    fn name(&self, digest: CheckpointDigest) -> String {
        self.objects.name(&file_name(digest))
    }

    fn not_put(&self, error: object_store::Error) -> CheckpointError {
        if let (Some(folder), Some(source)) = (self.objects.folder(), io_error(&error))
            && let Some(refused) = StoreError::refused(source.kind(), source, folder)
        {
            return refused.into();
        }
        error.into()
    }
}

fn file_name(digest: CheckpointDigest) -> String {
    format!("{digest}.onnx")
}

/// The system's error among the causes of an error, if any.
fn io_error<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a io::Error> {
    let mut next = Some(error);
    while let Some(error) = next {
        if let Some(source) = error.downcast_ref() {
            return Some(source);
        }
        next = error.source();
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[tokio::test]
    async fn a_checkpoint_and_its_copy_heal_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let mut own = BlobStore::open(folder.path(), None).unwrap();
        own.mirror_to(Objects::in_folder(folder.path().join("mirror")).unwrap());
        let bytes = Bytes::from_static(b"an embedder");
        let digest = CheckpointDigest::of(&bytes);
        let places = [BlobStore::FOLDER, "mirror"].map(|of| folder.path().join(of).join(file_name(digest)));
        own.put(digest, bytes.clone()).await.unwrap();
        for place in &places {
            // Cut, and missing.
            fs::write(place, &bytes[..4]).unwrap();
            own.copy_missing(digest).await.unwrap();
            assert_eq!(fs::read(place).unwrap(), bytes);
            fs::remove_file(place).unwrap();
            own.copy_missing(digest).await.unwrap();
            assert_eq!(fs::read(place).unwrap(), bytes);
        }
    }
}
