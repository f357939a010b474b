//! The data directory: held by one process at a time, which leaves its address there for others.

use super::{LockHolder, StoreError};
use std::{
    fs,
    io::{self, Read as _, Seek as _, Write as _},
    path::{Path, PathBuf},
};

/// A data directory that this process holds until the value is dropped (or the process dies).
#[derive(Debug)]
pub struct DataDirectory {
    path: PathBuf,
    lock: fs::File,
}

impl DataDirectory {
    /// Name of the lock file.
    const LOCK: &str = "lock.json";

    /// Holds `path`, creating the folder if it does not exist.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if another process holds it; otherwise says which file cannot be used.
    pub fn hold(path: &Path) -> Result<Self, StoreError> {
        let failed = |doing, path: &Path| {
            let path = path.to_path_buf();
            move |source| StoreError::File { doing, path, source }
        };
        super::find(path)?;
        super::expect_folder(path)?;
        fs::create_dir_all(path).map_err(failed("create the data directory", path))?;
        let lock_path = path.join(Self::LOCK);
        // In a folder of somebody else it could lead to any file of this user, which would be written over.
        if fs::symlink_metadata(&lock_path).is_ok_and(|about| about.is_symlink()) {
            let link = io::Error::other("it is a link to another place: remove it");
            return Err(failed("open the lock file", &lock_path)(link));
        }
        let lock = fs::File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&lock_path)
            .map_err(failed("open the lock file", &lock_path))?;
        match lock.try_lock() {
            Ok(()) => {
                let held = Self {
                    path: path.to_path_buf(),
                    lock,
                };
                held.announce("")?;
                Ok(held)
            }
            Err(fs::TryLockError::WouldBlock) => Err(StoreError::InUse {
                path: path.to_path_buf(),
                holder: read_holder(lock),
            }),
            Err(fs::TryLockError::Error(source)) => Err(failed("lock", &lock_path)(source)),
        }
    }

    /// Keeps others from holding a folder while somebody looks at it, and changes nothing there: a file that is locked for as
    /// long as it lives, or `None` where no coordinator has ever been.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if a process holds it; otherwise says which file cannot be used.
    pub fn watch(path: &Path) -> Result<Option<fs::File>, StoreError> {
        super::expect_folder(path)?;
        let lock_path = path.join(Self::LOCK);
        let failed = |source| StoreError::File {
            doing: "open the lock file",
            path: lock_path.clone(),
            source,
        };
        let lock = match fs::File::open(&lock_path) {
            Ok(lock) => lock,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(None),
            Err(error) => return Err(failed(error)),
        };
        match lock.try_lock_shared() {
            Ok(()) => Ok(Some(lock)),
            Err(fs::TryLockError::WouldBlock) => Err(StoreError::InUse {
                path: path.to_path_buf(),
                holder: read_holder(lock),
            }),
            Err(fs::TryLockError::Error(source)) => Err(failed(source)),
        }
    }

    /// Like [`DataDirectory::hold`], but the folder must exist.
    ///
    /// # Errors
    /// As `hold`, and [`StoreError::NoDirectory`].
    pub fn hold_existing(path: &Path) -> Result<Self, StoreError> {
        if super::find_database(&path.join(super::Store::FILE))? {
            Self::hold(path)
        } else {
            Err(StoreError::NoDirectory(path.to_path_buf()))
        }
    }

    /// Says where the coordinator of this process listens.
    ///
    /// # Errors
    /// If the lock file cannot be written.
    pub fn announce(&self, address: &str) -> Result<(), StoreError> {
        let holder = LockHolder {
            process: std::process::id(),
            address: address.to_owned(),
        };
        let write = |mut file: &fs::File| -> io::Result<()> {
            file.set_len(0)?;
            file.rewind()?;
            file.write_all(&serde_json::to_vec(&holder)?)
        };
        write(&self.lock).map_err(|source| StoreError::File {
            doing: "write the lock file",
            path: self.path.join(Self::LOCK),
            source,
        })
    }

    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Reads the holder from the lock file, which it may be writing just now.
fn read_holder(mut lock: fs::File) -> LockHolder {
    let mut text = String::new();
    match lock.read_to_string(&mut text) {
        Ok(_) => serde_json::from_str(&text).unwrap_or_default(),
        Err(_) => LockHolder::default(),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_lock_file_that_is_a_link_is_not_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let elsewhere = folder.path().join("notes.txt");
        fs::write(&elsewhere, "notes").unwrap();
        let data = folder.path().join("data");
        fs::create_dir(&data).unwrap();
        std::os::unix::fs::symlink(&elsewhere, data.join(DataDirectory::LOCK)).unwrap();
        let error = DataDirectory::hold(&data).unwrap_err().to_string();
        assert!(error.contains("lock.json") && error.contains("link"), "{error}");
        assert_eq!(fs::read_to_string(&elsewhere).unwrap(), "notes");
    }
}
