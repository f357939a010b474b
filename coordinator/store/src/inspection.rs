//! Inspection of a database whose rows may be damaged: no query relies on one row to read another row.

use super::{
    Store, StoreError,
    campaigns::number_of,
    chunks::{CURRENT, EMBEDDINGS, IMAGES, INDIVIDUALS, NEXT},
    hidden::HIDDEN,
    labels, open,
};
use murmuration_model::{CampaignId, labels::Labels};
use murmuration_swarm::counted;
use rusqlite::{Connection, OpenFlags, params};
use std::path::Path;

/// Maximum number of faults of one kind that are named.
const MOST_NAMED: usize = 20;

impl Store {
    /// The first faults that SQLite finds in the structure of the database; empty if the database is sound.
    ///
    /// # Errors
    /// If the search for faults fails.
    pub fn faults(&self) -> Result<Vec<String>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare(&format!("PRAGMA integrity_check({MOST_NAMED})"))?;
            let mut faults = Vec::new();
            for expected in statement.query_map([], |row| row.get::<_, String>(0))? {
                match expected {
                    Ok(expected) if expected == "ok" => {}
                    Ok(expected) => faults.push(expected.replace('\n', " ")),
                    // Keeps the faults found before the error.
                    Err(error) => {
                        faults.push(error.to_string());
                        break;
                    }
                }
            }
            Ok(faults)
        })
    }

    /// References to rows that do not exist, by table.
    ///
    /// # Errors
    /// If the tables cannot be read.
    pub(crate) fn dangling(&self) -> Result<Vec<String>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare(
                "SELECT \"table\", parent, count(*) FROM pragma_foreign_key_check GROUP BY 1, 2 ORDER BY 1, 2",
            )?;
            let rows = statement.query_map([], |row| {
                let (table, parent, count): (String, String, i64) = (row.get(0)?, row.get(1)?, row.get(2)?);
                let rows = counted(count.unsigned_abs(), "row");
                let refer = if count == 1 { "refers" } else { "refer" };
                Ok(format!("{table}: {rows} {refer} to missing rows of {parent}"))
            })?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
    }

    /// The ids of the campaigns, oldest first, even if the rest of their rows cannot be read.
    ///
    /// # Errors
    /// If not even the ids can be read.
    pub fn campaign_ids(&self) -> Result<Vec<CampaignId>, StoreError> {
        self.read(|connection| {
            let mut statement =
                connection.prepare("SELECT id FROM campaigns WHERE state <> ?1 ORDER BY number")?;
            let rows = statement.query_map([HIDDEN], |row| Ok(CampaignId::from_store(row.get(0)?)))?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
    }

    /// An individual of the archive that is in two chunks of a table, and the name of the table, if any.
    ///
    /// # Errors
    /// If the chunks cannot be read.
    pub(crate) fn overlap(&self, campaign: &CampaignId) -> Result<Option<(u64, &'static str)>, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let of_embeddings = [(EMBEDDINGS, CURRENT), (EMBEDDINGS, NEXT)];
            for (table, which) in [(INDIVIDUALS, "TRUE"), (IMAGES, "TRUE")]
                .into_iter()
                .chain(of_embeddings)
            {
                if let Some(place) = table.overlap(connection, number, which)? {
                    return Ok(Some((place, table.name)));
                }
            }
            Ok(None)
        })
    }

    /// Number of entries, from the beginning of a campaign's label log, that can be read and follow from each other.
    ///
    /// # Errors
    /// If the campaign does not exist.
    pub(crate) fn readable_labels(&self, campaign: &CampaignId) -> Result<u64, StoreError> {
        self.read(|connection| {
            let number = number_of(connection, campaign)?;
            let mut labels = Labels::default();
            loop {
                let next = labels.entries();
                let entry = labels::entries(
                    connection,
                    "WHERE campaign = ?1 AND entry = ?2",
                    params![number, next as i64],
                );
                let entry = entry.unwrap_or_default();
                if entry.is_empty() || labels.follow(entry).is_err() {
                    return Ok(next);
                }
            }
        })
    }

    /// Copies the database, as of one instant, into the file `path`, which is on disk when this returns. Another process may
    /// write the database meanwhile.
    ///
    /// # Errors
    /// If the database cannot be read, or the file cannot be written.
    pub(crate) fn copy_to(&self, path: &Path) -> Result<(), StoreError> {
        let named = |source| StoreError::from_sqlite(source, path);
        let flags = OpenFlags::SQLITE_OPEN_READ_WRITE | OpenFlags::SQLITE_OPEN_CREATE;
        let mut copy = Connection::open_with_flags(path, flags).map_err(named)?;
        self.read(|connection| open::copy_whole(connection, &mut copy).map_err(named))?;
        copy.close().map_err(|(_, source)| named(source))
    }
}
