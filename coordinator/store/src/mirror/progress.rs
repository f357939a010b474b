//! How far a mirror is behind the database's log, and the changes that wait for it.
//!
//! SQLite writes a log again from its beginning, with new salts, once all of it is in the database's file. So the store lets the log
//! be written there only when the mirror has all of it, and no snapshot of the file is being read. After the disk has failed, the
//! store must empty the log at once: the mirror is then torn, and gets a new snapshot before anything else.

use super::{MirrorError, entries::MAX_PAYLOAD};
use crate::{StoreError, files::log_of};
use std::{
    fs::File,
    io,
    os::unix::fs::FileExt as _,
    path::{Path, PathBuf},
    sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError},
    time::{Duration, Instant},
};
use tokio::sync::{Notify, watch};

/// Longest time between a change of a run and its entry.
const PAUSE: Duration = Duration::from_millis(800);
/// Longest wait for the mirror before a long log is written into the database. Other changes wait meanwhile.
const WAIT_TO_CATCH_UP: Duration = Duration::from_secs(5);
/// Longest time that a change waits for the mirror. The change keeps its client's seat meanwhile.
const MAX_WAIT: Duration = Duration::from_secs(if cfg!(test) { 5 } else { 30 });
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

/// A mirror to which a store sends its changes.
#[derive(Debug)]
pub(crate) struct Mirror {
    state: Mutex<State>,
    /// Notified when the mirror has more, and when it fails.
    changed: Condvar,
    /// Notified when a change waits for the mirror.
    wanted: Notify,
    /// Whether another process has gone on from the mirror.
    lost: watch::Sender<bool>,
    /// The mirror, for messages.
    pub(super) place: String,
    log_path: PathBuf,
    /// The log, once it is open. SQLite keeps one file for as long as it has the database open.
    log: OnceLock<File>,
    /// The database's file. If this process closed another handle of it, SQLite would lose its locks (POSIX), so this one stays open.
    pub(super) database: Arc<File>,
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
    /// The database's count of changes at the last commit.
    changes: u32,
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
    wants_snapshot: bool,
    /// Bytes of frames since the last snapshot.
    bytes_since_snapshot: u64,
    /// Whether the mirror has a first snapshot.
    is_begun: bool,
    condition: Condition,
    is_finishing: bool,
    #[cfg(test)]
    misses_note: bool,
}

#[derive(Debug, Clone, PartialEq, Eq)]
enum Condition {
    Works,
    Fails(String),
    Lost,
}

/// A part of the log for one entry.
pub(super) struct Piece {
    end: End,
    pub(super) from: u64,
    pub(super) bytes: Vec<u8>,
}

/// The next task of the sender.
pub(super) struct Next {
    /// Whether only a snapshot is of use.
    pub(super) is_torn: bool,
    pub(super) wants_snapshot: bool,
    mirrored: End,
}

/// The state of the log when the database's file began to be read.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reading {
    pub(super) epoch: u64,
    tears: u64,
    is_torn: bool,
}

impl Piece {
    pub(super) const fn epoch(&self) -> u64 {
        self.end.epoch
    }
}

impl Next {
    pub(super) fn has(&self, end: End) -> bool {
        self.mirrored >= end
    }
}

impl Mirror {
    /// The mirror `place` of the database at `database`, which has an empty log and needs a snapshot.
    pub(super) fn new(place: String, epoch: u64, database: &Path) -> io::Result<Self> {
        let begin = End { epoch, bytes: 0 };
        let state = State {
            frames: 0,
            is_counted: false,
            salts: None,
            page_bytes: 0,
            committed: begin,
            changes: 0,
            mirrored: begin,
            is_torn: false,
            tears: 0,
            is_emptying: false,
            is_unnoted: false,
            wants_snapshot: true,
            bytes_since_snapshot: 0,
            is_begun: false,
            condition: Condition::Works,
            is_finishing: false,
            #[cfg(test)]
            misses_note: false,
        };
        Ok(Self {
            state: Mutex::new(state),
            changed: Condvar::new(),
            wanted: Notify::new(),
            lost: watch::Sender::new(false),
            place,
            log_path: log_of(database),
            log: OnceLock::new(),
            database: Arc::new(File::open(database)?),
        })
    }

    /// Opens the log, if it exists already: later, the process may have no file descriptor left.
    pub(super) fn open_log(&self) {
        let _ = self.log();
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

    /// Notes the database's count of changes before the first commit.
    pub(super) fn begin_changes(&self, changes: u32) {
        self.lock().changes = changes;
    }

    /// The database's count of changes at the last commit.
    pub(super) fn changes(&self) -> u32 {
        self.lock().changes
    }

    /// Notes how many frames SQLite's log has after a commit.
    pub(super) fn count(&self, frames: u64) {
        let mut state = self.lock();
        (state.frames, state.is_counted) = (frames, true);
    }

    /// Fails if no change may begin: another process has gone on from the mirror or, for a change that must be in the mirror before
    /// it is acknowledged, the mirror does not work.
    pub(crate) fn check(&self, is_of_run: bool) -> Result<(), StoreError> {
        match &self.lock().condition {
            Condition::Lost => Err(StoreError::MirrorTaken(self.place.clone())),
            Condition::Fails(reason) if !is_of_run => Err(StoreError::NoMirror {
                place: self.place.clone(),
                reason: reason.clone(),
            }),
            Condition::Fails(_) | Condition::Works => Ok(()),
        }
    }

    /// Notes what a change has committed, while no other change can begin. `changes` is the new count of the database's changes.
    /// Returns the end of the change in the log.
    pub(crate) fn committed(&self, changes: Option<u32>) -> Result<End, StoreError> {
        {
            let mut state = self.lock();
            state.changes = changes.unwrap_or(state.changes);
            // A repeated request changes nothing: the change that it repeats may be the one that could not be noted.
            if !std::mem::take(&mut state.is_counted) && !state.is_unnoted {
                return Ok(state.committed);
            }
        }
        let header = self.log().and_then(read_header);
        #[cfg(test)]
        let header = match std::mem::take(&mut self.lock().misses_note) {
            true => Err(io::ErrorKind::Other.into()),
            false => header,
        };
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

    /// Lets the next commit fail to read the log.
    #[cfg(test)]
    pub(super) fn miss_next_note(&self) {
        self.lock().misses_note = true;
    }

    /// Waits until the mirror has all up to `end`.
    ///
    /// # Errors
    /// [`StoreError::MirrorTaken`]; [`StoreError::Unmirrored`] if the process ends, or the mirror does not work for [`MAX_WAIT`].
    pub(crate) fn wait(&self, end: End) -> Result<(), StoreError> {
        self.wanted.notify_one();
        let last = Instant::now() + MAX_WAIT;
        let mut state = self.lock();
        loop {
            let left = last.saturating_duration_since(Instant::now());
            let place = || self.place.clone();
            match &state.condition {
                // Our entries come before those of a process that went on from the mirror.
                _ if state.has(end) => return Ok(()),
                Condition::Lost => return Err(StoreError::MirrorTaken(place())),
                Condition::Fails(reason) if state.is_finishing || left.is_zero() => {
                    return Err(StoreError::Unmirrored {
                        place: place(),
                        reason: reason.clone(),
                    });
                }
                Condition::Works if state.is_finishing => {
                    return Err(StoreError::Unmirrored {
                        place: place(),
                        reason: "it has not answered yet".to_owned(),
                    });
                }
                Condition::Works | Condition::Fails(_) => {}
            }
            // A slow mirror that works is waited for: the time is up only if it fails, of which this value is notified.
            let pause = if left.is_zero() { MAX_WAIT } else { left };
            let waited = self.changed.wait_timeout(state, pause);
            state = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Notes that the store begins to empty the log, whether or not the mirror has it.
    pub(crate) fn emptying(&self) {
        let mut state = self.lock();
        state.is_emptying = true;
        state.tears += 1;
    }

    /// Notes that the log is empty or, if not `done`, that it is only partly in the database's file.
    pub(crate) fn emptied(&self, done: bool) {
        let mut state = self.lock();
        state.is_emptying = false;
        state.tears += 1;
        if done && (state.mirrored < state.committed || state.is_unnoted) {
            state.tear();
        }
    }

    /// Waits until the mirror has the whole log, so that the log may be written into the database, after which it begins anew.
    /// Returns whether this is so; at once if the mirror does not work, or a snapshot is being made.
    pub(crate) fn catches_up(&self) -> bool {
        self.wanted.notify_one();
        let may_come = |state: &mut State| {
            !state.wants_snapshot
                && !state.is_torn
                && !state.is_unnoted
                && !state.is_finishing
                && state.condition == Condition::Works
        };
        let waits = |state: &mut State| may_come(state) && state.mirrored < state.committed;
        let waited = self
            .changed
            .wait_timeout_while(self.lock(), WAIT_TO_CATCH_UP, waits);
        let mut state = waited.unwrap_or_else(PoisonError::into_inner).0;
        may_come(&mut state) && state.mirrored >= state.committed
    }

    /// Notes that the whole log is in the database.
    pub(crate) fn log_written(&self) {
        let size = self.database.metadata().map_or(0, |file| file.len());
        let mut state = self.lock();
        if state.bytes_since_snapshot > SNAPSHOT_BYTES.max(size) {
            state.wants_snapshot = true;
            self.wanted.notify_one();
        }
    }

    /// Returns, with the reason, when another process has gone on from the mirror.
    pub(crate) async fn taken_over(&self) -> StoreError {
        // This value has the other end of the channel, so waiting cannot fail.
        let _ = self.lost.subscribe().wait_for(|&lost| lost).await;
        StoreError::MirrorTaken(self.place.clone())
    }

    /// Lets no change wait any longer: the process ends.
    pub(crate) fn begin_to_end(&self) {
        self.lock().is_finishing = true;
        self.changed.notify_all();
    }

    /// Sends what is left, within some seconds.
    pub(crate) async fn finish(&self) {
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

    /// Whether the mirror has a first snapshot.
    pub(super) fn is_begun(&self) -> bool {
        self.lock().is_begun
    }

    pub(super) fn next(&self) -> Next {
        let state = self.lock();
        Next {
            is_torn: state.is_torn,
            wants_snapshot: state.is_torn || state.wants_snapshot,
            mirrored: state.mirrored,
        }
    }

    /// Notes that the database's file begins to be read.
    pub(super) fn reading(&self) -> Reading {
        let state = self.lock();
        Reading {
            epoch: state.committed.epoch,
            tears: state.tears,
            is_torn: state.is_torn,
        }
    }

    /// The part of the log that the mirror must have before a snapshot whose file was read until now: the file can have this part.
    pub(super) fn needs(&self, reading: Reading) -> End {
        match reading.is_torn {
            // Since the log began anew, nothing of it was written into the file.
            true => End {
                epoch: reading.epoch,
                bytes: 0,
            },
            false => self.lock().committed,
        }
    }

    /// Whether the file that was read belongs to the epoch of `reading`.
    pub(super) fn accepts(&self, reading: Reading) -> bool {
        let state = self.lock();
        !state.is_emptying && state.tears == reading.tears
    }

    /// Notes that the mirror has the snapshot of `reading`.
    pub(super) fn has_snapshot(&self, reading: Reading) {
        let mut state = self.lock();
        (state.wants_snapshot, state.is_begun) = (false, true);
        // After another tear, the next snapshot mends that.
        if state.tears == reading.tears {
            state.is_torn = false;
        }
        state.bytes_since_snapshot = 0;
        drop(state);
        self.succeed();
    }

    /// Notes that the mirror has a part of the log.
    pub(super) fn has_piece(&self, piece: &Piece) {
        let mut state = self.lock();
        // If the log began anew meanwhile, the mirror has nothing of the new one.
        if state.mirrored.epoch == piece.end.epoch {
            state.mirrored = piece.end;
        }
        state.bytes_since_snapshot += piece.bytes.len() as u64;
        drop(state);
        self.succeed();
    }

    /// Lets the sender look what there is to do.
    pub(super) fn want(&self) {
        self.wanted.notify_one();
    }

    /// Returns when a change waits for the mirror, or [`PAUSE`] is over.
    pub(super) async fn wanted(&self) {
        let _ = tokio::time::timeout(PAUSE, self.wanted.notified()).await;
    }

    fn succeed(&self) {
        let mut state = self.lock();
        if let Condition::Fails(_) = std::mem::replace(&mut state.condition, Condition::Works) {
            tracing::info!(mirror = self.place, "the mirror works again");
        }
        drop(state);
        self.changed.notify_all();
    }

    pub(super) fn fail(&self, error: &MirrorError) {
        let mut state = self.lock();
        if state.condition == Condition::Works {
            tracing::warn!(%error, "the mirror does not work: campaigns go on, decisions and labels wait for it");
        }
        state.condition = Condition::Fails(error.to_string());
        drop(state);
        self.changed.notify_all();
    }

    /// Notes that nothing is sent any more.
    pub(super) fn end(&self) {
        let mut state = self.lock();
        if state.condition == Condition::Works {
            state.condition = Condition::Fails("its thread has ended".to_owned());
        }
        drop(state);
        self.changed.notify_all();
    }

    /// Notes that a snapshot could not be written. The next one is due once the log was written into the database again.
    pub(super) fn postpone_snapshot(&self) {
        self.lock().wants_snapshot = false;
    }

    pub(super) fn lose(&self) {
        self.lock().condition = Condition::Lost;
        self.changed.notify_all();
        self.lost.send_replace(true);
    }

    /// The next part of the log that the mirror lacks, if there is any.
    pub(super) fn piece(&self) -> io::Result<Option<Piece>> {
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
