//! Rows of the label log: added, never changed.

use super::{Store, StoreError, archive::clamped, campaigns::number_of};
use crate::{
    campaign::CampaignId,
    labels::{Action, Annotator, BrokenLog, Change, Entry, Labels, Refusal, RequestId},
};
use murmuration_proto::Invalid;
use rusqlite::{Connection, Row, Transaction, params};

/// Why nothing was added to a log.
#[derive(Debug, thiserror::Error)]
pub enum LabelError {
    /// The store could not be read or written, or there is no such campaign or individual.
    #[error("{0}")]
    Store(#[from] StoreError),
    /// What was said does not go with what the log says.
    #[error("{0}")]
    Refused(#[from] Refusal),
    /// A former request of the same id said something else.
    #[error("request \"{0}\" was made before, and said something else")]
    OtherRequest(RequestId),
}

/// The request of entries that nobody asked for; no request has this id.
pub(super) const BY_ITSELF: &str = "";

const SELECT: &str = "
    SELECT entry, annotator, time_ms, action, place, class, value, supersedes FROM labels WHERE campaign = ?1";

impl Store {
    /// The whole log of a campaign, in order.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn label_log(&self, campaign: &CampaignId) -> Result<Vec<Entry>, StoreError> {
        self.read(|connection| log(connection, number_of(connection, campaign)?, 0))
    }

    /// Number of entries of a campaign's log.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn label_entries(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let count: i64 = connection.query_row(
                "SELECT coalesce(max(entry) + 1, 0) FROM labels WHERE campaign = ?1",
                [number],
                |row| row.get(0),
            )?;
            Ok(count.unsigned_abs())
        })
    }

    /// Number of entries of all campaigns' logs.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn count_labels(&self) -> Result<u64, StoreError> {
        self.read(|connection| {
            let count: i64 = connection.query_row("SELECT count(*) FROM labels", [], |row| row.get(0))?;
            Ok(count.unsigned_abs())
        })
    }

    /// What the log of a campaign comes to.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn labels(&self, campaign: &CampaignId) -> Result<Labels, StoreError> {
        self.catch_up(campaign, Labels::default())
    }

    /// As [`Store::labels`], where the beginning of the log was read before: only what is new is read.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn catch_up(&self, campaign: &CampaignId, labels: Labels) -> Result<Labels, StoreError> {
        self.read(|connection| follow(connection, number_of(connection, campaign)?, labels))
    }

    /// What a request added to a campaign's log; nothing if it was not made.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn request_entries(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
    ) -> Result<Vec<Entry>, StoreError> {
        self.read(|connection| made(connection, number_of(connection, campaign)?, request))
    }

    /// Adds what a request says to a campaign's log, all of it or nothing, in one transaction; the new entries. A request
    /// that was made before adds nothing: the entries are those that it added then.
    ///
    /// # Errors
    /// [`LabelError`]; [`StoreError::NoIndividual`] where an answer is about one that the archive does not hold. Nothing
    /// was added then.
    pub fn add_labels(
        &self,
        campaign: &CampaignId,
        request: &RequestId,
        changes: Vec<Change>,
    ) -> Result<Vec<Entry>, LabelError> {
        // What is refused was refused before a row was written, so that committing changes nothing.
        self.write(|transaction| match add(transaction, campaign, request, changes) {
            Err(LabelError::Store(error)) => Err(error),
            other => Ok(other),
        })?
    }
}

pub(super) fn add(
    transaction: &Transaction<'_>,
    campaign: &CampaignId,
    request: &RequestId,
    changes: Vec<Change>,
) -> Result<Vec<Entry>, LabelError> {
    let number = number_of(transaction, campaign)?;
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
    let mut labels = follow(transaction, number, Labels::default())?;
    let added = changes
        .into_iter()
        .map(|change| labels.record(change))
        .collect::<Result<Vec<Entry>, Refusal>>()?;
    insert(transaction, number, request.as_str(), &added)?;
    Ok(added)
}

/// What a request added.
fn made(connection: &Connection, number: i64, request: &RequestId) -> Result<Vec<Entry>, StoreError> {
    entries(connection, "AND request = ?2", params![number, request.as_str()])
}

/// Times are left out: a request that is made again may be dated anew.
fn says_the_same(one: &Change, other: &Change) -> bool {
    (&one.annotator, &one.action) == (&other.annotator, &other.action)
}

fn check_individuals(
    transaction: &Transaction<'_>,
    campaign: &CampaignId,
    number: i64,
    changes: &[Change],
) -> Result<(), StoreError> {
    let len: i64 = transaction.query_row(
        "SELECT coalesce(max(place) + 1, 0) FROM individuals WHERE campaign = ?1",
        [number],
        |row| row.get(0),
    )?;
    let len = len.unsigned_abs();
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

pub(super) fn insert(
    transaction: &Transaction<'_>,
    number: i64,
    request: &str,
    added: &[Entry],
) -> Result<(), StoreError> {
    let mut statement = transaction.prepare(
        "INSERT INTO labels
            (campaign, entry, request, annotator, time_ms, action, place, class, value, supersedes)
         VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)",
    )?;
    for entry in added {
        let columns = Columns::of(&entry.change.action);
        statement.execute(params![
            number,
            clamped(entry.number),
            request,
            entry.change.annotator.as_str(),
            clamped(entry.change.time_ms),
            columns.action,
            columns.place,
            columns.class,
            columns.value,
            entry.supersedes.map(clamped),
        ])?;
    }
    Ok(())
}

/// The log from entry `from` on.
fn log(connection: &Connection, number: i64, from: u64) -> Result<Vec<Entry>, StoreError> {
    entries(connection, "AND entry >= ?2", params![number, clamped(from)])
}

pub(super) fn follow(connection: &Connection, number: i64, mut labels: Labels) -> Result<Labels, StoreError> {
    let new = log(connection, number, labels.entries())?;
    let broken = |error: BrokenLog| StoreError::damaged(error.to_string());
    labels.follow(new).map_err(broken)?;
    Ok(labels)
}

pub(super) fn entries(
    connection: &Connection,
    which: &str,
    parameters: impl rusqlite::Params,
) -> Result<Vec<Entry>, StoreError> {
    let mut statement = connection.prepare_cached(&format!("{SELECT} {which} ORDER BY entry"))?;
    let mut rows = statement.query(parameters)?;
    let mut entries = Vec::new();
    while let Some(row) = rows.next()? {
        entries.push(entry(row)?);
    }
    Ok(entries)
}

fn entry(row: &Row<'_>) -> Result<Entry, StoreError> {
    let number = row.get::<_, i64>(0)?.unsigned_abs();
    let damaged = |error: Invalid| StoreError::damaged(format!("entry {number} of the label log: {error}"));
    let annotator: Annotator = row.get::<_, String>(1)?.parse().map_err(damaged)?;
    let columns = Columns {
        action: row.get(3)?,
        place: row.get(4)?,
        class: row.get(5)?,
        value: row.get(6)?,
    };
    Ok(Entry {
        number,
        change: Change {
            annotator,
            time_ms: row.get::<_, i64>(2)?.unsigned_abs(),
            action: columns.read().map_err(damaged)?,
        },
        supersedes: row.get::<_, Option<i64>>(7)?.map(i64::unsigned_abs),
    })
}

/// An action in columns.
#[derive(Debug, Default)]
struct Columns {
    action: String,
    place: Option<i64>,
    class: Option<String>,
    value: Option<String>,
}

impl Columns {
    fn of(action: &Action) -> Self {
        let named = |action: &str, class: &dyn ToString, value: Option<String>| Self {
            action: action.to_owned(),
            class: Some(class.to_string()),
            value,
            place: None,
        };
        match action {
            Action::Answer { index, answer } => Self {
                place: Some(clamped(*index)),
                ..named("answer", answer, None)
            },
            Action::Undo => Self {
                action: "undo".to_owned(),
                ..Self::default()
            },
            Action::Withdraw { index } => Self {
                action: "withdraw".to_owned(),
                place: Some(clamped(*index)),
                ..Self::default()
            },
            Action::Create { class } => named("create", class, None),
            Action::Rename { class, to } => named("rename", class, Some(to.to_string())),
            Action::Merge { class, into } => named("merge", class, Some(into.to_string())),
            Action::Colour { class, colour } => named("colour", class, Some(colour.to_string())),
        }
    }

    fn read(self) -> Result<Action, Invalid> {
        let class = self.class.unwrap_or_default();
        let value = self.value.unwrap_or_default();
        Ok(match (self.action.as_str(), self.place) {
            ("answer", Some(place)) => Action::Answer {
                index: place.unsigned_abs(),
                answer: class.parse()?,
            },
            ("undo", None) => Action::Undo,
            ("withdraw", Some(place)) => Action::Withdraw {
                index: place.unsigned_abs(),
            },
            ("create", None) => Action::Create {
                class: class.parse()?,
            },
            ("rename", None) => Action::Rename {
                class: class.parse()?,
                to: value.parse()?,
            },
            ("merge", None) => Action::Merge {
                class: class.parse()?,
                into: value.parse()?,
            },
            ("colour", None) => Action::Colour {
                class: class.parse()?,
                colour: value.parse()?,
            },
            (other, _) => return Err(Invalid::new("action", other, "one that this version writes")),
        })
    }
}

#[cfg(test)]
mod tests;
