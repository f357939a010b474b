//! The thread that sends the database's log to the mirror, and snapshots of the database's file.

use super::{
    Claimed, Mirror, MirrorError,
    entries::{Placed, Snapshot, What, snapshot_name},
    progress::{End, Reading},
};
use crate::{
    Store, StoreError, blocking,
    open::{changes, settle},
};
use bytes::Bytes;
use rusqlite::Connection;
use std::{
    io,
    sync::{Arc, PoisonError, Weak},
    thread,
    time::{Duration, Instant},
};
use tokio::{runtime::Builder, task::JoinHandle};

/// Threads that read files and write to a mirror in a folder, at most.
const THREADS: usize = 8;
/// Time between two looks for the entry of a successor while nothing is to be sent.
const PAUSE_TO_LOOK: Duration = Duration::from_millis(if cfg!(test) { 50 } else { 5_000 });
/// Pause before an attempt is repeated.
const PAUSE_TO_REPEAT: Duration = Duration::from_millis(if cfg!(test) { 50 } else { 2_000 });

/// Sends what a mirror lacks.
struct Sender {
    claimed: Claimed,
    uploading: Option<Uploading>,
    uploaded: Option<Uploaded>,
}

/// A snapshot that is being uploaded.
struct Uploading {
    reading: Reading,
    task: JoinHandle<Result<Uploaded, MirrorError>>,
}

/// A snapshot that is complete, but for its entry.
struct Uploaded {
    snapshot: Snapshot,
    reading: Reading,
    /// The part of the log that must be in the mirror before the snapshot's entry.
    needs: End,
    /// Number of the first entry of the snapshot's epoch.
    begins: u64,
}

/// Sends the whole database of `store` to the mirror, and from now on every change that is noted in the returned value.
pub(crate) async fn start(claimed: Claimed, store: &Store) -> Result<Arc<Mirror>, MirrorError> {
    let (path, connection) = (store.path.clone(), store.connection.clone());
    let place = claimed.entries.objects.to_string();
    let mirror = Arc::new(Mirror::new(place.clone(), claimed.epoch, &path)?);
    let counting = mirror.clone();
    let prepare = move || -> Result<(), StoreError> {
        let mut connection = connection.lock().unwrap_or_else(PoisonError::into_inner);
        // The file is whole, and the log empty, when the first snapshot begins.
        settle(&connection, &path)?;
        counting.begin_changes(changes(&connection)?);
        count_frames(&mut connection, counting.clone())?;
        counting.open_log();
        Ok(())
    };
    blocking::changing(prepare).await.map_err(StoreError::from)??;
    let mut sender = Sender {
        claimed,
        uploading: None,
        uploaded: None,
    };
    loop {
        if sender.send(&mirror).await? == Placed::Another {
            return Err(StoreError::MirrorTaken(place).into());
        }
        if !mirror.next().wants_snapshot {
            break;
        }
        mirror.wanted().await;
    }
    sender.begin(Arc::downgrade(&mirror)).map_err(MirrorError::File)?;
    Ok(mirror)
}

/// From now on, SQLite says after each commit how many frames the log has. SQLite no longer writes the log into the database by
/// itself then: the log must not begin anew before the mirror has it.
fn count_frames(connection: &mut Connection, mirror: Arc<Mirror>) -> rusqlite::Result<()> {
    connection.wal_hook(Some(move |_: &mut rusqlite::hooks::Wal, frames: i32| {
        mirror.count(u64::from(frames.unsigned_abs()));
        Ok(())
    }))
}

/// Tells changes that wait for the mirror when the thread that sends them has ended.
struct Ended(Weak<Mirror>);

impl Drop for Ended {
    fn drop(&mut self) {
        if let Some(mirror) = self.0.upgrade() {
            mirror.end();
        }
    }
}

impl Sender {
    /// Begins a thread that sends changes. Its work has threads of its own: all threads of the process can be waiting for the mirror.
    fn begin(self, mirror: Weak<Mirror>) -> io::Result<()> {
        let run = move || {
            let ended = Ended(mirror.clone());
            let runtime = Builder::new_current_thread()
                .max_blocking_threads(THREADS)
                .thread_name("mirror")
                .enable_all()
                .build();
            match runtime {
                Ok(runtime) => runtime.block_on(self.run(mirror)),
                Err(error) => tracing::error!(%error, "the thread of the mirror could not be started"),
            }
            drop(ended);
        };
        thread::Builder::new()
            .name("mirror".to_owned())
            .spawn(run)
            .map(drop)
    }

    /// Sends changes until the store is dropped or another process has gone on from the mirror.
    async fn run(mut self, mirror: Weak<Mirror>) {
        let mut looked = Instant::now();
        while let Some(mirror) = mirror.upgrade() {
            match self.send(&mirror).await {
                Ok(Placed::Ours) if looked.elapsed() < PAUSE_TO_LOOK => mirror.wanted().await,
                Ok(Placed::Ours) => {
                    // Without this look, a process that changes nothing would serve what it has, and keep its workers, without end.
                    // Nothing waits for the mirror, so an error can wait too.
                    let entries = &self.claimed.entries;
                    if let Ok(true) = entries.exists(self.claimed.next).await {
                        return mirror.lose();
                    }
                    looked = Instant::now();
                }
                Ok(Placed::Another) => return mirror.lose(),
                Err(error) => {
                    mirror.fail(&error);
                    tokio::time::sleep(PAUSE_TO_REPEAT).await;
                }
            }
        }
    }

    /// Sends all that the mirror lacks.
    async fn send(&mut self, mirror: &Arc<Mirror>) -> Result<Placed, MirrorError> {
        loop {
            let next = mirror.next();
            let is_ready =
                |uploaded: &mut Uploaded| !mirror.accepts(uploaded.reading) || next.has(uploaded.needs);
            if let Some(uploaded) = self.uploaded.take_if(is_ready)
                && mirror.accepts(uploaded.reading)
                && self.place(mirror, uploaded).await? == Placed::Another
            {
                return Ok(Placed::Another);
            }
            let next = mirror.next();
            if let Some(void) = self.uploading.take_if(|upload| !mirror.accepts(upload.reading)) {
                void.task.abort();
            }
            let is_idle = self.uploading.is_none() && self.uploaded.is_none();
            if next.wants_snapshot && is_idle && mirror.accepts(mirror.reading()) {
                self.uploading = Some(self.upload(mirror)?);
            }
            let is_awaited = |upload: &mut Uploading| next.is_torn || upload.task.is_finished();
            if let Some(upload) = self.uploading.take_if(is_awaited) {
                match upload.task.await.map_err(io::Error::other)? {
                    Ok(uploaded) => self.uploaded = Some(uploaded),
                    Err(error) if next.is_torn || !mirror.is_begun() => return Err(error),
                    // Entries are of use without this snapshot.
                    Err(error) => {
                        tracing::warn!(%error, "a snapshot could not be written to the mirror");
                        mirror.postpone_snapshot();
                    }
                }
                continue;
            }
            let looking = mirror.clone();
            let piece = tokio::task::spawn_blocking(move || looking.piece()).await;
            match piece.map_err(io::Error::other)?? {
                Some(piece) => {
                    self.claimed.enter_epoch(piece.epoch(), self.claimed.next);
                    self.claimed.changes = Some(mirror.changes());
                    let entry = self
                        .claimed
                        .entry(What::Frames { from: piece.from }, &piece.bytes)?;
                    if self.put(mirror, &entry).await == Placed::Another {
                        return Ok(Placed::Another);
                    }
                    mirror.has_piece(&piece);
                }
                // The log that was to be sent may be gone.
                None if mirror.next().is_torn => {}
                None => return Ok(Placed::Ours),
            }
        }
    }

    /// Begins to upload the database's file. The store writes the log into it meanwhile only if the disk has failed.
    fn upload(&self, mirror: &Arc<Mirror>) -> Result<Uploading, MirrorError> {
        let reading = mirror.reading();
        let begins = match self.claimed.epoch == reading.epoch {
            true => self.claimed.epoch_begins,
            false => self.claimed.next,
        };
        // A name that is new for each attempt: others may read the objects of former ones.
        let attempt = getrandom::u32().map_err(io::Error::other)?;
        let object = snapshot_name(begins, &format!("{}-{attempt:08x}", self.claimed.writer));
        let (entries, mirror) = (self.claimed.entries.clone(), mirror.clone());
        let task = tokio::spawn(async move {
            let put = entries.put_snapshot(object, reading.epoch, mirror.database.clone());
            let snapshot = put.await;
            mirror.want();
            Ok(Uploaded {
                snapshot: snapshot?,
                reading,
                needs: mirror.needs(reading),
                begins,
            })
        });
        Ok(Uploading { reading, task })
    }

    /// Writes the entry of a snapshot.
    async fn place(&mut self, mirror: &Mirror, uploaded: Uploaded) -> Result<Placed, MirrorError> {
        let Uploaded {
            snapshot,
            reading,
            begins,
            ..
        } = uploaded;
        self.claimed.enter_epoch(snapshot.epoch, begins);
        self.claimed.changes = Some(mirror.changes());
        let object = snapshot.object.clone();
        let entry = self.claimed.entry(What::Snapshot(snapshot.clone()), &[])?;
        let placed = self.put(mirror, &entry).await;
        if placed == Placed::Ours {
            match self.find(mirror, &snapshot).await {
                Ok(()) => {}
                Err(gone) if mirror.next().is_torn || !mirror.is_begun() => return Err(gone),
                // Entries are of use without this snapshot, and an entry alone does no harm.
                Err(gone) => {
                    tracing::warn!(error = %gone, "a snapshot went elsewhere");
                    mirror.postpone_snapshot();
                    return Ok(placed);
                }
            }
            mirror.has_snapshot(reading);
            let entries = self.claimed.entries.clone();
            tokio::spawn(async move { entries.remove_before(begins, &object).await });
        }
        Ok(placed)
    }

    /// Checks that a snapshot is where its entry is, and repeats this until it is known: the file system of the mirror may have been
    /// mounted only after the snapshot was written.
    async fn find(&self, mirror: &Mirror, snapshot: &Snapshot) -> Result<(), MirrorError> {
        loop {
            match self.claimed.entries.expect_snapshot(snapshot).await {
                Err(error) if !matches!(error, MirrorError::Gone(_)) => {
                    mirror.fail(&error);
                    tokio::time::sleep(PAUSE_TO_REPEAT).await;
                }
                found => return found,
            }
        }
    }

    /// Writes the next entry, and repeats this until it is known whose entry has its number.
    async fn put(&mut self, mirror: &Mirror, entry: &Bytes) -> Placed {
        loop {
            match self.try_to_put(entry).await {
                Ok(placed) => {
                    self.claimed.next += 1;
                    return placed;
                }
                Err(error) => {
                    mirror.fail(&error);
                    tokio::time::sleep(PAUSE_TO_REPEAT).await;
                }
            }
        }
    }

    async fn try_to_put(&self, entry: &Bytes) -> Result<Placed, MirrorError> {
        let Claimed {
            entries, claim, next, ..
        } = &self.claimed;
        // Where an entry goes, the claim must be: before, so that nothing is written into another mirror or into the empty folder under
        // a file system that is not mounted; and after, because a file system can be mounted between two of these steps.
        let is_folder = entries.objects.folder().is_some();
        if is_folder {
            entries.expect(claim.0, &claim.1).await?;
        }
        let placed = entries.put(*next, entry).await?;
        if placed == Placed::Ours {
            entries.expect(claim.0, &claim.1).await?;
            if is_folder {
                entries.expect(*next, entry).await?;
            }
        }
        Ok(placed)
    }
}
