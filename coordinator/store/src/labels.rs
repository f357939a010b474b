//! The label log, which is append-only.

mod budget;
mod followed;
mod rows;

pub use budget::{LabelBudget, OverBudget};
pub(super) use followed::Followed;
pub(super) use rows::{entries, entries_with_requests, insert};

use super::{
    Store, StoreError,
    campaigns::{campaign, number_of},
    chunks,
    hidden::HIDDEN,
    numbers::clamped,
};
use murmuration_model::{
    CampaignId, CampaignRecord,
    labels::{Action, Annotator, Change, Entry, Label, Labels, Refusal, RequestId},
};
use rusqlite::{Connection, Transaction, params};

/// Maximum number of entries of a log: ten answers about each of 20,000 individuals. A full log takes only undos and withdrawals.
/// The maximum bounds memory, because all entries are kept in memory.
const MAX_ENTRIES: u64 = if cfg!(test) { 1_000 } else { 200_000 };

/// Why nothing was added to a log.
#[derive(Debug, thiserror::Error)]
pub enum LabelError {
    /// The store could not be read or written, or the campaign or individual does not exist.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The request contradicts the log.
    #[error(transparent)]
    Refused(#[from] Refusal),
    /// An earlier request with the same id had other contents.
    #[error("request \"{0}\" was made before with other contents: use another request id")]
    OtherRequest(RequestId),
    /// The token cannot add this many entries now.
    #[error(transparent)]
    OverBudget(#[from] OverBudget),
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Undone {
    pub entry: Entry,
    pub answer: Label,
}

impl Store {
    /// The whole label log of a campaign, in order.
    pub fn label_log(&self, campaign: &CampaignId) -> Result<Vec<Entry>, StoreError> {
        self.read(|connection| log(connection, number_of(connection, campaign)?, 0))
    }

    /// At most `count` entries of a campaign's log, from entry `from` on.
    pub fn label_log_from(
        &self,
        campaign: &CampaignId,
        from: u64,
        count: u64,
    ) -> Result<Vec<Entry>, StoreError> {
        let range = [from, from.saturating_add(count)].map(clamped);
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let which = "WHERE campaign = ?1 AND entry >= ?2 AND entry < ?3";
            entries(connection, which, params![number, range[0], range[1]])
        })
    }

    /// Number of entries of a campaign's log.
    pub fn label_entries(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| entries_of(connection, number_of(connection, campaign)?))
    }

    /// The campaign with this id (or `latest`), and the number of entries of its label log at the same instant.
    ///
    /// # Errors
    /// [`StoreError::NoCampaign`], or if the campaign cannot be read.
    pub(crate) fn campaign_and_label_entries(&self, id: &str) -> Result<(CampaignRecord, u64), StoreError> {
        self.read(|connection| {
            let record = campaign(connection, id)?;
            let entries = entries_of(connection, number_of(connection, &record.id)?)?;
            Ok((record, entries))
        })
    }

    /// Number of entries of all campaigns' logs.
    pub fn count_labels(&self) -> Result<u64, StoreError> {
        self.read(|connection| {
            // The largest number of an entry gives the count, because entries are numbered without gaps. Counting would read
            // every row.
            let entries =
                "SELECT coalesce(sum((SELECT max(entry) + 1 FROM labels WHERE campaign = number)), 0)
                FROM campaigns WHERE state <> ?1";
            let count: i64 = connection.query_row(entries, [HIDDEN], |row| row.get(0))?;
            Ok(count.unsigned_abs())
        })
    }

    /// Entries that a request added to a campaign's log; empty if the request was not made.
    pub fn request_entries(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
    ) -> Result<Vec<Entry>, StoreError> {
        self.read(|connection| made(connection, number_of(connection, campaign)?, request))
    }

    /// Adds the changes of a request to a campaign's log, all or none, in one transaction, and returns the new entries. Renaming
    /// a class to its own name adds no entry. A repeated request adds nothing, and returns the entries that it added before.
    ///
    /// # Errors
    /// [`LabelError`]; [`StoreError::NoIndividual`] if an answer is about an individual that the archive does not hold. Nothing
    /// was added then.
    pub fn add_labels(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
        changes: Vec<Change>,
    ) -> Result<Vec<Entry>, LabelError> {
        self.add_to_log(campaign, |transaction, number, labels| {
            let entries = labels.entries();
            // Undos and withdrawals are always accepted: their number cannot exceed the number of answers.
            let takes_back =
                |change: &Change| matches!(change.action, Action::Undo | Action::Withdraw { .. });
            if entries.saturating_add(changes.len() as u64) > MAX_ENTRIES
                && !changes.iter().all(takes_back)
                && made(transaction, number, request)?.is_empty()
            {
                let more = changes.len();
                return Err(Refusal::Full {
                    entries,
                    more,
                    most: MAX_ENTRIES,
                }
                .into());
            }
            add(transaction, campaign, number, request, changes, labels)
        })
    }

    /// In one transaction, undoes an annotator's last request: all answers of this annotator that came with the same request as
    /// the annotator's newest standing answer. Returns the undone answers, newest first. A repeated undo changes nothing, and
    /// returns the answers that it undid before. `time_ms` is the time of the undo, milliseconds since 1970-01-01 UTC.
    ///
    /// # Errors
    /// [`LabelError`]; [`Refusal::NothingToUndo`] if the annotator has no standing answers. Nothing has changed then.
    pub fn undo_labels(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
        annotator: &Annotator,
        time_ms: u64,
    ) -> Result<Vec<Undone>, LabelError> {
        self.add_to_log(campaign, |transaction, number, labels| {
            let undo = Change {
                annotator: annotator.clone(),
                time_ms,
                action: Action::Undo,
            };
            let mut entries = made(transaction, number, request)?;
            if entries.is_empty() {
                entries = undo_newest(transaction, number, labels, &undo)?;
                insert(transaction, number, request, &entries)?;
            } else if !entries.iter().all(|entry| says_the_same(&entry.change, &undo)) {
                return Err(LabelError::OtherRequest(request.clone()));
            }
            let undone = |entry: Entry| {
                let answer = labels.given(entry.supersedes?)?;
                Some(Undone { entry, answer })
            };
            Ok(entries.into_iter().filter_map(undone).collect())
        })
    }
}

pub(super) fn entries_of(connection: &Connection, number: i64) -> Result<u64, StoreError> {
    let count: i64 = connection.query_row(
        "SELECT coalesce(max(entry) + 1, 0) FROM labels WHERE campaign = ?1",
        [number],
        |row| row.get(0),
    )?;
    Ok(count.unsigned_abs())
}

/// The entries of an undo, one for each answer of the annotator's last request.
fn undo_newest(
    transaction: &Transaction<'_>,
    number: i64,
    labels: &mut Labels,
    undo: &Change,
) -> Result<Vec<Entry>, LabelError> {
    let annotator = &undo.annotator;
    let nothing = || Refusal::NothingToUndo(annotator.clone());
    let newest = labels.newest(annotator).ok_or_else(nothing)?;
    let first: i64 = transaction
        .query_row(
            "SELECT min(entry) FROM labels INDEXED BY labels_by_request WHERE campaign = ?1
             AND request = (SELECT request FROM labels WHERE campaign = ?1 AND entry = ?2)",
            params![number, clamped(newest)],
            |row| row.get(0),
        )
        .map_err(StoreError::from)?;
    let mut entries = Vec::new();
    while labels
        .newest(annotator)
        .is_some_and(|newest| newest >= first.unsigned_abs())
    {
        entries.push(labels.record(undo.clone())?);
    }
    Ok(entries)
}

/// Adds the changes of a request to the log. A refused request writes nothing.
pub(super) fn add(
    transaction: &Transaction<'_>,
    campaign: &CampaignId,
    number: i64,
    request: &RequestId,
    changes: Vec<Change>,
    labels: &mut Labels,
) -> Result<Vec<Entry>, LabelError> {
    let before = made(transaction, number, request)?;
    if !before.is_empty() {
        let same = before.len() == changes.len()
            && before
                .iter()
                .zip(&changes)
                .all(|(entry, change)| says_the_same(&entry.change, change));
        return if same {
            Ok(before)
        } else {
            Err(LabelError::OtherRequest(request.clone()))
        };
    }
    check_individuals(transaction, campaign, number, &changes)?;
    let mut added = Vec::new();
    for change in changes {
        if !labels.is_idle(&change.action) {
            added.push(labels.record(change)?);
        }
    }
    insert(transaction, number, request, &added)?;
    Ok(added)
}

/// Entries that a request added.
fn made(connection: &Connection, number: i64, request: &RequestId) -> Result<Vec<Entry>, StoreError> {
    // Without the hint `INDEXED BY`, SQLite reads the whole log, because the entries are ordered by number.
    let which = "INDEXED BY labels_by_request WHERE campaign = ?1 AND request = ?2";
    entries(connection, which, params![number, request.as_str()])
}

/// Whether two changes are equal except for their times: a repeated request can have a new time.
fn says_the_same(one: &Change, other: &Change) -> bool {
    (&one.annotator, &one.action) == (&other.annotator, &other.action)
}

fn check_individuals(
    transaction: &Transaction<'_>,
    campaign: &CampaignId,
    number: i64,
    changes: &[Change],
) -> Result<(), StoreError> {
    let len = chunks::archive_len(transaction, number)?;
    for change in changes {
        if let Action::Answer { index, .. } = change.action
            && index >= len
        {
            return Err(StoreError::NoIndividual {
                campaign: campaign.as_str().to_owned(),
                index,
                len,
            });
        }
    }
    Ok(())
}

/// The log from entry `from` on.
fn log(connection: &Connection, number: i64, from: u64) -> Result<Vec<Entry>, StoreError> {
    let which = "WHERE campaign = ?1 AND entry >= ?2";
    entries(connection, which, params![number, clamped(from)])
}

#[cfg(test)]
mod tests;
