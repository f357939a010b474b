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
mod writers;

use crate::{
    DataDirectory, Store, StoreError, blocking,
    checkpoints::CheckpointsOfMirror,
    find_database,
    objects::{NoPlace, Objects},
};
use bytes::Bytes;
use entries::{Entries, Entry, Listed, Placed, What};
use murmuration_swarm::counted;
pub(crate) use progress::{End, Mirror};
use restore::{Restore, has_data};
pub(crate) use sending::start;
use std::{
    collections::BTreeMap,
    io,
    os::unix::fs::MetadataExt as _,
    path::{self, Path, PathBuf},
    time::{Duration, Instant},
};
use writers::{Known, RememberedClaim, Writers};
pub(crate) use writers::{expect_none, note_snapshot};

/// Payload of the claim of a process whose data directory has a database. Other claims have none.
const CLAIM_WITH_DATA: &[u8] = b"data";
/// Time for attempts to write the first entry, while a former coordinator still writes. Labels of a group of people leave gaps
/// between entries, but not soon.
const CLAIM_LIMIT: Duration = Duration::from_secs(if cfg!(test) { 10 } else { 60 });
/// Attempts to make the database while objects of the mirror vanish: the former process removes what it no longer needs. Objects
/// that are still missing then are lost.
const RESTORES: usize = 20;
/// Longest pause after such an attempt. The pause is random, so that two processes that claim do not keep step.
const LONGEST_CLAIM_PAUSE_MS: u64 = 300;

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
    #[error(
        "the mirror has lost its entries: {0} is gone; mount its folder again, or bring it back. To write everything anew, end this \
         process, remove mirror.json from the data directory, and name an empty place with --mirror"
    )]
    Gone(String),
    #[error(
        "{object} in the mirror is damaged: {reason}. Bring it back from a copy of the mirror, or go on from a data directory or a backup \
         with another --mirror"
    )]
    Damaged { object: String, reason: String },
    #[error(
        "the mirror {0} has the campaigns of another data directory, or another coordinator has gone on from it: \
         --from-mirror goes on with them in a new --data; another --mirror leaves them"
    )]
    Foreign(String),
    #[error(
        "data directory {data} has a database, from which the mirror {place} does not go on: to go on from the mirror, name a new \
         --data; what {data} acknowledged while it had this mirror is in the mirror, unless the mirror is damaged"
    )]
    NotEmpty { data: PathBuf, place: String },
    #[error(
        "the database in data directory {data} is an older copy: it lacks {} of the mirror {place}, and would overwrite {}. \
         To go on from the mirror, name a new --data with --from-mirror; to go on from the older copy, name an empty place with --mirror",
        counted(u64::from(*.missing), "change"),
        if *.missing == 1 { "it" } else { "them" }
    )]
    SetBack {
        data: PathBuf,
        place: String,
        /// Number of the mirror's changes that the database lacks.
        missing: u32,
    },
    #[error(
        "the mirror {0} replaces objects although it is asked not to (If-None-Match), so two coordinators could write to it: use another \
         object store"
    )]
    NoFence(String),
    #[error("others write to the mirror {0} all the time: end them first")]
    Contested(String),
    #[error(
        "the mirror {place} cannot keep the database, {bytes} bytes, once more: {source}. The coordinator that has the mirror keeps it: \
         otherwise it would end in vain"
    )]
    NoRoom {
        place: String,
        bytes: u64,
        source: Box<MirrorError>,
    },
    #[error("the mirror's copy of the database cannot be written: {0}")]
    File(#[from] io::Error),
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl MirrorError {
    /// Whether the mirror cannot be this data directory's: it refuses the directory, or has none of its entries.
    const fn is_refusal(&self) -> bool {
        matches!(
            self,
            Self::Foreign(_)
                | Self::NotEmpty { .. }
                | Self::SetBack { .. }
                | Self::NoFence(_)
                | Self::Contested(_)
                | Self::NoRoom { .. }
                | Self::Gone(_)
                | Self::Damaged { .. }
        )
    }

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

/// A mirror in which this process has written the newest entry.
#[derive(Debug)]
pub struct Claimed {
    entries: Entries,
    writer: String,
    /// This process's first entry, and its number. It is never removed.
    claim: (u64, Bytes),
    /// Number of the next entry.
    next: u64,
    /// Number of the database's log for the next entries.
    epoch: u64,
    /// Number of the first entry of this epoch.
    epoch_begins: u64,
    /// The database's count of changes for the next entries; `None` if there is no database yet.
    changes: Option<u32>,
    /// Whether the mirror has an entry of this process as its newest.
    is_placed: bool,
}

/// Takes the mirror at `location`, a folder or a URL as of a checkpoint store, for the data directory. With `from_mirror`, a data
/// directory without a database gets the mirror's. After this, no other process can write to the mirror.
///
/// # Errors
/// See [`MirrorError`]. Nothing is written to a mirror that belongs to another data directory, unless `from_mirror` is true and the
/// mirror's database could be made.
pub async fn claim(data: &DataDirectory, location: &str, from_mirror: bool) -> Result<Claimed, MirrorError> {
    claim_within(data, location, from_mirror, CLAIM_LIMIT).await
}

/// Like [`claim`], with attempts for the time `limit`.
async fn claim_within(
    data: &DataDirectory,
    location: &str,
    from_mirror: bool,
    limit: Duration,
) -> Result<Claimed, MirrorError> {
    let entries = Entries {
        objects: open(location, data.path())?,
    };
    let writers = Writers::read(data.path())?;
    let mut claimed = Claimed {
        writer: format!("{:016x}", getrandom::u64().unwrap_or_default()),
        entries,
        claim: (0, Bytes::new()),
        next: 1,
        epoch: 1,
        epoch_begins: 1,
        changes: None,
        is_placed: false,
    };
    let claiming = Claiming {
        place: claimed.entries.objects.canonical_place()?,
        inode: inode_of(&data.path().join(Store::FILE))?,
        data: data.path(),
        from_mirror,
        writers: &writers,
        limit,
    };
    if claiming.inode.is_some() {
        // A database that cannot be opened must not end the coordinator that has the mirror.
        let database = data.path().join(Store::FILE);
        let looked = blocking::changing(move || crate::open::expect_sound(&database)).await;
        claimed.changes = Some(looked.map_err(StoreError::from)??);
    }
    match claimed.place_first(&claiming).await {
        Ok(()) => Ok(claimed),
        // The attempt has left nothing in this mirror, and the directory's own mirror may be another one.
        Err(error) if error.is_refusal() && !claimed.is_placed => {
            writers.write_back(data.path())?;
            Err(error)
        }
        Err(error) => Err(error),
    }
}

/// How a process claims a mirror.
struct Claiming<'a> {
    place: String,
    data: &'a Path,
    /// Inode of the directory's database, if there is one.
    inode: Option<u64>,
    from_mirror: bool,
    writers: &'a Writers,
    /// Time for attempts.
    limit: Duration,
}

/// The inode of the database at `path`; `None` if there is none.
fn inode_of(path: &Path) -> Result<Option<u64>, MirrorError> {
    match find_database(path)? {
        true => Ok(Some(path.metadata()?.ino())),
        false => Ok(None),
    }
}

impl Claimed {
    /// Places the first entry, after the entries of the former process.
    async fn place_first(&mut self, claiming: &Claiming<'_>) -> Result<(), MirrorError> {
        let Claiming {
            place, data, writers, ..
        } = claiming;
        let has_database = claiming.inode.is_some();
        let mut restore: Option<Restore> = None;
        // Errors of the attempts since the mirror's database could last be made.
        let mut vanished = Vec::new();
        let last = Instant::now() + claiming.limit;
        while Instant::now() < last {
            let all = self.entries.list().await?;
            let (mut former, mut restores) = (String::new(), false);
            let mut had_data = writers.had_data_in(place);
            match all.keys().next_back() {
                Some(&newest) => {
                    let (last, _) = self.entries.read(newest).await?;
                    self.follow(newest, last.epoch)?;
                    match has_database && writers.know(&last, claiming.inode) {
                        true => {
                            self.expect_claims(writers, &last.writer).await?;
                            self.expect_changes(&last, claiming)?;
                            former = last.writer;
                            had_data |= has_data(&self.entries, &all).await?;
                        }
                        false => restores = has_data(&self.entries, &all).await?,
                    }
                    // Only a claim of an earlier attempt is there.
                    if had_data && !restores && former.is_empty() {
                        return Err(MirrorError::Gone(place.clone()));
                    }
                }
                None if had_data => return Err(MirrorError::Gone(place.clone())),
                None if claiming.from_mirror && self.entries.has_snapshots().await? => {
                    return Err(MirrorError::Damaged {
                        object: place.clone(),
                        reason: "it has snapshots, and its entries are missing".to_owned(),
                    });
                }
                None => {}
            }
            match (restores, claiming.from_mirror, has_database) {
                (true, true, true) => {
                    let (data, place) = (data.to_path_buf(), place.clone());
                    return Err(MirrorError::NotEmpty { data, place });
                }
                (true, false, _) => return Err(MirrorError::Foreign(place.clone())),
                // The database is made before the mirror is taken: the former process must not end in vain.
                (true, true, false) => match self.restored(restore.take(), &all, data).await {
                    Ok(restored) => restore = Some(restored),
                    Err(error) if error.is_not_found() => {
                        vanished.push(error);
                        match vanished.len() {
                            RESTORES => break,
                            _ => continue,
                        }
                    }
                    Err(error) => return Err(error),
                },
                (false, true, false) => {
                    tracing::warn!(
                        place,
                        "the mirror is empty: the coordinator begins without campaigns"
                    );
                }
                (false, ..) => {}
            }
            vanished.clear();
            let known = Known {
                mirror: place.clone(),
                claims: writers.claims_of(&former),
                writer: self.writer.clone(),
                former,
                restoring: restores,
                database: None,
                // An attempt that fails must not forget this.
                has_snapshot: restores || had_data,
            };
            let mut now = writers.with(known, has_database);
            let payload = match has_database {
                true => CLAIM_WITH_DATA,
                false => &[],
            };
            if self.place_claim(data, &mut now, payload).await? {
                return match restore.filter(|_| restores) {
                    Some(restore) => self.put_in_place(restore, now, data).await,
                    None => Ok(()),
                };
            }
            let pause = getrandom::u64().unwrap_or_default() % LONGEST_CLAIM_PAUSE_MS;
            tokio::time::sleep(Duration::from_millis(pause)).await;
        }
        Err(match vanished.pop() {
            Some(error) => MirrorError::Damaged {
                object: place.clone(),
                reason: error.to_string(),
            },
            None => MirrorError::Contested(place.clone()),
        })
    }

    /// Checks that the mirror has the claims of the process of this directory that wrote its newest entry. An entry alone can have gone
    /// into the empty folder under a file system that was not mounted.
    async fn expect_claims(&self, writers: &Writers, writer: &str) -> Result<(), MirrorError> {
        for claim in writers.claims_before(writer) {
            self.entries.expect_digest(claim.number, &claim.digests).await?;
        }
        Ok(())
    }

    /// Checks that the database has all changes of the mirror, whose newest entry is `last`. Each change is on disk before the mirror
    /// has it, so a database that lacks one is an older copy.
    fn expect_changes(&self, last: &Entry, claiming: &Claiming<'_>) -> Result<(), MirrorError> {
        let (Some(own), Some(mirrored)) = (self.changes, last.changes) else {
            return Ok(());
        };
        // The counts are modulo 2^32.
        let missing = mirrored.wrapping_sub(own).cast_signed();
        match missing > 0 {
            true => Err(MirrorError::SetBack {
                data: claiming.data.to_path_buf(),
                place: claiming.place.clone(),
                missing: missing.unsigned_abs(),
            }),
            false => Ok(()),
        }
    }

    /// The first entry comes after entry `newest`, of the epoch `epoch`.
    fn follow(&mut self, newest: u64, epoch: u64) -> Result<(), MirrorError> {
        let after = newest.checked_add(1).zip(epoch.checked_add(1));
        (self.next, self.epoch) = after.ok_or_else(|| MirrorError::Damaged {
            object: self.entries.objects.to_string(),
            reason: "its numbers are used up".to_owned(),
        })?;
        Ok(())
    }

    /// The database of the mirror with the entries `all`: `restore`, if the new entries follow.
    async fn restored(
        &self,
        restore: Option<Restore>,
        all: &BTreeMap<u64, Listed>,
        data: &Path,
    ) -> Result<Restore, MirrorError> {
        if let Some(mut restore) = restore
            && restore.extend(&self.entries, self.next - 1).await?
        {
            return Ok(restore);
        }
        let restore = Restore::begin(&self.entries, all, data).await?;
        match restore.check().await {
            Err(MirrorError::Store(StoreError::Damaged { reason, .. })) => {
                let path = restore.keep(data)?;
                return Err(StoreError::Damaged { path, reason }.into());
            }
            checked => checked?,
        }
        self.expect_room(&restore).await?;
        Ok(restore)
    }

    /// Checks that the mirror can keep the first snapshot of this process. Only a mirror in a folder has a disk that can be full.
    async fn expect_room(&self, restore: &Restore) -> Result<(), MirrorError> {
        if self.entries.objects.folder().is_none() {
            return Ok(());
        }
        let bytes = restore.bytes().await?;
        let tried = self.entries.try_room(bytes, &self.writer).await;
        tried.map_err(|source| MirrorError::NoRoom {
            place: self.entries.objects.to_string(),
            bytes,
            source: Box::new(source),
        })
    }

    async fn put_in_place(
        &self,
        restore: Restore,
        mut writers: Writers,
        data: &Path,
    ) -> Result<(), MirrorError> {
        let note = |inode| {
            writers.here.database = Some(inode);
            writers.write(data)
        };
        restore.finish(data, note).await?;
        writers.here.restoring = false;
        writers.here.database = None;
        writers.write(data)
    }

    /// Writes this process's first entry. False if another process has written an entry with this number, or later ones: what is old
    /// has been removed, so a number can be free although the mirror has gone on from it.
    async fn place_claim(
        &mut self,
        data: &Path,
        writers: &mut Writers,
        payload: &[u8],
    ) -> Result<bool, MirrorError> {
        let claim = self.entry(What::Claim, payload)?;
        let trial = self.entry(What::Claim, b"trial")?;
        let claims = &mut writers.here.claims;
        claims.push(RememberedClaim::new(&self.writer, self.next, [&claim, &trial]));
        // A crash may follow at any time: the data directory must know its entries before the mirror has them.
        writers.write(data)?;
        if self.entries.put(self.next, &claim).await? == Placed::Another {
            return Ok(false);
        }
        let newest = self.entries.list_from(self.next.saturating_sub(1)).await?;
        if newest
            .keys()
            .next_back()
            .is_some_and(|&newest| newest > self.next)
        {
            return Ok(false);
        }
        self.is_placed = true;
        if self.next > 1 && !newest.contains_key(&(self.next - 1)) {
            return Err(MirrorError::Gone(self.entries.name(self.next - 1)));
        }
        // If this takes the place of the claim, it is one too.
        if self.entries.put(self.next, &trial).await? == Placed::Ours {
            return Err(MirrorError::NoFence(self.entries.objects.to_string()));
        }
        self.claim = (self.next, claim);
        self.epoch_begins = self.next;
        self.next += 1;
        Ok(true)
    }

    fn entry(&self, what: What, payload: &[u8]) -> Result<Bytes, MirrorError> {
        Entry::encode(&self.writer, self.epoch, self.changes, what, payload)
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

/// The mirror at `location` of the data directory `data`.
fn open(location: &str, data: &Path) -> Result<Objects, MirrorError> {
    let objects = match location {
        "" => {
            return Err(MirrorError::Location {
                location: location.to_owned(),
                reason: "its name is empty".to_owned(),
            });
        }
        url if url.contains("://") => Objects::open(url)?,
        folder => Objects::in_folder(path::absolute(folder)?)?,
    };
    let folder = objects.folder().map(Path::canonicalize).transpose()?;
    match folder.is_some_and(|folder| data.canonicalize().is_ok_and(|data| folder.starts_with(data))) {
        true => Err(MirrorError::Location {
            location: objects.to_string(),
            reason: "it is within the data directory, which it must outlive".to_owned(),
        }),
        false => Ok(objects),
    }
}

#[cfg(test)]
mod tests;
