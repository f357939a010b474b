//! Entries of the label log as rows.

use super::super::{StoreError, numbers::clamped};
use murmuration_model::labels::{Action, Annotator, Change, Entry, RequestId};
use murmuration_swarm::Invalid;
use rusqlite::{Connection, Row, Transaction, params};
use std::ops::Range;

const SELECT: &str = "SELECT entry, annotator, time_ms, action, place, class, value, supersedes FROM labels";

pub(crate) fn insert(
    transaction: &Transaction<'_>,
    number: i64,
    request: &RequestId,
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
            request.as_str(),
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

/// The entries that `which` selects, in order. `which` is the SQL clause after the table's name.
pub(crate) fn entries(
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

/// Entries of a campaign's log, in order, each with the request that it came with.
pub(crate) fn entries_with_requests(
    connection: &Connection,
    number: i64,
    range: Range<u64>,
) -> Result<Vec<(RequestId, Entry)>, StoreError> {
    let mut statement = connection.prepare_cached(
        "SELECT entry, annotator, time_ms, action, place, class, value, supersedes, request FROM labels
         WHERE campaign = ?1 AND entry >= ?2 AND entry < ?3 ORDER BY entry",
    )?;
    let mut rows = statement.query(params![number, clamped(range.start), clamped(range.end)])?;
    let mut entries = Vec::new();
    while let Some(row) = rows.next()? {
        let request = RequestId::known(&row.get::<_, String>(8)?);
        let damaged = |error: Invalid| StoreError::damaged(format!("the label log: {error}"));
        entries.push((request.map_err(damaged)?, entry(row)?));
    }
    Ok(entries)
}

fn entry(row: &Row<'_>) -> Result<Entry, StoreError> {
    let number = row.get::<_, i64>(0)?.unsigned_abs();
    let damaged = |error: Invalid| StoreError::damaged(format!("entry {number} of the label log: {error}"));
    let annotator = Annotator::known(&row.get::<_, String>(1)?).map_err(damaged)?;
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
            Action::Delete { class } => named("delete", class, None),
            Action::Shortcut { class, shortcut } => {
                named("shortcut", class, shortcut.map(|key| key.to_string()))
            }
            Action::Revert { entry } => Self {
                action: "revert".to_owned(),
                place: Some(clamped(*entry)),
                ..Self::default()
            },
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
            ("delete", None) => Action::Delete {
                class: class.parse()?,
            },
            ("shortcut", None) => Action::Shortcut {
                class: class.parse()?,
                shortcut: (!value.is_empty()).then(|| value.parse()).transpose()?,
            },
            ("revert", Some(entry)) => Action::Revert {
                entry: entry.unsigned_abs(),
            },
            (other, _) => return Err(Invalid::new("action", other, "one that this version writes")),
        })
    }
}
