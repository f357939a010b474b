//! The mirror: a copy of the database in a folder or bucket, from which another machine goes on.
//!
//! A coordinator sends its database's log to the mirror, as numbered entries (the module `entries`). A change that a person or another
//! program decided is acknowledged once the mirror has it; the changes of a campaign's run follow within a second, because a run
//! that goes on computes them again. A coordinator that goes on from the mirror writes the next entry. From then on the former
//! one cannot write its next entry, which has the same number, and so can acknowledge nothing more.
//!
//! An entry has frames of SQLite's write-ahead log. A restore gives SQLite the same log, and SQLite verifies its checksums. Litestream
//! mirrors a database in this way; the fence by numbered entries is that of Delta Lake and SlateDB.

mod entries;
mod progress;
mod restore;
mod sending;

use crate::{
    DataDirectory, Store, StoreError,
    checkpoints::CheckpointsOfMirror,
    files::{read_short, sync},
    find_database,
    objects::{NoPlace, Objects},
};
use bytes::Bytes;
use entries::{Entries, Entry, Placed, What};
use murmuration_files::write_file;
pub(crate) use progress::{End, Mirror};
pub(crate) use sending::start;
use serde::{Deserialize, Serialize};
use std::{
    io,
    path::{self, Path, PathBuf},
};

/// The file of a data directory that names the entries of its processes in the mirror.
const FILE: &str = "mirror.json";
/// Attempts to write the first entry, while a former coordinator still writes.
const CLAIMS: usize = 20;

/// Why a mirror cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum MirrorError {
    #[error("no mirror can be at {location}: {reason}")]
    Location {
        /// Folder or URL.
        location: String,
        reason: String,
    },
    #[error("the mirror {place} cannot be used: {source}")]
    Objects {
        place: String,
        source: object_store::Error,
    },
    #[error("the mirror {place} does not answer")]
    Silent { place: String },
    #[error("{object} in the mirror is damaged: {reason}")]
    Damaged { object: String, reason: String },
    #[error(
        "the mirror {0} has the campaigns of another data directory, or another coordinator has gone on from it: \
         --from-mirror goes on with them in a new --data; another --mirror leaves them"
    )]
    Foreign(String),
    #[error(
        "data directory {data} has a database, from which the mirror {place} does not go on: to go on from the mirror, name a new \
         --data (the mirror has all that {data} acknowledged while it had this mirror)"
    )]
    NotEmpty { data: PathBuf, place: String },
    #[error(
        "the mirror {0} replaces objects although it is asked not to (If-None-Match), so two coordinators could write to it: use another \
         object store"
    )]
    NoFence(String),
    #[error("others write to the mirror {0} all the time: end them first")]
    Contested(String),
    #[error("the mirror's copy of the database cannot be written: {0}")]
    File(#[from] io::Error),
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl MirrorError {
    const fn is_not_found(&self) -> bool {
        matches!(
            self,
            Self::Objects {
                source: object_store::Error::NotFound { .. },
                ..
            }
        )
    }
}

impl From<NoPlace> for MirrorError {
    fn from(no_place: NoPlace) -> Self {
        let NoPlace { location, reason } = no_place;
        Self::Location { location, reason }
    }
}

/// The processes of a data directory that wrote to the mirror, as the data directory remembers them.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Writers {
    /// The process that holds the directory now, or held it last.
    writer: String,
    /// The process that wrote the newest entry before, in case that `writer` never wrote.
    former: String,
    /// Whether the directory's database is still being made from the mirror.
    restoring: bool,
}

impl Writers {
    fn wrote(&self, entry: &Entry) -> bool {
        let writers = [&self.writer, &self.former];
        !self.restoring && !entry.writer.is_empty() && writers.contains(&&entry.writer)
    }

    fn write(&self, data: &Path) -> Result<(), MirrorError> {
        let bytes = serde_json::to_vec(self).map_err(io::Error::other)?;
        write_file(&data.join(FILE), &bytes)?;
        Ok(sync(data)?)
    }
}

/// A mirror in which this process has written the newest entry.
#[derive(Debug)]
pub struct Claimed {
    entries: Entries,
    writer: String,
    /// Number of the next entry.
    next: u64,
    /// Number of the database's log for the next entries.
    epoch: u64,
    /// Number of the first entry of this epoch.
    epoch_begins: u64,
}

/// Takes the mirror at `location`, a folder or a URL as of a checkpoint store, for the data directory. With `from_mirror`, a data
/// directory without a database gets the mirror's. After this, no other process can write to the mirror.
///
/// # Errors
/// See [`MirrorError`]. Nothing is written to a mirror that belongs to another data directory, unless `from_mirror` is true.
pub async fn claim(data: &DataDirectory, location: &str, from_mirror: bool) -> Result<Claimed, MirrorError> {
    let entries = Entries {
        objects: open(location)?,
    };
    let place = entries.objects.to_string();
    let writers = read_writers(data.path())?;
    let has_database = find_database(&data.path().join(Store::FILE))?;
    let mut claimed = Claimed {
        writer: format!("{:016x}", getrandom::u64().unwrap_or_default()),
        entries,
        next: 1,
        epoch: 1,
        epoch_begins: 1,
    };
    for _ in 0..CLAIMS {
        let all = claimed.entries.list().await?;
        let Some(&newest) = all.keys().next_back() else {
            if from_mirror && !has_database {
                tracing::warn!(
                    place,
                    "the mirror is empty: the coordinator begins without campaigns"
                );
            }
            if claimed.place_claim(data.path(), String::new(), false).await? {
                return Ok(claimed);
            }
            continue;
        };
        let (last, _) = claimed.entries.read(newest).await?;
        let after = newest.checked_add(1).zip(last.epoch.checked_add(1));
        (claimed.next, claimed.epoch) = after.ok_or_else(|| MirrorError::Damaged {
            object: place.clone(),
            reason: "its numbers are used up".to_owned(),
        })?;
        let is_ours = has_database && writers.wrote(&last);
        match (is_ours, from_mirror, has_database) {
            (true, ..) | (false, true, false) => {}
            (false, true, true) => {
                let data = data.path().to_path_buf();
                return Err(MirrorError::NotEmpty { data, place });
            }
            (false, false, _) => return Err(MirrorError::Foreign(place)),
        }
        if claimed.place_claim(data.path(), last.writer, !is_ours).await? {
            if !is_ours {
                restore::restore(&claimed.entries, newest, data.path()).await?;
                let restored = Writers {
                    writer: claimed.writer.clone(),
                    ..Writers::default()
                };
                restored.write(data.path())?;
            }
            return Ok(claimed);
        }
    }
    Err(MirrorError::Contested(place))
}

impl Claimed {
    /// Writes this process's first entry. False if another process has written an entry with this number.
    async fn place_claim(
        &mut self,
        data: &Path,
        former: String,
        restoring: bool,
    ) -> Result<bool, MirrorError> {
        // A crash may follow at any time: the data directory must know its entries before the mirror has them.
        let known = Writers {
            writer: self.writer.clone(),
            former,
            restoring,
        };
        known.write(data)?;
        let claim = self.entry(What::Claim, &[])?;
        let placed = self.entries.put(self.next, &claim).await?;
        // If this takes the place of the claim, it is one too.
        let trial = self.entry(What::Claim, b"trial")?;
        if placed == Placed::Ours && self.entries.put(self.next, &trial).await? == Placed::Ours {
            return Err(MirrorError::NoFence(self.entries.objects.to_string()));
        }
        self.epoch_begins = self.next;
        self.next += 1;
        Ok(placed == Placed::Ours)
    }

    fn entry(&self, what: What, payload: &[u8]) -> Result<Bytes, MirrorError> {
        Entry::encode(&self.writer, self.epoch, what, payload)
    }

    /// Notes that the next entries belong to `epoch`, whose first entry has the number `begins`, unless they belong to a later one.
    const fn enter_epoch(&mut self, epoch: u64, begins: u64) {
        if self.epoch < epoch {
            self.epoch = epoch;
            self.epoch_begins = begins;
        }
    }

    /// The place of the checkpoints in the mirror.
    #[must_use]
    pub fn checkpoints(&self) -> CheckpointsOfMirror {
        CheckpointsOfMirror(self.entries.objects.within("checkpoints"))
    }
}

fn open(location: &str) -> Result<Objects, MirrorError> {
    let objects = match location.contains("://") {
        true => Objects::open(location)?,
        false => Objects::in_folder(path::absolute(location)?)?,
    };
    Ok(objects)
}

fn read_writers(data: &Path) -> Result<Writers, MirrorError> {
    let path = data.join(FILE);
    let bytes = match read_short(&path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Writers::default()),
        read => read.map_err(|error| StoreError::from_io(error, "read", &path))?,
    };
    serde_json::from_slice(&bytes).map_err(|error| {
        let error = io::Error::other(format!("{error}: remove it, and name a new mirror"));
        StoreError::from_io(error, "understand", &path).into()
    })
}

#[cfg(test)]
mod tests;
