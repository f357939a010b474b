//! Rows of hidden campaigns: campaigns that are being imported or deleted.
//!
//! Many short transactions import or delete an archive, and other writes happen between them. Meanwhile the campaign's own row
//! has the state [`HIDDEN`], which queries exclude, and an id that no visible campaign can have.

use crate::{Store, StoreError};
use rusqlite::params;
use std::time::Duration;

/// The state of the row of a hidden campaign.
pub(crate) const HIDDEN: &str = "hidden";

/// The tables with rows of campaigns, each with the columns that identify a row of one campaign, and with the maximum number of
/// rows that one transaction removes.
pub(crate) const TABLES: [(&str, &str, i64); 11] = [
    ("generations", "generation", ROWS),
    ("individual_chunks", "first", CHUNKS),
    ("image_chunks", "first", CHUNKS),
    ("embedding_chunks", "checkpoint, first", CHUNKS),
    ("pictures", "place", ROWS),
    ("provenance", "result, place", ROWS),
    ("epochs", "round, epoch", ROWS),
    ("notices", "number", ROWS),
    ("taxonomies", "version", ROWS),
    ("trainings", "campaign", ROWS),
    ("labels", "entry", ROWS),
];
const ROWS: i64 = if cfg!(test) { 16 } else { 1024 };
const CHUNKS: i64 = 16;

/// Time between two transactions that remove rows.
const PAUSE: Duration = Duration::from_millis(1);

/// The id of a hidden campaign. No visible campaign has an id that begins with a dot.
pub(crate) fn hidden_id(number: i64) -> String {
    format!(".{HIDDEN}-{number}")
}

impl Store {
    /// Removes the rows that unfinished imports and deletions have left.
    pub(crate) fn remove_all_hidden(&self) -> Result<(), StoreError> {
        let numbers: Vec<i64> = self.read(|connection| {
            let mut statement = connection.prepare("SELECT number FROM campaigns WHERE state = ?1")?;
            let rows = statement.query_map([HIDDEN], |row| row.get(0))?;
            Ok(rows.collect::<Result<_, _>>()?)
        })?;
        numbers
            .into_iter()
            .try_for_each(|number| self.remove_hidden(number))
    }

    /// Removes the rows of a hidden campaign. Rows that cannot be removed now are removed when the store is next opened.
    pub(crate) fn remove_hidden_or_later(&self, number: i64) {
        if let Err(error) = self.remove_hidden(number) {
            tracing::warn!(%error, "a hidden campaign is not removed from the disk yet");
        }
    }

    /// Removes the rows of a campaign if it is still hidden: an import that could not be acknowledged may be visible. The campaign's
    /// own row is last, so that no row refers to a missing campaign.
    fn remove_hidden(&self, number: i64) -> Result<(), StoreError> {
        for (table, key, most) in TABLES {
            let some = format!(
                "DELETE FROM {table} WHERE campaign = ?1 AND ({key}) IN
                    (SELECT {key} FROM {table} WHERE campaign = ?1 LIMIT ?2)
                    AND EXISTS (SELECT 1 FROM campaigns WHERE number = ?1 AND state = ?3)"
            );
            while self.write(|transaction| Ok(transaction.execute(&some, params![number, most, HIDDEN])?))?
                > 0
            {
                // The lock of the store is not fair: without a pause, this thread would take it again before others.
                std::thread::sleep(PAUSE);
            }
        }
        self.write(|transaction| {
            let row = "DELETE FROM campaigns WHERE number = ?1 AND state = ?2";
            transaction.execute(row, params![number, HIDDEN])?;
            Ok(())
        })
    }
}
