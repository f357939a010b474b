//! Errors of the store, worded for the owner of the data.
//!
//! [`StoreError::may_pass`] distinguishes temporary refusals of the disk from permanent errors.

use crate::{FileSystem, blocking::Broken};
use murmuration_model::{CampaignId, labels::RequestId};
use murmuration_search::interrupt::Interrupted;
use rusqlite::{ErrorCode, ffi};
use std::{
    fmt, io,
    path::{Path, PathBuf},
};

/// The process that holds a data directory, as the lock file names it.
#[derive(Debug, Clone, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default)]
pub struct LockHolder {
    /// Process id of the holder; 0 if the lock file does not have it yet.
    pub process: u32,
    /// Address of the holder's coordinator, `http://HOST:PORT`; empty if the lock file does not have it yet. Only processes of the
    /// same machine reach this address.
    pub address: String,
    /// Name of the holder's machine; empty if it is unknown. A data directory can be on a file system that machines share.
    pub machine: String,
}

impl fmt::Display for LockHolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.process, self.address.as_str()) {
            (0, _) => write!(f, "another murmuration process"),
            (process, "") => write!(f, "process {process}"),
            (process, address) => write!(f, "process {process} at {address}"),
        }
    }
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownCampaign {
    pub id: String,
    /// The campaign whose id is most similar to `id`, if any id is so similar that `id` can be a typing error.
    pub nearest: Option<CampaignId>,
}

impl fmt::Display for UnknownCampaign {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "there is no campaign \"{}\": ", self.id)?;
        if let Some(nearest) = &self.nearest {
            write!(f, "did you mean \"{nearest}\"? ")?;
        }
        f.write_str("`murmuration list` lists the campaigns")
    }
}

/// Why an operation of the store failed. A failed operation changes nothing.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Another process holds the data directory.
    #[error("data directory {path} is in use by {holder}")]
    InUse {
        path: PathBuf,
        /// The process that holds the data directory, as far as the lock file names it.
        holder: super::LockHolder,
    },
    /// The data directory does not exist, and the operation does not create it.
    #[error(
        "there is no data directory at {0}: `murmuration run SPEC.toml` makes one, `--data DIR` names another"
    )]
    NoDirectory(PathBuf),
    #[error("{0} is not a folder, so it cannot be a data directory: name one with `--data DIR`")]
    NoFolder(PathBuf),
    /// A file or folder of the data directory cannot be used.
    #[error("cannot {doing} {path}: {source}")]
    File {
        doing: &'static str,
        path: PathBuf,
        source: io::Error,
    },
    /// The database was written by a newer version of Murmuration.
    #[error(
        "{path} has schema version {found}, this murmuration ({}) knows up to {known}: it was written by a newer \
         version, so run that one; `murmuration --version` prints a program's version (nothing was changed)",
        env!("CARGO_PKG_VERSION")
    )]
    Newer {
        path: PathBuf,
        /// The database's schema version.
        found: u32,
        /// The newest schema version that this program can read.
        known: u32,
    },
    /// The file is no SQLite database, or it is damaged.
    #[error("{path} is damaged ({reason}): `murmuration doctor` says what is damaged")]
    Damaged {
        /// Path of the database, or of a file that the database names.
        path: PathBuf,
        reason: String,
    },
    #[error(
        "the disk that holds {path} is full: make room, then campaigns go on by themselves; the refused request \
         changed nothing: repeat it"
    )]
    DiskFull {
        /// Path of the database, or of the folder of checkpoints.
        path: PathBuf,
    },
    /// The disk refuses a write, or does not confirm it.
    #[error(
        "the disk that holds {path} cannot be written ({reason}): it may be failing, or have become read-only; once it can \
         be written, campaigns go on by themselves; the refused request changed nothing: repeat it"
    )]
    Unwritable {
        /// Path of the database, or of the folder of checkpoints.
        path: PathBuf,
        /// Message of SQLite or the system.
        reason: String,
    },
    /// Another process writes to the database, and has not finished in time.
    #[error("another program has locked {path}: nothing was changed; try again once it has finished")]
    Locked { path: PathBuf },
    /// Another process has taken the data directory over from this process.
    #[error(
        "another process has taken over data directory {0}, because this process could not be heard for a while, or its folder \
         `lease` was removed: this process changes nothing more"
    )]
    TakenOver(PathBuf),
    /// The database's file was removed or replaced.
    #[error(
        "the database {0} was removed or replaced while this process used it: this process changes nothing more. End it, and bring \
         the file back"
    )]
    Replaced(PathBuf),
    /// Another process has gone on from the mirror of this process.
    #[error("another coordinator has gone on from the mirror {0}: this process changes nothing more")]
    MirrorTaken(String),
    /// The data directory has a mirror, which this process was not told to use.
    #[error(
        "data directory {data} has the mirror {mirror}, which would lack every change: start `murmuration serve --mirror {mirror}`, and \
         let commands ask that coordinator. To go on without the mirror for good, remove {file} from the data directory"
    )]
    Mirrored {
        data: PathBuf,
        mirror: String,
        /// Name of the file that says so.
        file: &'static str,
    },
    /// The mirror does not work, so no change can be acknowledged.
    #[error(
        "the mirror {place} does not work ({reason}): decisions and labels wait for it, and campaigns go on; the refused request \
         changed nothing: repeat it"
    )]
    NoMirror { place: String, reason: String },
    /// A change is stored in the data directory, and not yet in the mirror.
    #[error(
        "the change is stored, and the mirror {place} does not have it yet ({reason}): it follows when the mirror works, unless this \
         machine is lost before; do not repeat the request"
    )]
    Unmirrored { place: String, reason: String },
    /// A process uses the data directory, whose file system does not allow a second process.
    #[error(
        "data directory {path} is in use, and on {file_system} no second process can read the database meanwhile: end \
         the coordinator first; `murmuration export` copies a campaign while it runs"
    )]
    Unshared { path: PathBuf, file_system: FileSystem },
    /// The file, its folder or its disk is read-only.
    #[error(
        "{path} cannot be written (read-only file, folder or disk): make it writable or choose another --data"
    )]
    ReadOnly { path: PathBuf },
    /// The store is a copy of a database that cannot be written.
    #[error("nothing can be changed here: {0}")]
    ReadsOnly(String),
    /// No campaign has the requested id.
    #[error("{0}")]
    NoCampaign(UnknownCampaign),
    #[error("there is no study \"{0}\": `murmuration lab study list` lists the studies")]
    NoStudy(String),
    #[error("there is no checkpoint {0}: `murmuration checkpoints list` lists the checkpoints")]
    NoCheckpoint(String),
    /// The archive has no individual with this index.
    #[error("campaign {campaign} has no individual {index}: its archive holds {len}")]
    NoIndividual {
        campaign: String,
        index: u64,
        /// Number of individuals in the archive.
        len: u64,
    },
    /// An earlier request with this id asked for another campaign.
    #[error(
        "request \"{request}\" was made before with other contents and started campaign {campaign}: use another request id"
    )]
    OtherRequest {
        request: RequestId,
        campaign: CampaignId,
    },
    /// The run of a campaign is over, and can no longer change the campaign.
    #[error("campaign {0} has a newer decision (such as pause or cancel), so this run ends")]
    Superseded(CampaignId),
    /// The operation was interrupted, because nobody waits for its result.
    #[error(transparent)]
    Interrupted(#[from] Interrupted),
    #[error(transparent)]
    Broken(#[from] Broken),
    /// The memory does not suffice to compress or decompress images.
    #[error("pictures cannot be compressed: {0}")]
    Compression(io::Error),
    /// Any other error that SQLite reports.
    #[error("{path}: {source}")]
    Sqlite { path: PathBuf, source: rusqlite::Error },
}

/// SQLite's codes for writes that the system refused or did not confirm.
const NOT_WRITTEN: [i32; 8] = [
    ffi::SQLITE_IOERR_WRITE,
    ffi::SQLITE_IOERR_FSYNC,
    ffi::SQLITE_IOERR_DIR_FSYNC,
    ffi::SQLITE_IOERR_TRUNCATE,
    ffi::SQLITE_IOERR_DELETE,
    ffi::SQLITE_IOERR_SHMOPEN,
    ffi::SQLITE_IOERR_SHMSIZE,
    ffi::SQLITE_IOERR_SHMMAP,
];

/// Whether the error is about a stored value that this program never writes.
const fn is_unreadable(error: &rusqlite::Error) -> bool {
    use rusqlite::Error::{FromSqlConversionFailure, IntegralValueOutOfRange, InvalidColumnType};
    matches!(
        error,
        FromSqlConversionFailure(..) | IntegralValueOutOfRange(..) | InvalidColumnType(..)
    )
}

impl StoreError {
    /// Whether the disk caused the error, so that the same change can succeed later.
    #[must_use]
    pub const fn may_pass(&self) -> bool {
        matches!(
            self,
            Self::DiskFull { .. }
                | Self::Unwritable { .. }
                | Self::ReadOnly { .. }
                | Self::Locked { .. }
                | Self::NoMirror { .. }
        )
    }

    /// Whether a process that only reads can use a copy of the database instead.
    #[must_use]
    pub fn leaves_reading(&self) -> bool {
        match self {
            Self::Mirrored { .. } | Self::ReadOnly { .. } => true,
            Self::File { source, .. } => matches!(
                source.kind(),
                io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem
            ),
            _ => false,
        }
    }

    /// Whether the change is stored although it cannot be acknowledged.
    #[must_use]
    pub const fn is_stored(&self) -> bool {
        matches!(self, Self::Unmirrored { .. })
    }

    /// The cause alone of [`StoreError::Damaged`], for messages that name the database and the remedy themselves. Any other error
    /// gives its full message.
    pub fn reason(&self) -> String {
        match self {
            Self::Damaged { reason, .. } => reason.clone(),
            error => error.to_string(),
        }
    }

    /// The error of an operation on a file or folder.
    pub fn from_io(source: io::Error, doing: &'static str, path: &Path) -> Self {
        let path = path.to_path_buf();
        match Self::refused(source.kind(), &source, &path) {
            Some(refused) => refused,
            None => Self::File { doing, path, source },
        }
    }

    /// The store's error, if `kind` means that the disk cannot be written for now.
    pub fn refused(kind: io::ErrorKind, message: &dyn std::fmt::Display, path: &Path) -> Option<Self> {
        let path = path.to_path_buf();
        match kind {
            io::ErrorKind::StorageFull => Some(Self::DiskFull { path }),
            io::ErrorKind::ReadOnlyFilesystem | io::ErrorKind::QuotaExceeded => Some(Self::Unwritable {
                path,
                reason: message.to_string(),
            }),
            _ => None,
        }
    }

    pub(super) fn from_sqlite(source: rusqlite::Error, path: &Path) -> Self {
        let path = path.to_path_buf();
        let code = source
            .sqlite_error()
            .map(|error| (error.code, error.extended_code));
        match code {
            Some((ErrorCode::DiskFull, _)) => Self::DiskFull { path },
            Some((ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked, _)) => Self::Locked { path },
            Some((_, code)) if NOT_WRITTEN.contains(&code) => Self::Unwritable {
                reason: format!("{source}, on {}", FileSystem::of(&path)),
                path,
            },
            Some((ErrorCode::ReadOnly | ErrorCode::PermissionDenied | ErrorCode::CannotOpen, _)) => {
                Self::ReadOnly { path }
            }
            Some((ErrorCode::NotADatabase | ErrorCode::DatabaseCorrupt, _)) => Self::Damaged {
                path,
                reason: source.to_string(),
            },
            None if is_unreadable(&source) => Self::Damaged {
                path,
                reason: source.to_string(),
            },
            _ => Self::Sqlite { path, source },
        }
    }

    /// The error for a stored value that this program never writes.
    pub(super) fn damaged(what: impl Into<String>) -> Self {
        Self::Damaged {
            path: PathBuf::new(),
            reason: what.into(),
        }
    }

    /// Adds the database's path to an error that was raised without this path.
    pub(super) fn at(self, path: &Path) -> Self {
        match self {
            Self::Sqlite { source, .. } => Self::from_sqlite(source, path),
            Self::Damaged { reason, .. } => Self::Damaged {
                path: path.to_path_buf(),
                reason,
            },
            other => other,
        }
    }
}

impl From<rusqlite::Error> for StoreError {
    fn from(source: rusqlite::Error) -> Self {
        Self::Sqlite {
            path: PathBuf::new(),
            source,
        }
    }
}
