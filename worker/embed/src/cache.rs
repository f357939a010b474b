//! Checkpoints on disk, by the digest of their bytes.

use crate::cache_folder;
use murmuration_proto::{CheckpointDigest, onnx::MAX_MODEL_BYTES};
use std::{
    env,
    error::Error,
    fs::{self, File},
    io::{self, Read as _, Write as _},
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
    time::SystemTime,
};

/// What a checkpoint's file is called after its digest, and one that is being written after a random name.
const SUFFIX: &str = ".onnx";
const WRITING: &str = ".writing";

/// A folder of checkpoints that does not grow beyond a bound.
///
/// Several processes may share a folder: a file appears whole or not at all, is checked whenever it is read, and may
/// go at any time.
#[derive(Debug)]
pub struct Cache {
    folder: PathBuf,
    max_bytes: u64,
    /// Held while a checkpoint is fetched: threads that want the same one at once wait, and find it here.
    fetching: Mutex<()>,
}

/// Why the cache could not be used.
#[derive(Debug, thiserror::Error)]
#[error("checkpoint cache {}: {error}", path.display())]
pub struct CacheError {
    path: PathBuf,
    error: io::Error,
}

/// Why a checkpoint could not be had.
#[derive(Debug, thiserror::Error)]
pub enum FetchError {
    /// Whoever was asked for it did not give it.
    #[error("checkpoint {digest} cannot be fetched: {error}")]
    Source {
        /// The checkpoint.
        digest: CheckpointDigest,
        /// What was said.
        error: Box<dyn Error + Send + Sync>,
    },
    /// What came is something else.
    #[error("checkpoint {digest}: other bytes came, of digest {got}")]
    Mismatch {
        /// The checkpoint that was asked for.
        digest: CheckpointDigest,
        /// Digest of what came.
        got: CheckpointDigest,
    },
    /// The cache could not be used.
    #[error(transparent)]
    Cache(#[from] CacheError),
}

/// Where checkpoints are kept unless told otherwise: in the [`cache_folder`], or among temporary files without a home.
#[must_use]
pub fn checkpoint_folder() -> PathBuf {
    cache_folder()
        .unwrap_or_else(|| env::temp_dir().join("murmuration"))
        .join("checkpoints")
}

impl Cache {
    /// A cache in `folder`, which is made if need be, of at most `max_bytes` in all; the checkpoint used last stays
    /// even if it alone is larger.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub fn open(folder: impl Into<PathBuf>, max_bytes: u64) -> Result<Self, CacheError> {
        let folder = folder.into();
        fs::create_dir_all(&folder).map_err(at(&folder))?;
        Ok(Self {
            folder,
            max_bytes,
            fetching: Mutex::new(()),
        })
    }

    /// The bytes of a checkpoint: from the folder, or else from `fetch`, and then kept.
    ///
    /// `fetch` is called by one thread at a time, and not again for what the folder has by then.
    ///
    /// # Errors
    /// Where `fetch` fails or gives other bytes than those of `digest`, or the folder cannot be read.
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
            // Of a full disk: they are what was asked for all the same, and fetched again the next time.
            tracing::warn!(%error, "a checkpoint is not kept");
        }
        Ok(bytes)
    }

    /// The bytes of a checkpoint if the folder has them, and marks them as used. A file with other bytes is removed.
    ///
    /// # Errors
    /// If the folder cannot be read or written.
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
        // Only the order of removal rests on it: a folder that may not be written is still read.
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

    /// Removes what was used longest ago until the rest is within the bound; never `kept`.
    fn trim(&self, kept: &Path) -> Result<(), CacheError> {
        let mut files = Vec::new();
        let mut total = 0;
        for entry in fs::read_dir(&self.folder).map_err(at(&self.folder))? {
            let path = entry.map_err(at(&self.folder))?.path();
            let name = path
                .file_name()
                .and_then(|name| name.to_str())
                .unwrap_or_default();
            // Another process may have removed it; what is not ours is left alone. What was begun and never finished
            // counts, so that it goes in its turn.
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

/// Removes a file, unless somebody else did.
fn remove(path: &Path) -> Result<(), CacheError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(at(path)(error)),
        _ => Ok(()),
    }
}
