//! The current labels of each log, cached so that a log is not read from its beginning each time.
//!
//! The returned labels always follow from all entries on disk. Only new entries are read, because entries are never changed
//! (invariant 10 of ARCHITECTURE.md) and are numbered without gaps. Limits: when the cache is full, it drops the labels that were
//! not used lately, and reads their logs again when needed.

use super::{
    super::{Store, StoreError, campaigns::number_of},
    LabelError, entries_of, log,
};
use crate::kept;
use murmuration_model::{
    CampaignId,
    labels::{BrokenLog, Labels},
};
use rusqlite::{Connection, Transaction};
use std::{
    mem,
    sync::{Arc, Mutex, MutexGuard, PoisonError},
};

/// Maximum number of bytes of the labels in the cache.
const MOST_BYTES: usize = 128 << 20;
/// Approximate bytes in memory of an entry: an answer is in three trees, and has a node of its own in the tree by individual.
const BYTES_AN_ENTRY: usize = 640;

/// Maximum number of new entries that are read while other tasks wait for a campaign's labels.
const SOON_READ: u64 = if cfg!(test) { 10 } else { 2_000 };

/// The current labels of each campaign, as far as its log was read.
///
/// Each campaign has one lock, so that cache and disk change together. A writer takes this lock after the writing connection, so
/// that readers do not wait for a change of another campaign. A reader takes this lock before its connection.
#[derive(Debug)]
pub(crate) struct Followed(kept::Kept<Mutex<Kept>>);

/// Labels that are shared with callers, and copied before a change while a caller still holds them.
type Kept = Arc<Labels>;

impl Followed {
    fn of(&self, campaign: &CampaignId) -> Arc<Mutex<Kept>> {
        self.0.of(campaign)
    }

    pub(crate) fn forget(&self, campaign: &CampaignId) {
        self.0.forget(campaign);
    }

    /// Updates the size of a campaign's labels in the cache.
    fn weigh(&self, campaign: &CampaignId, labels: &Labels) {
        self.0.weigh(campaign, labels.entries() as usize * BYTES_AN_ENTRY);
    }
}

impl Default for Followed {
    fn default() -> Self {
        Self(kept::Kept::within(MOST_BYTES))
    }
}

impl Store {
    /// The current labels of a campaign. Reads only the entries since the last call.
    pub fn labels(&self, campaign: &CampaignId) -> Result<Arc<Labels>, StoreError> {
        self.with_labels(campaign, Arc::clone)
    }

    /// Passes the current labels of a campaign to `look`, under their lock.
    ///
    /// # Errors
    /// If the log cannot be read, or its entries do not follow from each other.
    fn with_labels<T>(&self, campaign: &CampaignId, look: impl FnOnce(&Kept) -> T) -> Result<T, StoreError> {
        let kept = self.followed.of(campaign);
        let mut labels = {
            let mut kept = locked(&kept);
            // Writers of the log wait for these labels, so this read does not wait for reads of low priority.
            let is_current = self.read_in(false, |connection| {
                let number = number_of(connection, campaign)?;
                let new = entries_of(connection, number)?.saturating_sub(kept.entries());
                let is_soon_read = new <= SOON_READ;
                if is_soon_read {
                    catch_up(connection, number, &mut kept)?;
                }
                Ok(is_soon_read)
            })?;
            if is_current {
                self.followed.weigh(campaign, &kept);
                return Ok(look(&kept));
            }
            Arc::clone(&kept)
        };
        // A long log is read without the lock, so that nobody waits for a thread of low priority.
        self.read(|connection| catch_up(connection, number_of(connection, campaign)?, &mut labels))?;
        let mut kept = locked(&kept);
        if kept.entries() < labels.entries() {
            *kept = labels;
            self.followed.weigh(campaign, &kept);
            return Ok(look(&kept));
        }
        Ok(look(&labels))
    }

    /// The current labels of the campaign with this id, or of `latest`.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if the campaign or its log cannot be read.
    pub fn labels_of(&self, id: &str) -> Result<Arc<Labels>, StoreError> {
        self.labels(&self.campaign(id)?.id)
    }

    /// Runs `change` in a transaction, with the number and current labels of a campaign. `change` can add entries to the
    /// campaign's log. A refusal by `change` must come before it writes a row, because the transaction is committed even after a
    /// refusal.
    ///
    /// # Errors
    /// The errors of `change`, or if the entries cannot be written; nothing has changed then.
    pub(crate) fn add_to_log<T>(
        &self,
        campaign: &CampaignId,
        change: impl FnOnce(&Transaction<'_>, i64, &mut Labels) -> Result<T, LabelError>,
    ) -> Result<T, LabelError> {
        // Reads the log, if the cache lacks it, before taking the writing connection that other writers wait for.
        self.with_labels(campaign, |_| ())?;
        let kept = self.followed.of(campaign);
        // This lock is held until the committed entries are also in the cache.
        let mut held = None;
        let mut labels = Kept::default();
        let mut before = None;
        let committed = self.commit(|transaction| {
            labels = mem::take(&mut **held.insert(locked(&kept)));
            let number = number_of(transaction, campaign)?;
            catch_up(transaction, number, &mut labels)?;
            before = Some(labels.entries());
            match change(transaction, number, Arc::make_mut(&mut labels)) {
                Err(LabelError::Store(error)) => Err(error),
                other => Ok(other),
            }
        });
        let (done, committed) = match committed {
            Ok((changed, committed)) => (changed, Some(committed)),
            Err(error) => (Err(LabelError::Store(error)), None),
        };
        // Entries that were applied but not committed cannot be undone one by one: the cached labels stay empty, and the log is
        // read again.
        if let Some(mut kept) = held
            && (done.is_ok() || before == Some(labels.entries()))
        {
            self.followed.weigh(campaign, &labels);
            *kept = labels;
        }
        if let Some(committed) = committed {
            self.await_mirror(committed)?;
        }
        done
    }
}

/// Applies the log's new entries to `labels`. If an entry does not follow from the earlier entries, `labels` becomes empty.
fn catch_up(connection: &Connection, number: i64, labels: &mut Kept) -> Result<(), StoreError> {
    let new = log(connection, number, labels.entries())?;
    if new.is_empty() {
        return Ok(());
    }
    Arc::make_mut(labels).follow(new).map_err(|error: BrokenLog| {
        *labels = Kept::default();
        StoreError::damaged(error.to_string())
    })
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests;
