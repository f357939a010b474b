//! Entries of the label log as rows.

use super::super::{StoreError, numbers::clamped};
use murmuration_model::labels::{Action, Annotator, Change, ClassName, Entry, RequestId};
use murmuration_proto::{Invalid, text::marked};
use rusqlite::{Connection, Row, Transaction, params};

const SELECT: &str = "
    SELECT entry, annotator, time_ms, action, place, class, value, supersedes FROM labels WHERE campaign = ?1";

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

/// Those of a campaign, which is parameter 1, that are as `which` says, in order.
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

fn entry(row: &Row<'_>) -> Result<Entry, StoreError> {
    let number = row.get::<_, i64>(0)?.unsigned_abs();
    let damaged = |error: Invalid| StoreError::damaged(format!("entry {number} of the label log: {error}"));
    // Earlier versions took names with characters that cannot be seen.
    let annotator = Annotator::known(&marked(&row.get::<_, String>(1)?)).map_err(damaged)?;
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
        let class = marked(&self.class.unwrap_or_default());
        let value = marked(&self.value.unwrap_or_default());
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
                class: ClassName::stored(&class)?,
            },
            ("rename", None) => Action::Rename {
                class: ClassName::stored(&class)?,
                to: ClassName::stored(&value)?,
            },
            ("merge", None) => Action::Merge {
                class: ClassName::stored(&class)?,
                into: ClassName::stored(&value)?,
            },
            ("colour", None) => Action::Colour {
                class: ClassName::stored(&class)?,
                colour: value.parse()?,
            },
            (other, _) => return Err(Invalid::new("action", other, "one that this version writes")),
        })
    }
}
