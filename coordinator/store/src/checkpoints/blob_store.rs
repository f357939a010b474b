//! The blob store: keeps bytes under their digest in a folder of the data directory, in a folder that a `file://` URL names, or
//! in a bucket.

use super::CheckpointError;
use crate::{
    StoreError,
    files::{is_there, sync},
};
use bytes::Bytes;
use murmuration_swarm::{CheckpointDigest, text::masked_url};
use object_store::{
    ObjectStore, ObjectStoreExt as _, ObjectStoreScheme, local::LocalFileSystem, path::Path as ObjectPath,
};
use std::{
    error::Error,
    fs, io,
    path::{Path, PathBuf},
    sync::Arc,
    time::Duration,
};

/// Time limit for the trial of a blob store.
const TRIAL_LIMIT: Duration = Duration::from_secs(30);

/// Storage of the bytes of checkpoints; cheap to clone.
#[derive(Debug, Clone)]
pub struct BlobStore {
    objects: Arc<dyn ObjectStore>,
    prefix: ObjectPath,
    place: Place,
}

/// Location of the checkpoints, for messages.
#[derive(Debug, Clone)]
enum Place {
    Folder(PathBuf),
    Url(String),
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
        let Some(location) = location else {
            let folder = data.join(Self::FOLDER);
            make_folder(&folder).map_err(|error| refused(folder.display(), &error))?;
            return Self::folder(folder);
        };
        if let Some(folder) = folder_of(location)? {
            make_folder(&folder).map_err(|error| refused(location, &error))?;
            return Self::folder(folder);
        }
        Self::bucket(location)
    }

    fn bucket(location: &str) -> Result<Self, CheckpointError> {
        // The client of a bucket uses the process's cryptography provider. An error means that a provider is installed already.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let url = location.parse().map_err(|error| refused(location, &error))?;
        let variables = std::env::vars().filter(|(name, _)| name.starts_with("AWS_"));
        let variables = variables.map(|(name, value)| (name.to_ascii_lowercase(), value));
        let (objects, prefix) =
            object_store::parse_url_opts(&url, variables).map_err(|error| refused(location, &error))?;
        Ok(Self {
            objects: objects.into(),
            prefix,
            place: Place::Url(location.to_owned()),
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
            && !is_there(&folder).map_err(|error| refused(folder.display(), &error))?
        {
            return Ok(None);
        }
        Self::open(data, location).map(Some)
    }

    fn folder(folder: PathBuf) -> Result<Self, CheckpointError> {
        let objects =
            LocalFileSystem::new_with_prefix(&folder).map_err(|error| refused(folder.display(), &error))?;
        Ok(Self {
            objects: Arc::new(objects.with_fsync(true)),
            prefix: ObjectPath::default(),
            place: Place::Folder(folder),
        })
    }

    /// Tries the blob store out: writes an object, reads it again, and removes it.
    ///
    /// # Errors
    /// [`CheckpointError::Location`] if the trial fails, or takes longer than 30 seconds.
    pub async fn try_out(&self) -> Result<(), CheckpointError> {
        let place = match &self.place {
            Place::Folder(folder) => folder.display().to_string(),
            Place::Url(url) => masked_url(url),
        };
        match tokio::time::timeout(TRIAL_LIMIT, self.write_and_read()).await {
            Ok(tried) => tried.map_err(|error| refused(place, &error)),
            Err(_) => {
                let limit = TRIAL_LIMIT.as_secs();
                Err(refused(
                    place,
                    &format!("it has not answered for {limit} seconds"),
                ))
            }
        }
    }

    async fn write_and_read(&self) -> Result<(), object_store::Error> {
        let object = self
            .prefix
            .clone()
            .join(format!("trial-{:016x}", getrandom::u64().unwrap_or(0)));
        let written = Bytes::from_static(b"murmuration tries whether checkpoints can be kept here");
        self.objects.put(&object, written.clone().into()).await?;
        let read = self.objects.get(&object).await?.bytes().await?;
        // Checkpoints are never removed, so a store that does not allow removal will do.
        if let Err(error) = self.objects.delete(&object).await {
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

    #[must_use]
    pub(crate) const fn is_folder(&self) -> bool {
        matches!(self.place, Place::Folder(_))
    }

    /// Keeps bytes under their digest; they are on disk when this returns.
    ///
    /// # Errors
    /// If the bytes cannot be kept; a full disk gives a [`StoreError::DiskFull`].
    pub async fn put(&self, digest: CheckpointDigest, bytes: Bytes) -> Result<(), CheckpointError> {
        let put = self.objects.put(&self.object(digest), bytes.into()).await;
        put.map(drop).map_err(|error| self.not_put(error))
    }

    /// The bytes of a checkpoint, checked against its digest.
    ///
    /// # Errors
    /// [`CheckpointError::Missing`], [`CheckpointError::Damaged`], or if the blob store cannot be reached.
    pub async fn get(&self, digest: CheckpointDigest) -> Result<Bytes, CheckpointError> {
        let found = match self.objects.get(&self.object(digest)).await {
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
        self.prefix.clone().join(format!("{digest}.onnx"))
    }

    /// Path or address of a checkpoint, for people.
    fn name(&self, digest: CheckpointDigest) -> String {
        match &self.place {
            Place::Folder(folder) => folder.join(format!("{digest}.onnx")).display().to_string(),
            Place::Url(url) => format!("{}/{digest}.onnx", masked_url(url)),
        }
    }

    fn not_put(&self, error: object_store::Error) -> CheckpointError {
        if let (Place::Folder(folder), Some(source)) = (&self.place, io_error(&error))
            && let Some(refused) = StoreError::refused(source.kind(), source, folder)
        {
            return refused.into();
        }
        error.into()
    }
}

/// The folder that a `file://` URL names; `None` for the URL of a bucket.
fn folder_of(location: &str) -> Result<Option<PathBuf>, CheckpointError> {
    let url = location.parse().map_err(|error| refused(location, &error))?;
    let (scheme, _) = ObjectStoreScheme::parse(&url).map_err(|error| refused(location, &error))?;
    match scheme {
        ObjectStoreScheme::Local => match url.to_file_path() {
            Ok(folder) => Ok(Some(folder)),
            Err(()) => Err(refused(location, &"it names no folder of this machine")),
        },
        ObjectStoreScheme::Memory => Err(refused(location, &"memory does not outlast the coordinator")),
        _ => Ok(None),
    }
}

/// Makes a folder and its missing parents; their entries are on disk when this returns.
fn make_folder(folder: &Path) -> io::Result<()> {
    if is_there(folder)? && folder.is_dir() {
        return Ok(());
    }
    let above = match folder.parent() {
        Some(above) if above != Path::new("") => above,
        _ => Path::new("."),
    };
    make_folder(above)?;
    match fs::create_dir(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists || !folder.is_dir() => return Err(error),
        _ => {}
    }
    sync(above)
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

fn refused(location: impl std::fmt::Display, reason: &dyn std::fmt::Display) -> CheckpointError {
    let location = location.to_string();
    let masked = masked_url(&location);
    CheckpointError::Location {
        // The library's reasons quote the URL, which can contain a password.
        reason: reason.to_string().replace(&location, &masked),
        location: masked,
    }
}
