//! Backups: copies a data directory as of one instant, even while a coordinator works on it, and restores a data directory from
//! its copy.
//!
//! A backup is a folder like a data directory, so that the doctor can examine it, with a manifest in addition. The folder gets
//! its name only once the backup is whole, checked and on disk. Limits: a backup does not include caches and reports, because
//! they can be made again. A backup does not include checkpoints in a bucket either: back up the bucket itself.

use crate::{
    DataDirectory, Store, StoreError,
    blocking::Broken,
    checkpoints::{BlobStore, CheckpointError},
    doctor,
    files::{self, is_empty, is_there, log_of, without_links},
    find_database, remove_new,
};
use bytes::Bytes;
use murmuration_files::{InputKind, UnfinishedFolder, digest_of, read_bytes, write_file};
use murmuration_search::interrupt::{Interrupt, Interrupted};
use murmuration_swarm::CheckpointDigest;
use serde::{Deserialize, Serialize};
use std::{
    env,
    ffi::OsStr,
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    time::{SystemTime, UNIX_EPOCH},
};

/// Version of the manifest's format.
const SCHEMA: u32 = 1;
const MANIFEST: &str = "backup.json";

/// Description of a backup's contents, stored in the backup.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Manifest {
    pub schema: u32,
    /// When the backup was made, milliseconds since 1970-01-01 UTC.
    pub created_ms: u64,
    /// The version of Murmuration that made the backup.
    pub murmuration: String,
    /// BLAKE3 of the database, in hexadecimal digits.
    pub database: String,
    /// Digests of the checkpoints that the database names.
    pub checkpoints: Vec<String>,
    /// Location of the checkpoints, if they are not in the backup.
    pub checkpoint_store: Option<String>,
}

/// Why a backup or a restore failed.
#[derive(Debug, thiserror::Error)]
pub enum BackupError {
    /// The database cannot be read or written.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A checkpoint cannot be read or written.
    #[error(transparent)]
    Checkpoint(#[from] CheckpointError),
    /// A file or folder of the backup cannot be used.
    #[error("cannot {doing} {path}: {source}")]
    File {
        doing: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    /// The named target folder cannot be used.
    #[error(transparent)]
    Target(#[from] TargetError),
    #[error("{path} is not a backup ({reason}): `murmuration backup DIR` makes one")]
    NoBackup { path: PathBuf, reason: String },
    /// The copy is not sound.
    #[error("{path} is damaged: `murmuration doctor --data {path}` says what is damaged")]
    Damaged {
        /// The data directory, or the backup.
        path: PathBuf,
    },
    #[error("interrupted: nothing was written")]
    Interrupted(#[from] Interrupted),
}

/// Why a target folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TargetError {
    /// The target folder is not empty.
    #[error("{0} is not empty: name a folder that does not exist yet")]
    NotEmpty(PathBuf),
    /// The backup lies within the data directory, and would be lost with it.
    #[error(
        "{path} is in the data directory {data}: name a folder elsewhere, on another disk if there is one"
    )]
    Within { path: PathBuf, data: PathBuf },
    /// The target or the data directory cannot be read.
    #[error("cannot look into {path}: {source}")]
    Folder { path: PathBuf, source: io::Error },
}

/// Copies the data directory `data`, as of one instant, into the new folder `target`. A coordinator may be working on `data`. The
/// checkpoints are at `location`, or in `data` if `location` is `None`. Checks `interrupt` between files.
///
/// # Errors
/// See [`BackupError`]. After an error, there is no backup at `target`.
pub async fn backup(
    data: &Path,
    location: Option<&str>,
    target: &Path,
    interrupt: &Interrupt,
) -> Result<Manifest, BackupError> {
    let target = &check_target(data, target)?;
    // This check comes before any folder is made.
    let database = data.join(Store::FILE);
    if !find_database(&database)? {
        return Err(StoreError::NoDirectory(data.to_path_buf()).into());
    }
    let parent = above(target);
    make_folders(parent)?;
    let being_written = tempfile::Builder::new()
        .prefix(".murmuration-backup-")
        .tempdir_in(parent)
        .map_err(failed("make a folder in", parent))?;
    let folder = being_written.path();
    let checkpoints = copy(data, location, folder, interrupt).await?;
    let manifest = Manifest {
        schema: SCHEMA,
        created_ms: SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_or(0, |age| age.as_millis() as u64),
        murmuration: env!("CARGO_PKG_VERSION").to_owned(),
        database: file_digest(&folder.join(Store::FILE))?,
        checkpoints: checkpoints.iter().map(ToString::to_string).collect(),
        checkpoint_store: location.map(str::to_owned),
    };
    check(folder, location, data).await?;
    write_manifest(folder, &manifest)?;
    interrupt.check()?;
    // If `target` is an empty folder, this replaces it.
    fs::rename(folder, target).map_err(failed("write", target))?;
    sync(parent)?;
    Ok(manifest)
}

/// Beginning of the name of the folder of a copy that is only read.
const READ_COPY: &str = "murmuration-read-";

/// Copies the database of `data`, which cannot be written, into a new folder of the system's folder for temporary files. Removes the
/// copies that this user's killed processes left there. A coordinator over the copy reads the checkpoints of `data` itself.
///
/// # Errors
/// [`StoreError::InUse`] if a process holds the data directory; other errors if the database cannot be read, or the copy has no room.
pub fn copy_to_read(data: &Path) -> Result<UnfinishedFolder, StoreError> {
    // No process can hold the data directory meanwhile.
    let _alone = DataDirectory::watch(data)?;
    let temporary = env::temp_dir();
    let no_room = |error| StoreError::from_io(error, "make a copy to read in", &temporary);
    let copy = UnfinishedFolder::secret(&temporary, READ_COPY).map_err(no_room)?;
    let place = copy.path().join(Store::FILE);
    let database = data.join(Store::FILE);
    for (from, to) in [
        (database.clone(), place.clone()),
        (log_of(&database), log_of(&place)),
    ] {
        if is_there(&from).map_err(|error| StoreError::from_io(error, "read", &from))? {
            let mut original =
                File::open(&from).map_err(|error| StoreError::from_io(error, "read", &from))?;
            // `fs::copy` would also copy the mode, which may forbid to write.
            let mut copy = File::create_new(to).map_err(no_room)?;
            io::copy(&mut original, &mut copy).map_err(no_room)?;
        }
    }
    let checkpoints = data.join(BlobStore::FOLDER);
    if is_there(&checkpoints).map_err(|error| StoreError::from_io(error, "read", &checkpoints))? {
        let original = checkpoints.canonicalize().map_err(no_room)?;
        std::os::unix::fs::symlink(original, copy.path().join(BlobStore::FOLDER)).map_err(no_room)?;
    }
    Ok(copy)
}

/// Restores the backup `from` as the data directory `data`, which must be empty or not exist. Checks `interrupt` between files.
///
/// # Errors
/// See [`BackupError`]. After an error, there is no database in `data`.
pub async fn restore(from: &Path, data: &Path, interrupt: &Interrupt) -> Result<Manifest, BackupError> {
    let manifest = read_manifest(from)?;
    check_empty(data)?;
    if file_digest(&from.join(Store::FILE))? != manifest.database {
        return Err(BackupError::Damaged {
            path: from.to_path_buf(),
        });
    }
    let is_new = !is_there(data).map_err(failed("find", data))?;
    let held = DataDirectory::hold(data)?;
    // Another process may have written into the folder before this process held it.
    let is_of_holder = |name: &OsStr| name == DataDirectory::LOCK || name == DataDirectory::LEASE;
    let mut entries = fs::read_dir(data).map_err(failed("look into", data))?;
    if !entries.all(|entry| entry.is_ok_and(|entry| is_of_holder(&entry.file_name()))) {
        return Err(TargetError::NotEmpty(data.to_path_buf()).into());
    }
    let mut placed = Vec::new();
    let restored = put_back(from, data, &manifest, interrupt, &mut placed).await;
    if restored.is_err() {
        // Leftovers would block the next restore. The next restore reports leftovers that cannot be removed here.
        clear(data, &placed);
        if is_new {
            // `remove_dir` does not remove a folder into which another process has put something.
            remove_new(data);
        }
    }
    drop(held);
    restored.map(|()| manifest)
}

/// Folder in a data directory to which a restore copies the files before it moves them to their places.
const RESTORING: &str = "restoring";

/// Fills the empty folder `data` from the backup `from`. `placed` gets the names of the entries that this makes in `data`.
async fn put_back(
    from: &Path,
    data: &Path,
    manifest: &Manifest,
    interrupt: &Interrupt,
    placed: &mut Vec<&'static str>,
) -> Result<(), BackupError> {
    // The database moves to its place last, when all checkpoints that it names are in their place.
    let arriving = data.join(RESTORING);
    fs::create_dir(&arriving).map_err(failed("make", &arriving))?;
    placed.push(RESTORING);
    let location = manifest.checkpoint_store.as_deref();
    copy(from, location, &arriving, interrupt).await?;
    check(&arriving, location, from).await?;
    interrupt.check()?;
    for name in [BlobStore::FOLDER, Store::FILE] {
        let (copied, place) = (arriving.join(name), data.join(name));
        if is_there(&copied).map_err(failed("find", &copied))? {
            fs::rename(&copied, &place).map_err(failed("write", &place))?;
            placed.push(name);
        }
    }
    fs::remove_dir(&arriving).map_err(failed("remove", &arriving))?;
    sync(data)
}

/// Removes the entries that a restore has made in a folder, and nothing else.
fn clear(folder: &Path, placed: &[&str]) {
    for name in placed {
        let path = folder.join(name);
        let _ = match path.is_dir() {
            true => fs::remove_dir_all(&path),
            false => fs::remove_file(&path),
        };
    }
}

/// Copies a database, then every checkpoint that the copy names. Returns the digests of the checkpoints. Checkpoints are never
/// deleted, so all checkpoints that the copy names still exist.
async fn copy(
    data: &Path,
    location: Option<&str>,
    folder: &Path,
    interrupt: &Interrupt,
) -> Result<Vec<CheckpointDigest>, BackupError> {
    // If no process holds the data directory now, this lock prevents any process from holding it during the copy.
    let alone = match DataDirectory::watch(data) {
        Ok(lock) => Some(lock),
        Err(StoreError::InUse { .. }) => None,
        Err(error) => return Err(error.into()),
    };
    let path = folder.join(Store::FILE);
    let (store, _) = Store::look(data, alone.is_some())?;
    let copied = path.clone();
    let (store, done) = tokio::task::spawn_blocking(move || {
        let done = store.copy_to(&copied);
        (store, done)
    })
    .await
    .map_err(|_| StoreError::from(Broken))?;
    done?;
    drop(store);
    sync(&path)?;
    let (copied, _) = Store::look(folder, true)?;
    let digests: Vec<_> = copied.checkpoints()?.iter().map(|record| record.digest).collect();
    if location.is_none() && !digests.is_empty() {
        let (blobs, new) = (BlobStore::open(data, None)?, BlobStore::open(folder, None)?);
        for &digest in &digests {
            interrupt.check()?;
            let bytes: Bytes = blobs.get(digest).await?;
            new.put(digest, bytes).await?;
        }
        sync(&folder.join(BlobStore::FOLDER))?;
    }
    sync(folder)?;
    interrupt.check()?;
    Ok(digests)
}

/// Checks that a copy is sound. If the copy is not sound, the error names its original, `of`.
async fn check(folder: &Path, location: Option<&str>, of: &Path) -> Result<(), BackupError> {
    match doctor::examine(folder, location).await? {
        found if found.is_healthy() => Ok(()),
        _ => Err(BackupError::Damaged {
            path: of.to_path_buf(),
        }),
    }
}

/// The parent folder of a path; `.` for a bare name.
fn above(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// Makes a folder and its missing parents, and syncs them to disk.
fn make_folders(folder: &Path) -> Result<(), BackupError> {
    let mut missing = Vec::new();
    for folder in folder.ancestors() {
        if is_there(folder).map_err(failed("find", folder))? {
            break;
        }
        missing.push(folder);
    }
    fs::create_dir_all(folder).map_err(failed("make", folder))?;
    missing.into_iter().try_for_each(|made| sync(above(made)))
}

fn write_manifest(folder: &Path, manifest: &Manifest) -> Result<(), BackupError> {
    let path = folder.join(MANIFEST);
    let written = serde_json::to_vec_pretty(manifest)
        .map_err(io::Error::from)
        .and_then(|text| write_file(&path, text));
    written.map(drop).map_err(failed("write", &path))
}

fn read_manifest(folder: &Path) -> Result<Manifest, BackupError> {
    let no_backup = |reason: String| BackupError::NoBackup {
        path: folder.to_path_buf(),
        reason,
    };
    let path = folder.join(MANIFEST);
    let text = read_bytes(&path, InputKind::Manifest)
        .map_err(|error| no_backup(format!("{}: {error}", path.display())))?;
    let manifest: Manifest =
        serde_json::from_slice(&text).map_err(|error| no_backup(format!("{}: {error}", path.display())))?;
    match manifest.schema {
        SCHEMA => Ok(manifest),
        newer => Err(no_backup(format!(
            "its manifest has version {newer}, but this program reads version {SCHEMA}"
        ))),
    }
}

/// Checks that `target` is empty and not in the data directory `data`, and returns its path without links.
fn check_target(data: &Path, target: &Path) -> Result<PathBuf, TargetError> {
    check_empty(target)?;
    let whole = without_links(target).map_err(unknown(target))?;
    if whole.starts_with(without_links(data).map_err(unknown(data))?) {
        return Err(TargetError::Within {
            path: target.to_path_buf(),
            data: data.to_path_buf(),
        });
    }
    Ok(whole)
}

/// Checks that a folder is empty or does not exist.
fn check_empty(folder: &Path) -> Result<(), TargetError> {
    match is_empty(folder).map_err(unknown(folder))? {
        true => Ok(()),
        false => Err(TargetError::NotEmpty(folder.to_path_buf())),
    }
}

fn unknown(path: &Path) -> impl FnOnce(io::Error) -> TargetError {
    let path = path.to_path_buf();
    move |source| TargetError::Folder { path, source }
}

fn file_digest(path: &Path) -> Result<String, BackupError> {
    let digest = File::open(path).and_then(digest_of);
    digest
        .map(|digest| digest.to_string())
        .map_err(failed("read", path))
}

fn sync(path: &Path) -> Result<(), BackupError> {
    files::sync(path).map_err(failed("write", path))
}

fn failed(doing: &'static str, path: &Path) -> impl FnOnce(io::Error) -> BackupError {
    let path = path.to_path_buf();
    move |source| BackupError::File { doing, path, source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::PermissionsExt as _;

    #[tokio::test]
    async fn an_interrupted_backup_or_restore_leaves_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let [data, copy, restored] = ["data", "copy", "restored"].map(|name| folder.path().join(name));
        let held = DataDirectory::hold(&data).unwrap();
        drop(Store::open(&held).unwrap());
        drop(held);
        backup(&data, None, &copy, &Interrupt::default()).await.unwrap();
        let names = || {
            let entries = fs::read_dir(folder.path()).unwrap();
            let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
            names.sort();
            names
        };
        let before = names();
        let raised = Interrupt::default();
        raised.raise();
        let backed_up = backup(&data, None, &folder.path().join("other"), &raised).await;
        assert!(
            matches!(backed_up, Err(BackupError::Interrupted(_))),
            "{backed_up:?}"
        );
        let put_back = restore(&copy, &restored, &raised).await;
        assert!(
            matches!(put_back, Err(BackupError::Interrupted(_))),
            "{put_back:?}"
        );
        assert_eq!(names(), before);
        restore(&copy, &restored, &Interrupt::default()).await.unwrap();
    }

    #[test]
    fn the_copy_of_a_database_that_nobody_may_write_can_be_written() {
        let folder = tempfile::tempdir().unwrap();
        drop(Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap());
        let database = folder.path().join(Store::FILE);
        fs::set_permissions(&database, fs::Permissions::from_mode(0o444)).unwrap();
        // A killed process left its copy.
        let left = tempfile::Builder::new().prefix(READ_COPY).tempdir().unwrap();
        let copy = copy_to_read(folder.path()).unwrap();
        assert!(!left.path().exists());
        let copied = copy.path().join(Store::FILE);
        assert_eq!(fs::metadata(&copied).unwrap().permissions().mode() & 0o200, 0o200);
        assert_eq!(fs::read(copied).unwrap(), fs::read(database).unwrap());
    }
}
