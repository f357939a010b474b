//! The data directory: one process holds it at a time, and writes its address there for other processes.

use super::{LockHolder, StoreError};
use murmuration_files::{expect_own_file, expect_regular};
use std::{
    fs,
    io::{self, Read as _, Seek as _, Write as _},
    path::{Path, PathBuf},
};

/// Removes the files that a process made in a new data directory, and the directory if it is empty then. Ignores failures,
/// because leftovers do no harm.
pub fn remove_new(data: &Path) {
    let database = super::Store::FILE;
    for name in [
        database.to_owned(),
        format!("{database}-wal"),
        format!("{database}-shm"),
    ] {
        let _ = fs::remove_file(data.join(name));
    }
    for name in [
        DataDirectory::LOCK,
        "local-token",
        "sessions.json",
        "access.json",
        "self-signed.pem",
    ] {
        let _ = fs::remove_file(data.join(name));
    }
    let _ = fs::remove_dir_all(data.join(super::checkpoints::BlobStore::FOLDER));
    let _ = fs::remove_dir(data);
}

/// Maximum number of bytes that are read of a lock file; a lock file of Murmuration has about 60 bytes.
const MAX_LOCK_BYTES: u64 = 4 << 10;

/// A data directory that this process holds until the value is dropped (or the process ends).
#[derive(Debug)]
pub struct DataDirectory {
    path: PathBuf,
    lock: fs::File,
}

impl DataDirectory {
    /// Name of the lock file.
    pub(crate) const LOCK: &str = "lock.json";

    /// Holds the data directory at `path`; a missing folder is created.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if another process holds the folder; any other error names the file that cannot be used.
    pub fn hold(path: &Path) -> Result<Self, StoreError> {
        let failed = |doing, path: &Path| {
            let path = path.to_path_buf();
            move |source| StoreError::File { doing, path, source }
        };
        super::find(path)?;
        super::expect_folder(path)?;
        create_private(path).map_err(failed("create the data directory", path))?;
        let lock_path = path.join(Self::LOCK);
        // In another user's folder, the lock file could be a link to any file of this user, and this process would overwrite that
        // file.
        match expect_own_file(&lock_path) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => {}
            checked => checked.map_err(failed("open the lock file", &lock_path))?,
        }
        if super::find_database(&path.join(super::Store::FILE)).is_ok_and(|found| !found) {
            expect_ours(&lock_path).map_err(failed("use the lock file", &lock_path))?;
        }
        let opened = fs::File::options()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&lock_path);
        let lock = match opened {
            Ok(lock) => lock,
            Err(error) => {
                // The disk of a coordinator that runs may have become read-only.
                Self::watch(path)?;
                return Err(failed("open the lock file", &lock_path)(error));
            }
        };
        match lock.try_lock() {
            Ok(()) => {
                let held = Self {
                    path: path.to_path_buf(),
                    lock,
                };
                held.announce("", "")?;
                Ok(held)
            }
            Err(fs::TryLockError::WouldBlock) => Err(StoreError::InUse {
                path: path.to_path_buf(),
                holder: read_holder(lock),
            }),
            Err(fs::TryLockError::Error(source)) => Err(failed("lock", &lock_path)(source)),
        }
    }

    /// Prevents other processes from holding a folder while this process examines it, and changes nothing in the folder. Returns
    /// the lock file, which stays locked until the value is dropped; `None` if no coordinator has ever used the folder.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if a process holds the folder; any other error names the file that cannot be used.
    pub fn watch(path: &Path) -> Result<Option<fs::File>, StoreError> {
        super::expect_folder(path)?;
        let lock_path = path.join(Self::LOCK);
        let failed = |source| StoreError::File {
            doing: "open the lock file",
            path: lock_path.clone(),
            source,
        };
        let lock = match expect_regular(&lock_path).and_then(|()| fs::File::open(&lock_path)) {
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

    /// Like [`DataDirectory::hold`], but the folder must already have a database.
    ///
    /// # Errors
    /// The errors of `hold`, and [`StoreError::NoDirectory`] without a database.
    pub fn hold_existing(path: &Path) -> Result<Self, StoreError> {
        if super::find_database(&path.join(super::Store::FILE))? {
            Self::hold(path)
        } else {
            Err(StoreError::NoDirectory(path.to_path_buf()))
        }
    }

    /// Writes the address of this process's coordinator, and the name of its machine, into the lock file.
    ///
    /// # Errors
    /// If the lock file cannot be written.
    pub fn announce(&self, address: &str, machine: &str) -> Result<(), StoreError> {
        let holder = LockHolder {
            process: std::process::id(),
            address: address.to_owned(),
            machine: machine.to_owned(),
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

/// Creates a folder that other users cannot read, and its parents; an existing folder keeps its permissions.
fn create_private(path: &Path) -> io::Result<()> {
    if let Some(parent) = path.parent() {
        fs::create_dir_all(parent)?;
    }
    let mut folder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut folder, 0o700);
    match folder.create(path) {
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists && path.is_dir() => Ok(()),
        created => created,
    }
}

/// Refuses a lock file that Murmuration did not make, in a folder without a database. An empty file is accepted, because a lock
/// file is made before it is written.
fn expect_ours(lock: &Path) -> io::Result<()> {
    let file = match fs::File::open(lock) {
        Ok(file) => file,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error),
    };
    let mut text = Vec::new();
    file.take(MAX_LOCK_BYTES).read_to_end(&mut text)?;
    let fields: Option<serde_json::Map<String, serde_json::Value>> = serde_json::from_slice(&text).ok();
    let is_ours =
        fields.is_some_and(|fields| fields.contains_key("process") && fields.contains_key("address"));
    match text.is_empty() || is_ours {
        true => Ok(()),
        false => Err(io::Error::other(
            "it is not Murmuration's: name another folder as the data directory",
        )),
    }
}

/// Reads the holder from the lock file, which the holder may be writing just now.
fn read_holder(lock: fs::File) -> LockHolder {
    let mut text = String::new();
    match lock.take(MAX_LOCK_BYTES).read_to_string(&mut text) {
        Ok(_) => serde_json::from_str(&text).unwrap_or_default(),
        Err(_) => LockHolder::default(),
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_is_called_like_a_lock_file_stays() {
        let folder = tempfile::tempdir().unwrap();
        let lock = folder.path().join(DataDirectory::LOCK);
        for foreign in ["{\"dependencies\":{}}", "notes"] {
            fs::write(&lock, foreign).unwrap();
            let error = DataDirectory::hold(folder.path()).unwrap_err().to_string();
            assert!(
                error.contains("lock.json") && error.contains("another folder"),
                "{error}"
            );
            assert_eq!(fs::read_to_string(&lock).unwrap(), foreign);
        }
        // The lock file of a process that was killed while it started.
        fs::write(&lock, "").unwrap();
        drop(DataDirectory::hold(folder.path()).unwrap());
        drop(DataDirectory::hold(folder.path()).unwrap());
        let other = folder.path().join("other.txt");
        fs::hard_link(&lock, &other).unwrap();
        let error = DataDirectory::hold(folder.path()).unwrap_err().to_string();
        assert!(error.contains("hard link"), "{error}");
    }

    #[test]
    fn a_lock_file_that_is_a_pipe_or_a_folder_is_not_opened() {
        let folder = tempfile::tempdir().unwrap();
        let lock = folder.path().join(DataDirectory::LOCK);
        let made = std::process::Command::new("mkfifo").arg(&lock).status();
        assert!(made.unwrap().success());
        let check = || {
            for refused in [
                DataDirectory::hold(folder.path()).map(drop),
                DataDirectory::watch(folder.path()).map(drop),
            ] {
                let error = refused.unwrap_err().to_string();
                assert!(error.contains("not a regular file"), "{error}");
            }
        };
        check();
        fs::remove_file(&lock).unwrap();
        fs::create_dir(&lock).unwrap();
        check();
    }

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
