//! Checkpoints on disk, by the digest of their bytes.

use crate::cache_folder;
use murmuration_onnx::MAX_MODEL_BYTES;
use murmuration_swarm::CheckpointDigest;
use std::{
    env,
    error::Error,
    fs::{self, File},
    io::{self, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::SystemTime,
};

/// Suffixes of file names: a checkpoint's follows its digest, an unfinished file's follows a random name.
const SUFFIX: &str = ".onnx";
const WRITING: &str = ".writing";

/// A folder of checkpoints with bounded size.
///
/// Several processes can share a folder. A file appears only when it is complete, is checked at every read, and can disappear at
/// any time.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    max_bytes: u64,
    /// Lock that a thread holds during a fetch. Other threads wait for the checkpoint instead of fetching it again.
    fetching: Mutex<()>,
}

/// Why the cache could not be used.
#[derive(Debug, thiserror::Error)]
#[error("checkpoint cache {}: {error}", path.display())]
pub struct CacheError {
    path: PathBuf,
    error: io::Error,
}

/// Why a checkpoint is not available.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    #[error("checkpoint {digest} cannot be fetched: {error}")]
    Source {
        digest: CheckpointDigest,
        error: Box<dyn Error + Send + Sync>,
    },
    /// The received bytes do not have the requested digest.
    #[error("checkpoint {digest}: received bytes with the digest {got}")]
    Mismatch {
        digest: CheckpointDigest,
        /// The digest of the received bytes.
        got: CheckpointDigest,
    },
    /// The cache could not be used.
    #[error(transparent)]
    Cache(#[from] CacheError),
}

/// The default folder of checkpoints: in the [`cache_folder`], or in the folder for temporary files if there is no home
/// directory.
#[must_use]
pub fn checkpoint_folder() -> PathBuf {
    cache_folder()
        .unwrap_or_else(|| env::temp_dir().join("murmuration"))
        .join("checkpoints")
}

impl Cache {
    /// A cache of at most `max_bytes` in `folder`, which is created if needed. The most recently used checkpoint stays even if it
    /// alone exceeds the limit.
    ///
    /// # Errors
    /// Fails if the folder cannot be created.
    pub fn open(folder: impl Into<PathBuf>, max_bytes: u64) -> Result<Self, CacheError> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(at(&folder))?;
        Ok(Self {
            folder,
            max_bytes,
            fetching: Mutex::new(()),
        })
    }

    /// The bytes of a checkpoint: read from the folder, or else fetched with `fetch` and kept in the folder.
    ///
    /// Only one thread at a time calls `fetch`, and only if the folder does not have the checkpoint.
    ///
    /// # Errors
    /// Fails if `fetch` fails or returns bytes with another digest, or the folder cannot be read.
    pub fn get_or_fetch<E: Into<Box<dyn Error + Send + Sync>>>(
        &self,
        digest: CheckpointDigest,
        fetch: impl FnOnce(CheckpointDigest) -> Result<Vec<u8>, E>,
    ) -> Result<Vec<u8>, FetchError> {
        let _one_at_a_time = self.fetching.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(bytes) = self.get(digest)? {
            return Ok(bytes);
        }
        let bytes = fetch(digest).map_err(|error| FetchError::Source {
            digest,
            error: error.into(),
        })?;
        let got = CheckpointDigest::of(&bytes);
        if got != digest {
            return Err(FetchError::Mismatch { digest, got });
        }
        if let Err(error) = self.insert(digest, &bytes) {
            // The disk may be full, for example. The bytes are still correct, so return them; the next call fetches them again.
            tracing::warn!(%error, "a checkpoint is not kept");
        }
        Ok(bytes)
    }

    /// The bytes of a checkpoint; `None` if the folder does not have the checkpoint. Marks the checkpoint as used. Removes a file
    /// whose bytes do not match the digest.
    ///
    /// # Errors
    /// Fails if the folder cannot be read or written.
    pub fn get(&self, digest: CheckpointDigest) -> Result<Option<Vec<u8>>, CacheError> {
        let path = self.file(digest);
        let file = match File::open(&path) {
            Ok(file) => file,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(at(&path)(error)),
        };
        let mut bytes = Vec::new();
        let longest = MAX_MODEL_BYTES as u64 + 1;
        (&file).take(longest).read_to_end(&mut bytes).map_err(at(&path))?;
        if CheckpointDigest::of(&bytes) != digest {
            remove(&path)?;
            return Ok(None);
        }
        // Only the order of eviction depends on the file's time. Errors are ignored, so that a read-only folder can be used.
        let _ = file.set_modified(SystemTime::now());
        Ok(Some(bytes))
    }

    fn insert(&self, digest: CheckpointDigest, bytes: &[u8]) -> Result<(), CacheError> {
        let path = self.file(digest);
        let mut file = tempfile::Builder::new()
            .suffix(WRITING)
            .tempfile_in(&self.folder)
            .map_err(at(&self.folder))?;
        file.write_all(bytes)
            .and_then(|()| file.as_file().sync_all())
            .map_err(at(&path))?;
        file.persist(&path).map_err(|error| at(&path)(error.error))?;
        self.trim(&path)
    }

    /// Removes the least recently used files, but never `kept`, until the rest fits the limit.
    fn trim(&self, kept: &Path) -> Result<(), CacheError> {
        let mut files = Vec::new();
        let mut total = 0;
        for entry in fs::read_dir(&self.folder).map_err(at(&self.folder))? {
            let path = entry.map_err(at(&self.folder))?.path();
            let name = path
                .file_name()
                .and_then(|name| name.to_str())
                .unwrap_or_default();
            // Skip files of other programs, and files that another process removed. Count unfinished files, so that they are
            // evicted too.
            let ours = name.ends_with(SUFFIX) || name.ends_with(WRITING);
            let Some(facts) = fs::metadata(&path).ok().filter(|facts| ours && facts.is_file()) else {
                continue;
            };
            total += facts.len();
            files.push((facts.modified().map_err(at(&path))?, path, facts.len()));
        }
        files.sort();
        for (_, path, bytes) in files {
            if total <= self.max_bytes {
                break;
            }
            if path != kept {
                remove(&path)?;
                total -= bytes;
            }
        }
        Ok(())
    }

    fn file(&self, digest: CheckpointDigest) -> PathBuf {
        self.folder.join(format!("{digest}{SUFFIX}"))
    }
}

fn at(path: &Path) -> impl Fn(io::Error) -> CacheError {
    |error| CacheError {
        path: path.to_owned(),
        error,
    }
}

/// Removes a file; succeeds if the file is already gone.
fn remove(path: &Path) -> Result<(), CacheError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(at(path)(error)),
        _ => Ok(()),
    }
}
