//! Sends the database's log to the mirror, and wakes the changes that wait for it.
//!
//! SQLite writes a log again from its beginning, with new salts, once all of it is in the database's file. So the store lets the log
//! be written there only when the mirror has all of it, and no snapshot of the file is being read. After the disk has failed, the
//! store must empty the log at once: the mirror is then torn, and gets a new snapshot before anything else.

use super::{
    Claimed, MirrorError, What,
    entries::{MAX_PAYLOAD, Placed},
};
use crate::StoreError;
use bytes::Bytes;
use std::{
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};
use tokio::{
    sync::{Notify, watch},
    task::JoinHandle,
};

/// Longest time between a change of a run and its entry.
const PAUSE: Duration = Duration::from_millis(800);
/// Pause before an attempt is repeated.
const PAUSE_TO_REPEAT: Duration = Duration::from_millis(if cfg!(test) { 50 } else { 2_000 });
/// Longest wait for the mirror when the coordinator ends.
const FINISH_LIMIT: Duration = Duration::from_secs(2);
/// A new snapshot is made once the entries since the last one have more bytes than the database, and more than this.
const SNAPSHOT_BYTES: u64 = if cfg!(test) { 1 << 20 } else { 64 << 20 };

/// Sizes in SQLite's file format: the header of a log, and the header of a frame before its page.
const LOG_HEADER: u64 = 32;
const FRAME_HEADER: u64 = 24;

/// A place in the log of the database, over all epochs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct End {
    epoch: u64,
    /// Bytes of the log up to here.
    bytes: u64,
}

/// What is committed and what the mirror has.
#[derive(Debug)]
pub(super) struct Sending {
    state: Mutex<State>,
    /// Notified when the mirror has more, and when it fails.
    changed: Condvar,
    /// Notified when a change waits for the mirror.
    wanted: Notify,
    /// Whether another process has gone on from the mirror.
    lost: watch::Sender<bool>,
    /// The mirror, for messages.
    place: String,
    log_path: PathBuf,
    /// The log, once it is open. SQLite keeps one file for as long as it has the database open.
    log: OnceLock<File>,
    /// The database's file. If this process closed another handle of it, SQLite would lose its locks (POSIX), so this one stays open.
    database: Arc<File>,
}

#[derive(Debug)]
struct State {
    /// Frames of the log, as SQLite counted them at the last commit.
    frames: u64,
    /// Whether SQLite has counted since the last commit was noted. A change that changes nothing commits nothing.
    is_counted: bool,
    /// The salts that all frames of the current log have; `None` before the first commit.
    salts: Option<[u8; 8]>,
    page_bytes: u64,
    committed: End,
    mirrored: End,
    /// Whether the mirror needs a snapshot before further entries are of use: a log began anew before the mirror had the last one.
    is_torn: bool,
    /// How often the log was emptied, or found emptied, before the mirror had all of it. A snapshot is void if this changes while the
    /// database's file is read.
    tears: u64,
    /// Whether the log is being emptied now.
    is_emptying: bool,
    /// Whether a commit could not be noted, because the log could not be read.
    is_unnoted: bool,
    /// Whether a new snapshot is due, or is being written.
    snapshot: Due,
    /// Bytes of frames since the last snapshot.
    bytes_since_snapshot: u64,
    condition: Condition,
    is_finishing: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Due {
    No,
    Yes,
    Writing,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Condition {
    Works,
    Fails(String),
    Lost,
}

/// A part of the log for one entry.
struct Piece {
    end: End,
    from: u64,
    bytes: Vec<u8>,
}

impl Sending {
    pub(super) fn new(claimed: &Claimed, database: &Path) -> io::Result<Self> {
        let begin = End {
            epoch: claimed.epoch,
            bytes: 0,
        };
        let state = State {
            frames: 0,
            is_counted: false,
            salts: None,
            page_bytes: 0,
            committed: begin,
            mirrored: begin,
            is_torn: false,
            tears: 0,
            is_emptying: false,
            is_unnoted: false,
            snapshot: Due::No,
            bytes_since_snapshot: 0,
            condition: Condition::Works,
            is_finishing: false,
        };
        let mut log = database.as_os_str().to_owned();
        log.push("-wal");
        Ok(Self {
            state: Mutex::new(state),
            changed: Condvar::new(),
            wanted: Notify::new(),
            lost: watch::Sender::new(false),
            place: claimed.entries.objects.to_string(),
            log_path: log.into(),
            log: OnceLock::new(),
            database: Arc::new(File::open(database)?),
        })
    }

    fn log(&self) -> io::Result<&File> {
        match self.log.get() {
            Some(log) => Ok(log),
            None => {
                let log = File::open(&self.log_path)?;
                Ok(self.log.get_or_init(|| log))
            }
        }
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn count(&self, frames: u64) {
        let mut state = self.lock();
        (state.frames, state.is_counted) = (frames, true);
    }

    pub(super) fn check(&self, is_of_run: bool) -> Result<(), StoreError> {
        match &self.lock().condition {
            Condition::Lost => Err(StoreError::MirrorTaken(self.place.clone())),
            Condition::Fails(reason) if !is_of_run => Err(StoreError::NoMirror {
                place: self.place.clone(),
                reason: reason.clone(),
            }),
            Condition::Fails(_) | Condition::Works => Ok(()),
        }
    }

    pub(super) fn committed(&self) -> Result<End, StoreError> {
        if !std::mem::take(&mut self.lock().is_counted) {
            return Ok(self.lock().committed);
        }
        let header = self.log().and_then(read_header);
        let mut state = self.lock();
        match header {
            Ok((page_bytes, salts)) => {
                state.note(page_bytes, salts);
                Ok(state.committed)
            }
            Err(error) => {
                state.is_unnoted = true;
                Err(StoreError::Unmirrored {
                    place: self.place.clone(),
                    reason: format!("the database's log cannot be read: {error}"),
                })
            }
        }
    }

    /// Waits until the mirror has all up to `end`; with a limit, no longer than that.
    pub(super) fn wait(&self, end: End, limit: Option<Duration>) -> Result<(), StoreError> {
        let last = limit.map(|limit| Instant::now() + limit);
        let mut state = self.lock();
        loop {
            let (place, left) = (
                self.place.clone(),
                last.map(|last| last.saturating_duration_since(Instant::now())),
            );
            match &state.condition {
                Condition::Lost => return Err(StoreError::MirrorTaken(place)),
                _ if state.has(end) => return Ok(()),
                _ if state.is_finishing || left.is_some_and(|left| left.is_zero()) => {
                    let reason = match &state.condition {
                        Condition::Fails(reason) => reason.clone(),
                        _ => "it has not answered yet".to_owned(),
                    };
                    return Err(StoreError::Unmirrored { place, reason });
                }
                _ => {}
            }
            self.wanted.notify_one();
            let waited = self.changed.wait_timeout(state, left.unwrap_or(PAUSE).min(PAUSE));
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Notes that the store begins to empty the log, whether or not the mirror has it.
    pub(super) fn emptying(&self) {
        let mut state = self.lock();
        state.is_emptying = true;
        state.tears += 1;
    }

    /// Notes that the log is empty or, if not `done`, that it is only partly in the database's file.
    pub(super) fn emptied(&self, done: bool) {
        let mut state = self.lock();
        state.is_emptying = false;
        state.tears += 1;
        if done && (state.mirrored < state.committed || state.is_unnoted) {
            state.tear();
        }
    }

    pub(super) fn catches_up(&self, limit: Duration) -> bool {
        let end = {
            let state = self.lock();
            if state.is_torn
                || state.is_unnoted
                || state.snapshot != Due::No
                || state.condition != Condition::Works
            {
                return false;
            }
            state.committed
        };
        self.wait(end, Some(limit)).is_ok() && self.lock().snapshot == Due::No
    }

    pub(super) fn log_written(&self) {
        let size = self.database.metadata().map_or(0, |file| file.len());
        let mut state = self.lock();
        if state.bytes_since_snapshot > SNAPSHOT_BYTES.max(size) {
            state.snapshot = Due::Yes;
            self.wanted.notify_one();
        }
    }

    pub(super) async fn taken_over(self: Arc<Self>) -> StoreError {
        // This value holds the sender, so it is not dropped meanwhile.
        let _ = self.lost.subscribe().wait_for(|&lost| lost).await;
        StoreError::MirrorTaken(self.place.clone())
    }

    /// Lets no change wait any longer: the process ends.
    pub(super) fn begin_to_end(&self) {
        self.lock().is_finishing = true;
        self.changed.notify_all();
    }

    pub(super) async fn finish(&self) {
        self.begin_to_end();
        let last = tokio::time::Instant::now() + FINISH_LIMIT;
        loop {
            let is_over = {
                let state = self.lock();
                state.has(state.committed) || state.condition != Condition::Works
            };
            if is_over || tokio::time::Instant::now() > last {
                return;
            }
            self.wanted.notify_one();
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    }

    /// Whether a snapshot is one of the database's file during its epoch.
    fn accepts(&self, snapshot: &Snapshot) -> bool {
        let state = self.lock();
        !state.is_emptying && state.tears == snapshot.tears
    }

    fn succeed(&self) {
        let mut state = self.lock();
        if let Condition::Fails(_) = std::mem::replace(&mut state.condition, Condition::Works) {
            tracing::info!(mirror = self.place, "the mirror works again");
        }
        drop(state);
        self.changed.notify_all();
    }

    fn fail(&self, error: &MirrorError) {
        let mut state = self.lock();
        if state.condition == Condition::Works {
            tracing::warn!(%error, "the mirror does not work: campaigns go on, decisions and labels wait for it");
        }
        state.condition = Condition::Fails(error.to_string());
        drop(state);
        self.changed.notify_all();
    }

    fn lose(&self) {
        self.lock().condition = Condition::Lost;
        self.changed.notify_all();
        self.lost.send_replace(true);
    }

    /// The next part of the log that the mirror lacks, if there is any.
    fn piece(&self) -> io::Result<Option<Piece>> {
        let (mirrored, committed, salts, page_bytes) = {
            let state = self.lock();
            match state.salts {
                Some(salts) if !state.is_torn && state.mirrored != state.committed => {
                    (state.mirrored, state.committed, salts, state.page_bytes)
                }
                _ => return Ok(None),
            }
        };
        // A piece has whole frames, so that the salts of each can be checked.
        let frame = FRAME_HEADER + page_bytes;
        let header = LOG_HEADER.saturating_sub(mirrored.bytes);
        let frames = (committed.bytes - mirrored.bytes - header) / frame;
        let len = header + frames.min((MAX_PAYLOAD - LOG_HEADER) / frame) * frame;
        let mut bytes = vec![0; len as usize];
        match self.log()?.read_exact_at(&mut bytes, mirrored.bytes) {
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => return Err(error),
            Ok(()) if has_salts(&bytes[header as usize..], frame as usize, salts) => {}
            _ => {
                let mut state = self.lock();
                // A commit may have noted the new log meanwhile.
                if state.salts == Some(salts) {
                    state.tear();
                }
                return Ok(None);
            }
        }
        let end = End {
            bytes: mirrored.bytes + len,
            ..mirrored
        };
        let from = mirrored.bytes;
        Ok(Some(Piece { end, from, bytes }))
    }
}

impl State {
    /// Notes a commit. Salts are new in each log.
    fn note(&mut self, page_bytes: u64, salts: [u8; 8]) {
        if self.salts.is_some_and(|known| known != salts) {
            match self.mirrored < self.committed || self.is_unnoted {
                true => self.tear(),
                false => self.begin_epoch(),
            }
        }
        self.is_unnoted = false;
        (self.salts, self.page_bytes) = (Some(salts), page_bytes);
        self.committed.bytes = LOG_HEADER + self.frames * (FRAME_HEADER + page_bytes);
    }

    /// Notes that the log is no more: all of it is in the database's file, and not all of it in the mirror.
    fn tear(&mut self) {
        self.is_torn = true;
        self.tears += 1;
        self.begin_epoch();
        self.salts = None;
        self.is_unnoted = false;
    }

    const fn begin_epoch(&mut self) {
        let begin = End {
            epoch: self.committed.epoch + 1,
            bytes: 0,
        };
        self.committed = begin;
        self.mirrored = begin;
    }

    fn has(&self, end: End) -> bool {
        !self.is_torn && self.mirrored >= end
    }
}

fn has_salts(frames: &[u8], frame_bytes: usize, salts: [u8; 8]) -> bool {
    frames
        .chunks(frame_bytes)
        .all(|frame| frame.get(8..16) == Some(&salts))
}

/// Size of pages, and salts, in the header of a log (SQLite's file format, section 4.1).
fn read_header(log: &File) -> io::Result<(u64, [u8; 8])> {
    let mut header = [0; LOG_HEADER as usize];
    log.read_exact_at(&mut header, 0)?;
    let (mut page_bytes, mut salts) = ([0; 4], [0; 8]);
    page_bytes.copy_from_slice(&header[8..12]);
    salts.copy_from_slice(&header[16..24]);
    Ok((u32::from_be_bytes(page_bytes).into(), salts))
}

/// A snapshot that is complete, but for its entry.
struct Snapshot {
    epoch: u64,
    /// The value of `State::tears` before the file was read.
    tears: u64,
    /// What the mirror must have first, because the file can have it already.
    needs: End,
    /// Number of the first entry of the epoch.
    begins: u64,
    object: String,
    bytes: u64,
    digest: String,
}

/// Writes the first snapshot, then sends changes until the store is dropped or another process has gone on from the mirror.
pub(super) async fn begin(mut claimed: Claimed, sending: Arc<Sending>) -> Result<(), MirrorError> {
    let snapshot = upload(&claimed, &sending)?.await.map_err(io::Error::other)??;
    if !sending.accepts(&snapshot) {
        return Err(io::Error::other("the database's log was emptied meanwhile: try again").into());
    }
    if place_snapshot(&mut claimed, &sending, snapshot).await? == Placed::Another {
        return Err(StoreError::MirrorTaken(sending.place.clone()).into());
    }
    let weak = Arc::downgrade(&sending);
    tokio::spawn(async move {
        let (mut uploading, mut uploaded) = (None, None);
        // A store that is dropped ends the task.
        while let Some(sending) = weak.upgrade() {
            match send(&mut claimed, &sending, &mut uploading, &mut uploaded).await {
                Ok(Placed::Ours) => {
                    let _ = tokio::time::timeout(PAUSE, sending.wanted.notified()).await;
                }
                Ok(Placed::Another) => return sending.lose(),
                Err(error) => {
                    sending.fail(&error);
                    tokio::time::sleep(PAUSE_TO_REPEAT).await;
                }
            }
        }
    });
    Ok(())
}

type Uploading = JoinHandle<Result<Snapshot, MirrorError>>;

/// Sends all that the mirror lacks.
async fn send(
    claimed: &mut Claimed,
    sending: &Arc<Sending>,
    uploading: &mut Option<Uploading>,
    uploaded: &mut Option<Snapshot>,
) -> Result<Placed, MirrorError> {
    loop {
        let (is_torn, due, mirrored) = {
            let state = sending.lock();
            (state.is_torn, state.snapshot, state.mirrored)
        };
        if let Some(snapshot) =
            uploaded.take_if(|snapshot| !sending.accepts(snapshot) || mirrored >= snapshot.needs)
        {
            if sending.accepts(&snapshot) {
                if place_snapshot(claimed, sending, snapshot).await? == Placed::Another {
                    return Ok(Placed::Another);
                }
                continue;
            }
            sending.lock().snapshot = Due::Yes;
        }
        if uploading.is_none() && uploaded.is_none() && (is_torn || due == Due::Yes) {
            *uploading = Some(upload(claimed, sending)?);
        }
        if let Some(upload) = uploading.take_if(|upload| is_torn || upload.is_finished()) {
            let done = upload.await.map_err(io::Error::other).map_err(MirrorError::from);
            match done.flatten() {
                Ok(snapshot) => *uploaded = Some(snapshot),
                Err(error) => {
                    sending.lock().snapshot = Due::Yes;
                    return Err(error);
                }
            }
            continue;
        }
        let looking = sending.clone();
        let piece = tokio::task::spawn_blocking(move || looking.piece()).await;
        let Some(piece) = piece.map_err(io::Error::other)?? else {
            match sending.lock().is_torn {
                true => continue,
                false => return Ok(Placed::Ours),
            }
        };
        if claimed.epoch != piece.end.epoch {
            (claimed.epoch, claimed.epoch_begins) = (piece.end.epoch, claimed.next);
        }
        let entry = claimed.entry(What::Frames { from: piece.from }, &piece.bytes)?;
        if put(claimed, sending, &entry).await == Placed::Another {
            return Ok(Placed::Another);
        }
        let mut state = sending.lock();
        // If the log began anew meanwhile, the mirror has nothing of the new one.
        if state.mirrored.epoch == piece.end.epoch {
            state.mirrored = piece.end;
        }
        state.bytes_since_snapshot += piece.bytes.len() as u64;
        drop(state);
        sending.succeed();
    }
}

/// Begins to upload the database's file. The store writes the log into it meanwhile only if the disk has failed.
fn upload(claimed: &Claimed, sending: &Arc<Sending>) -> Result<Uploading, MirrorError> {
    let mut state = sending.lock();
    state.snapshot = Due::Writing;
    let (epoch, tears, is_torn) = (state.committed.epoch, state.tears, state.is_torn);
    drop(state);
    let begins = match claimed.epoch == epoch {
        true => claimed.epoch_begins,
        false => claimed.next,
    };
    // A name that is new for each attempt: others may read the objects of former ones.
    let attempt = getrandom::u32().map_err(io::Error::other)?;
    let object = super::entries::snapshot_name(begins, &format!("{}-{attempt:08x}", claimed.writer));
    let (entries, sending) = (claimed.entries.clone(), sending.clone());
    Ok(tokio::spawn(async move {
        let (bytes, digest) = entries.put_snapshot(&object, sending.database.clone()).await?;
        let needs = match is_torn {
            // Since the log began anew, nothing of it was written into the file.
            true => End { epoch, bytes: 0 },
            false => sending.lock().committed,
        };
        Ok(Snapshot {
            epoch,
            tears,
            needs,
            begins,
            object,
            bytes,
            digest,
        })
    }))
}

async fn place_snapshot(
    claimed: &mut Claimed,
    sending: &Sending,
    snapshot: Snapshot,
) -> Result<Placed, MirrorError> {
    if claimed.epoch < snapshot.epoch {
        (claimed.epoch, claimed.epoch_begins) = (snapshot.epoch, snapshot.begins);
    }
    let what = What::Snapshot {
        object: snapshot.object.clone(),
        bytes: snapshot.bytes,
    };
    let entry = claimed.entry_of(snapshot.epoch, what, snapshot.digest, &[])?;
    if put(claimed, sending, &entry).await == Placed::Another {
        return Ok(Placed::Another);
    }
    let mut state = sending.lock();
    state.snapshot = Due::No;
    // After another tear, the next snapshot mends that.
    if state.tears == snapshot.tears {
        state.is_torn = false;
    }
    state.bytes_since_snapshot = 0;
    drop(state);
    sending.succeed();
    let entries = claimed.entries.clone();
    tokio::spawn(async move { entries.remove_before(snapshot.begins, &snapshot.object).await });
    Ok(Placed::Ours)
}

/// Writes the next entry, and repeats this until it is known whose entry has its number.
async fn put(claimed: &mut Claimed, sending: &Sending, entry: &Bytes) -> Placed {
    loop {
        match claimed.entries.put(claimed.next, entry).await {
            Ok(placed) => {
                claimed.next += 1;
                return placed;
            }
            Err(error) => {
                sending.fail(&error);
                tokio::time::sleep(PAUSE_TO_REPEAT).await;
            }
        }
    }
}
