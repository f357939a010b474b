//! The current labels of each log, cached so that no log is ever read from its beginning twice.
//!
//! The disk stays the truth: whoever asks is told what stands after the entries that are there. It is only read what is
//! new among them: entries are never changed (invariant 10 of ARCHITECTURE.md), and numbered without gaps. Limits: what logs
//! come to that nobody has asked for lately is forgotten where there is no room for it, and those are read again.

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

/// Most bytes of what logs come to that are kept.
const MOST_BYTES: usize = 128 << 20;
/// Bytes that an entry comes to, about: an answer in three trees, of which that by individual has a node to itself.
const BYTES_AN_ENTRY: usize = 640;

/// New entries that are read while others wait for a campaign's labels.
const SOON_READ: u64 = if cfg!(test) { 10 } else { 2_000 };

/// The current labels of each campaign, as far as its log was read.
///
/// One lock a campaign, so that what is kept and what is on disk change together. Who writes takes it when the connection
/// that writes is theirs, so that who reads waits for no change of another campaign; who reads takes it first.
#[derive(Debug)]
pub(crate) struct Followed(kept::Kept<Mutex<Kept>>);

/// Shared with whoever asked what stands: it is copied if it has to change while they still look at it.
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

    /// Passes the current labels of a campaign to `look` while nobody can change them.
    ///
    /// # Errors
    /// If the log cannot be read, or its entries do not follow from each other.
    fn with_labels<T>(&self, campaign: &CampaignId, look: impl FnOnce(&Kept) -> T) -> Result<T, StoreError> {
        let kept = self.followed.of(campaign);
        let mut labels = {
            let mut kept = locked(&kept);
            // Adding to the log waits for these labels, so their reading does not wait for reads of low priority.
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
        // Nobody waits while a long log is read, perhaps on a thread of low priority.
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
    /// [`StoreError::NoCampaign`], or if it cannot be read.
    pub fn labels_of(&self, id: &str) -> Result<Arc<Labels>, StoreError> {
        self.labels(&self.campaign(id)?.id)
    }

    /// Runs `change`, which may add to the log of a campaign, in a transaction, with the campaign's number and what its log
    /// comes to. What is refused must be refused before a row is written: the transaction is committed then too.
    ///
    /// # Errors
    /// The errors of `change` and of writing; then nothing has changed.
    pub(crate) fn add_to_log<T>(
        &self,
        campaign: &CampaignId,
        change: impl FnOnce(&Transaction<'_>, i64, &mut Labels) -> Result<T, LabelError>,
    ) -> Result<T, LabelError> {
        // A log that was forgotten is read before others wait for the connection that writes.
        self.with_labels(campaign, |_| ())?;
        let kept = self.followed.of(campaign);
        // Until what is committed is kept too.
        let mut held = None;
        let mut labels = Kept::default();
        let mut before = None;
        let done = self.write(|transaction| {
            labels = mem::take(&mut **held.insert(locked(&kept)));
            let number = number_of(transaction, campaign)?;
            catch_up(transaction, number, &mut labels)?;
            before = Some(labels.entries());
            match change(transaction, number, Arc::make_mut(&mut labels)) {
                Err(LabelError::Store(error)) => Err(error),
                other => Ok(other),
            }
        });
        let done = done.map_err(LabelError::Store).and_then(|changed| changed);
        // Entries that were applied but are not on disk cannot be undone one by one: the log is read anew.
        if let Some(mut kept) = held
            && (done.is_ok() || before == Some(labels.entries()))
        {
            self.followed.weigh(campaign, &labels);
            *kept = labels;
        }
        done
    }
}

/// Takes in what the log has beyond `labels`; nothing is left of them if it cannot be followed.
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
