//! The data directory: one process holds it at a time, and writes its address there for other processes.

use super::{
    FileSystem, LockHolder, StoreError,
    lease::{self, Lease, Unknown},
    open,
};
use murmuration_files::{expect_own_file, expect_regular, has_no_locks};
use murmuration_search::interrupt::Interrupt;
use std::{
    fs,
    io::{self, Read as _, Seek as _, Write as _},
    os::unix::fs::{MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _},
    path::{Path, PathBuf},
    sync::{
        Arc,
        mpsc::{self, RecvTimeoutError},
    },
    thread::{self, JoinHandle},
};
use tokio::sync::watch;

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
    let _ = fs::remove_dir_all(data.join(lease::FOLDER));
    let _ = fs::remove_dir(data);
}

/// Maximum number of bytes that are read of a lock file; a lock file of Murmuration has about 60 bytes.
const MAX_LOCK_BYTES: u64 = 4 << 10;

/// A data directory that this process holds until the value is dropped (or the process ends).
#[derive(Debug)]
pub struct DataDirectory {
    path: PathBuf,
    file_system: FileSystem,
    lease: Arc<Lease>,
    beating: Beating,
    lock: fs::File,
}

/// The thread that changes the counter of the lease, until dropped.
#[derive(Debug)]
struct Beating {
    stop: Option<mpsc::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl DataDirectory {
    /// Name of the lock file.
    pub(crate) const LOCK: &str = "lock.json";
    /// Name of the folder of leases.
    pub(crate) const LEASE: &str = lease::FOLDER;

    /// Holds the data directory at `path`; a missing folder is created. Blocks for some seconds if it is unknown whether the former
    /// holder still runs, on another machine.
    ///
    /// # Errors
    /// [`StoreError::InUse`] if another process holds the folder; any other error names the file that cannot be used.
    pub fn hold(path: &Path) -> Result<Self, StoreError> {
        Self::hold_unless(path, &Interrupt::default())
    }

    /// Like [`DataDirectory::hold`], but ends the wait for another machine's holder when `interrupt` is raised.
    ///
    /// # Errors
    /// The errors of `hold`, and [`StoreError::Interrupted`].
    pub fn hold_unless(path: &Path, interrupt: &Interrupt) -> Result<Self, StoreError> {
        Self::hold_from(path, Unknown::TakeOver(interrupt))
    }

    fn hold_from(path: &Path, unknown: Unknown<'_>) -> Result<Self, StoreError> {
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
            // Whoever can open the file can lock it, and could then pass for the coordinator.
            .mode(0o600)
            .open(&lock_path);
        let lock = match opened {
            Ok(lock) => lock,
            Err(error) => {
                // The disk of a coordinator that runs may have become read-only.
                Self::watch(path)?;
                return Err(failed("open the lock file", &lock_path)(error));
            }
        };
        let file_system = FileSystem::of(path);
        let locked = match lock.try_lock() {
            Ok(()) => true,
            Err(fs::TryLockError::WouldBlock) => return Err(in_use(path, lock)),
            Err(fs::TryLockError::Error(source)) => {
                without_locks(source, &file_system).map_err(failed("lock", &lock_path))?;
                false
            }
        };
        if lock.metadata().is_ok_and(|found| found.mode() & 0o077 != 0) {
            // Earlier versions made a lock file that everybody could read. Some file systems have no permissions.
            let _ = lock.set_permissions(fs::Permissions::from_mode(0o600));
        }
        let lease = match Lease::take(path, &file_system, locked, unknown) {
            Ok(lease) => Arc::new(lease),
            Err(refusal) => return Err(refused(refusal, path, lock)),
        };
        let beating = Beating::of(lease.clone()).map_err(failed("start a thread for", path))?;
        lease.renew(|new, check| {
            let check = || {
                unknown.interrupt().map_or(Ok(()), Interrupt::check)?;
                check()
            };
            open::renew(path, new, &check)
        })?;
        let held = Self {
            path: path.to_path_buf(),
            beating,
            file_system,
            lease,
            lock,
        };
        held.announce("", "")?;
        Ok(held)
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
        let file_system = FileSystem::of(path);
        let locked = match lock.try_lock_shared() {
            Ok(()) => true,
            Err(fs::TryLockError::WouldBlock) => return Err(in_use(path, lock)),
            Err(fs::TryLockError::Error(source)) => {
                without_locks(source, &file_system).map_err(failed)?;
                false
            }
        };
        match lease::is_held(path, &file_system, locked) {
            Ok(false) => Ok(Some(lock)),
            Ok(true) => Err(in_use(path, lock)),
            Err(refusal) => Err(refused(refusal, path, lock)),
        }
    }

    /// Like [`DataDirectory::hold`], but the folder must already have a database, and a holder on another machine is left alone,
    /// whether it is heard or not.
    ///
    /// # Errors
    /// The errors of `hold`, and [`StoreError::NoDirectory`] without a database.
    pub fn hold_existing(path: &Path) -> Result<Self, StoreError> {
        Self::hold_existing_from(path, Unknown::Spare)
    }

    /// Like [`DataDirectory::hold_existing`], but takes over from a holder on another machine as [`DataDirectory::hold`] does.
    ///
    /// # Errors
    /// The errors of `hold_existing`.
    pub fn take_over_existing(path: &Path) -> Result<Self, StoreError> {
        Self::hold_existing_from(path, Unknown::TakeOver(&Interrupt::default()))
    }

    fn hold_existing_from(path: &Path, unknown: Unknown<'_>) -> Result<Self, StoreError> {
        if super::find_database(&path.join(super::Store::FILE))? {
            Self::hold_from(path, unknown)
        } else {
            Err(StoreError::NoDirectory(path.to_path_buf()))
        }
    }

    /// Writes the address of this process's coordinator, and the name of its machine, into the lock file.
    ///
    /// # Errors
    /// If the lock file cannot be written.
    pub fn announce(&self, address: &str, machine: &str) -> Result<(), StoreError> {
        self.lease.check()?;
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

    /// The file system that holds the data directory.
    pub(super) const fn file_system(&self) -> &FileSystem {
        &self.file_system
    }

    pub(super) fn lease(&self) -> Arc<Lease> {
        self.lease.clone()
    }

    /// Returns when another process has taken the data directory over: this process can change nothing from then on.
    pub fn taken_over(&self) -> impl Future<Output = StoreError> + use<> {
        taken_over(self.lease.lost(), self.path.clone())
    }
}

impl Drop for DataDirectory {
    fn drop(&mut self) {
        self.beating.stop();
        if self.lease.check().is_ok() {
            // Nobody listens at the address any more, and whoever listens there next is a stranger.
            let _ = self.lock.set_len(0);
            self.lease.end();
        }
    }
}

impl Beating {
    fn of(lease: Arc<Lease>) -> io::Result<Self> {
        let (stop, stopped) = mpsc::channel();
        let beat = move || {
            let mut count = 0_u64;
            while stopped.recv_timeout(lease::BEAT) == Err(RecvTimeoutError::Timeout) {
                count += 1;
                match lease.check() {
                    Err(StoreError::TakenOver(_)) => return,
                    _ => {
                        // A disk that is full or read-only may be writable again at the next beat.
                        let _ = lease.beat(count);
                    }
                }
            }
        };
        let thread = thread::Builder::new().name("lease".to_owned()).spawn(beat)?;
        Ok(Self {
            stop: Some(stop),
            thread: Some(thread),
        })
    }

    fn stop(&mut self) {
        self.stop = None;
        if let Some(thread) = self.thread.take() {
            // The thread does not panic, and its end is all that matters.
            let _ = thread.join();
        }
    }
}

impl Drop for Beating {
    fn drop(&mut self) {
        self.stop();
    }
}

async fn taken_over(mut lost: watch::Receiver<bool>, path: PathBuf) -> StoreError {
    if lost.wait_for(|&lost| lost).await.is_err() {
        // The lease has ended.
        std::future::pending::<()>().await;
    }
    StoreError::TakenOver(path)
}

fn in_use(path: &Path, lock: fs::File) -> StoreError {
    StoreError::InUse {
        path: path.to_path_buf(),
        holder: read_holder(lock),
    }
}

fn refused(refusal: lease::Refusal, path: &Path, lock: fs::File) -> StoreError {
    match refusal {
        lease::Refusal::Held => in_use(path, lock),
        lease::Refusal::Interrupted(interrupted) => interrupted.into(),
        lease::Refusal::Failed { doing, path, source } => StoreError::from_io(source, doing, &path),
    }
}

/// Accepts that a shared file system has no locks: the lease of the data directory does without them.
fn without_locks(error: io::Error, file_system: &FileSystem) -> io::Result<()> {
    match has_no_locks(&error) && !file_system.is_local() {
        true => Ok(()),
        false => Err(io::Error::other(format!("{error} (on {file_system})"))),
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
