//! Read-only connections beside the writing connection, so that a read waits neither for a change nor for another read.
//!
//! Each read sees the database as of one instant, without changes that are uncommitted or that the disk refused. Limits: at most
//! [`MOST`] reads run at once, and further reads wait. At most [`MOST_IN_BACKGROUND`] reads run in the background, so that a
//! decision finds a free connection. No read runs while the log is emptied.

use super::{FileSystem, StoreError, open};
use rusqlite::Connection;
use std::{
    path::Path,
    sync::{Condvar, Mutex, MutexGuard, PoisonError, TryLockError},
};

/// Number of connections: more connections would only compete for the disk.
const MOST: usize = 4;
/// Maximum number of connections that threads of low priority use at once.
const MOST_IN_BACKGROUND: usize = 2;

/// Connections to one database.
#[derive(Debug)]
pub(super) struct Readers {
    turns: Mutex<Turns>,
    /// Notified when a read ends, and when readers are no longer kept away.
    changed: Condvar,
    /// [`MOST`] connections, each locked by its reader.
    connections: Vec<Mutex<Connection>>,
}

#[derive(Debug, Default)]
struct Turns {
    reading: usize,
    /// Number of the current reads that run in the background.
    in_background: usize,
    kept_away: bool,
}

/// The turn of a reader, until dropped.
struct Turn<'a> {
    readers: &'a Readers,
    in_background: bool,
}

/// Keeps all readers away until dropped.
pub(super) struct KeptAway<'a>(&'a Readers);

impl Readers {
    /// Connections to a database that another connection of this process writes.
    pub(super) fn open(path: &Path, file_system: &FileSystem) -> Result<Self, StoreError> {
        let connections = (0..MOST).map(|_| Ok(Mutex::new(open::to_read(path, file_system)?)));
        Ok(Self {
            turns: Mutex::default(),
            changed: Condvar::new(),
            connections: connections.collect::<Result<_, StoreError>>()?,
        })
    }

    /// Runs `query`, which sees the database as of one instant. `query` must not call the store. With `in_background`, `query`
    /// uses a connection for threads of low priority.
    pub(super) fn read<T>(
        &self,
        in_background: bool,
        query: impl FnOnce(&Connection) -> Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        // The turn must end after the connection is free, so it is declared first.
        let _turn = self.turn(in_background);
        let connection = self.free();
        let snapshot = connection.unchecked_transaction()?;
        query(&snapshot)
    }

    /// Keeps new readers away, and waits until the current readers have ended.
    pub(super) fn keep_away(&self) -> KeptAway<'_> {
        let mut turns = lock(&self.turns);
        turns.kept_away = true;
        while turns.reading > 0 {
            turns = self.wait(turns);
        }
        KeptAway(self)
    }

    fn turn(&self, in_background: bool) -> Turn<'_> {
        let mut turns = lock(&self.turns);
        while turns.kept_away
            || turns.reading == MOST
            || in_background && turns.in_background == MOST_IN_BACKGROUND
        {
            turns = self.wait(turns);
        }
        turns.reading += 1;
        turns.in_background += usize::from(in_background);
        Turn {
            readers: self,
            in_background,
        }
    }

    /// An unused connection: there are as many connections as turns.
    fn free(&self) -> MutexGuard<'_, Connection> {
        let free = self.connections.iter().find_map(|one| match one.try_lock() {
            Ok(free) => Some(free),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        });
        free.unwrap_or_else(|| lock(&self.connections[0]))
    }

    fn wait<'a>(&self, turns: MutexGuard<'a, Turns>) -> MutexGuard<'a, Turns> {
        self.changed.wait(turns).unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut Turns)) {
        change(&mut lock(&self.turns));
        self.changed.notify_all();
    }
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.readers.change(|turns| {
            turns.reading -= 1;
            turns.in_background -= usize::from(self.in_background);
        });
    }
}

impl Drop for KeptAway<'_> {
    fn drop(&mut self) {
        self.0.change(|turns| turns.kept_away = false);
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
