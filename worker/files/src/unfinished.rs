//! Folders that are being filled, and leftovers of processes that were killed while filling them.

use rustix::{io::Errno, process::geteuid};
use std::{
    fs::{self, File, Metadata, Permissions, TryLockError},
    io,
    os::unix::fs::{MetadataExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
};
use tempfile::TempDir;

/// Maximum number of attempts to create a folder. Another process can remove a new folder as a leftover.
const ATTEMPTS: u32 = 8;

/// A folder that is being filled. The folder's lock shows other processes that the folder is in use. On a file system without locks,
/// no process removes leftovers, so the folder needs none. Dropping this value removes the folder.
#[derive(Debug)]
pub struct UnfinishedFolder {
    folder: TempDir,
    lock: File,
}

impl UnfinishedFolder {
    /// Creates a folder in `parent`, which must exist, with a name that begins with `prefix`. First removes leftovers in
    /// `parent`.
    ///
    /// # Errors
    /// The system's error.
    pub fn new(parent: &Path, prefix: &str) -> io::Result<Self> {
        Self::with_mode(parent, prefix, 0o755)
    }

    /// Creates a folder like [`UnfinishedFolder::new`] that only this process's user may read.
    ///
    /// # Errors
    /// The errors of [`UnfinishedFolder::new`].
    pub fn secret(parent: &Path, prefix: &str) -> io::Result<Self> {
        Self::with_mode(parent, prefix, 0o700)
    }

    fn with_mode(parent: &Path, prefix: &str, mode: u32) -> io::Result<Self> {
        Self::locked(parent, prefix, mode, File::try_lock)
    }

    /// Creates a folder, with `lock` to lock it.
    fn locked(
        parent: &Path,
        prefix: &str,
        mode: u32,
        lock: impl Fn(&File) -> Result<(), TryLockError>,
    ) -> io::Result<Self> {
        remove_leftovers(parent, prefix);
        for _ in 0..ATTEMPTS {
            let folder = tempfile::Builder::new()
                .prefix(prefix)
                .rand_bytes(RANDOM_CHARS)
                .permissions(Permissions::from_mode(mode))
                .tempdir_in(parent)?;
            // Another process may have removed the new folder as a leftover.
            let Ok(opened) = File::open(folder.path()) else {
                continue;
            };
            match lock(&opened) {
                Err(TryLockError::WouldBlock) => continue,
                Err(TryLockError::Error(error)) if !has_no_locks(&error) => return Err(error),
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            if folder.path().exists() {
                return Ok(Self { folder, lock: opened });
            }
        }
        Err(io::Error::other("another process keeps removing the new folder"))
    }

    #[must_use]
    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// The folder, which is no longer removed automatically, and its lock. Once the lock is dropped, other processes remove the
    /// folder as a leftover if it still has its temporary name.
    #[must_use]
    pub fn keep(self) -> (PathBuf, File) {
        (self.folder.keep(), self.lock)
    }
}

/// Whether a file cannot be locked because its file system has no locks: Lustre mounted without `flock`, or NFS without its daemon
/// for locks.
#[must_use]
pub fn has_no_locks(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::Unsupported || error.raw_os_error() == Some(Errno::NOLCK.raw_os_error())
}

/// Number of letters and digits that follow the prefix of a name.
const RANDOM_CHARS: usize = 6;

/// Removes this user's folders in `parent` whose names are `prefix` and six letters or digits, if the processes that filled these
/// folders have ended.
pub fn remove_leftovers(parent: &Path, prefix: &str) {
    let entries = fs::read_dir(parent).into_iter().flatten().flatten();
    for entry in entries {
        let (name, path) = (entry.file_name(), entry.path());
        let name = name.to_string_lossy();
        let is_one = name.strip_prefix(prefix).is_some_and(|rest| {
            rest.len() == RANDOM_CHARS && rest.bytes().all(|byte| byte.is_ascii_alphanumeric())
        });
        let is_own = |found: Metadata| found.is_dir() && found.uid() == geteuid().as_raw();
        if !is_one || !entry.metadata().is_ok_and(is_own) {
            continue;
        }
        let held = File::open(&path).map(|folder| match folder.try_lock() {
            Ok(()) => Some(folder),
            Err(TryLockError::WouldBlock | TryLockError::Error(_)) => None,
        });
        if let Ok(Some(_held)) = held {
            // A folder that cannot be removed does no harm.
            let _ = fs::remove_dir_all(&path);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::chown;

    #[test]
    fn folders_of_processes_that_have_ended_are_removed() {
        let parent = tempfile::tempdir().unwrap();
        let at = |name: &str| parent.path().join(name);
        let others = [".new-kept.replaced", "new-other", ".new-mynotes", ".new-x"];
        for name in [".new-left0a"].iter().chain(&others) {
            fs::create_dir(at(name)).unwrap();
        }
        fs::create_dir(at(".new-0thers")).unwrap();
        let other_user = geteuid().is_root();
        if other_user {
            chown(at(".new-0thers"), Some(1), None).unwrap();
        }
        let living = UnfinishedFolder::new(parent.path(), ".new-").unwrap();
        let other = UnfinishedFolder::new(parent.path(), ".new-").unwrap();
        assert!(!at(".new-left0a").exists());
        assert!(others.iter().all(|name| at(name).exists()));
        assert!(living.path().exists() && other.path().exists());
        assert_eq!(at(".new-0thers").exists(), other_user);
        let secret = UnfinishedFolder::secret(parent.path(), ".secret-").unwrap();
        let mode = secret.path().metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o700);
        drop((living, other, secret));
        let left = others.len() + usize::from(other_user);
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), left);
    }

    #[test]
    fn a_file_system_without_locks_has_folders_too() {
        let parent = tempfile::tempdir().unwrap();
        let with = |errno: Errno| {
            let lock = |_: &File| Err(TryLockError::Error(errno.into()));
            UnfinishedFolder::locked(parent.path(), ".new-", 0o700, lock)
        };
        for errno in [Errno::NOSYS, Errno::NOTSUP, Errno::NOLCK] {
            assert!(with(errno).unwrap().path().exists());
        }
        assert_eq!(
            with(Errno::IO).unwrap_err().raw_os_error(),
            Some(Errno::IO.raw_os_error())
        );
        assert_eq!(fs::read_dir(parent.path()).unwrap().count(), 0);
    }
}
