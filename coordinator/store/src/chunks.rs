//! Chunks: rows that each have the values of consecutive individuals of one campaign, column by column. Inserts of single
//! individuals would cost more than their values, in time and in bytes.
//!
//! - A chunk has at most [`MOST`] individuals and [`BYTES`] bytes of values, or one individual.
//! - The values of a column have one length and follow each other. Only pictures have different lengths: the column `ends` says
//!   where each value ends (u32, little-endian).
//! - A chunk of individuals or pictures belongs to one generation, so that a rollback deletes whole chunks. Embeddings that a move
//!   adds begin and end anywhere. Thus the chunks of different tables can have different boundaries.
//! - Chunks do not overlap, which triggers ensure (`schema`). A chunk never changes, except its novelty in a switch.

use super::{StoreError, numbers::clamped};
use rusqlite::{
    CachedStatement, Connection, Row, Statement, ToSql, Transaction, params, params_from_iter,
    types::ValueRef,
};
use std::ops::Range;

/// Maximum number of individuals in a chunk: larger chunks save little, and whoever reads one individual reads its whole chunk.
pub(super) const MOST: usize = 256;

/// Maximum number of bytes of the values in a chunk of several individuals, for the same reason.
pub(super) const BYTES: usize = 64 << 10;

/// A table of chunks.
pub(super) struct Table {
    pub(super) name: &'static str,
    /// The column of a value that all individuals of a chunk share, or the column `ends`.
    common: &'static str,
    /// The columns with a value of each individual.
    columns: &'static [&'static str],
}

/// The columns for seeds (u64), genes (f64), features of all trials (f64), novelty (f64), and verdicts of all trials (a byte each,
/// none without a judge).
pub(super) const INDIVIDUALS: Table = Table {
    name: "individual_chunks",
    common: "generation",
    columns: &["seeds", "controllers", "features", "novelty", "verdicts"],
};
/// The place of the novelty in these columns.
const NOVELTY: usize = 3;

/// The zstd frames of all trials.
pub(super) const IMAGES: Table = Table {
    name: "image_chunks",
    common: ENDS,
    columns: &["images"],
};
const ENDS: &str = "ends";

/// The embeddings (f32) of all trials.
pub(super) const EMBEDDINGS: Table = Table {
    name: "embedding_chunks",
    common: "checkpoint",
    columns: &["embeddings"],
};

/// The condition for embeddings by the campaign's checkpoint.
pub(super) const CURRENT: &str = "checkpoint = (SELECT checkpoint FROM campaigns WHERE number = ?1)";
/// The condition for embeddings by the campaign's next checkpoint.
pub(super) const NEXT: &str = "checkpoint = (SELECT next_checkpoint FROM campaigns WHERE number = ?1)";

impl Table {
    pub(super) fn writer<'t>(&self, transaction: &'t Transaction<'_>) -> rusqlite::Result<Writer<'t>> {
        let columns = self.columns.join(", ");
        let places = vec!["?"; 4 + self.columns.len()].join(", ");
        let insert = format!(
            "INSERT INTO {} (campaign, first, individuals, {}, {columns}) VALUES ({places})",
            self.name, self.common
        );
        Ok(Writer {
            insert: transaction.prepare(&insert)?,
            has_ends: self.common == ENDS,
            campaign: 0,
            common: None,
            first: 0,
            individuals: 0,
            ends: Vec::new(),
            columns: vec![Vec::new(); self.columns.len()],
        })
    }

    /// Reads those chunks of a campaign for which the SQL expression `which` is true.
    pub(super) fn reader<'c>(
        &self,
        connection: &'c Connection,
        campaign: i64,
        which: &str,
    ) -> Result<Reader<'c>, StoreError> {
        let Self {
            name,
            common,
            columns,
        } = self;
        let columns = columns.join(", ");
        // The chunk that contains the place is the last one that begins at or before it.
        let select = format!(
            "SELECT first, individuals, {common}, {columns} FROM {name}
             WHERE campaign = ?1 AND {which} AND first + individuals > ?2 AND first >= coalesce(
                (SELECT max(first) FROM {name} WHERE campaign = ?1 AND {which} AND first <= ?2), 0)
             ORDER BY first LIMIT 1"
        );
        Ok(Reader {
            select: connection.prepare_cached(&select)?,
            table: self.name,
            campaign,
            known: 0..0,
            chunk: None,
        })
    }

    /// The first individual of a chunk that begins before the chunk before it ends, if any.
    pub(super) fn overlap(
        &self,
        connection: &Connection,
        campaign: i64,
        which: &str,
    ) -> Result<Option<u64>, StoreError> {
        let query = format!(
            "SELECT min(first) FROM (SELECT first, lag(first + individuals) OVER (ORDER BY first) AS before FROM {}
                WHERE campaign = ?1 AND {which}) WHERE before > first",
            self.name
        );
        let first: Option<i64> = connection.query_row(&query, [campaign], |row| row.get(0))?;
        Ok(first.map(i64::unsigned_abs))
    }

    /// Adds the individuals of a query's rows: campaign, generation or checkpoint, place, value of each column.
    pub(super) fn fill(&self, transaction: &Transaction<'_>, query: &str) -> rusqlite::Result<()> {
        let mut writer = self.writer(transaction)?;
        let mut select = transaction.prepare(query)?;
        let mut rows = select.query([])?;
        while let Some(row) = rows.next()? {
            let values = (3..3 + self.columns.len()).map(|column| to_bytes(row, column));
            let values: Vec<Vec<u8>> = values.collect::<Result<_, _>>()?;
            writer.add(row.get(0)?, row.get(1)?, row.get(2)?, &values)?;
        }
        writer.finish()
    }
}

fn to_bytes(row: &Row<'_>, column: usize) -> rusqlite::Result<Vec<u8>> {
    Ok(match row.get_ref(column)? {
        ValueRef::Integer(value) => value.to_le_bytes().into(),
        ValueRef::Real(value) => value.to_le_bytes().into(),
        value => value.as_blob()?.to_vec(),
    })
}

/// Adds individuals to a table, a chunk at a time.
pub(super) struct Writer<'t> {
    insert: Statement<'t>,
    has_ends: bool,
    campaign: i64,
    common: Option<i64>,
    first: i64,
    individuals: usize,
    ends: Vec<u8>,
    columns: Vec<Vec<u8>>,
}

impl Writer<'_> {
    /// Adds the values of the individual at `place`. Begins another chunk if the current one is full, or if the individual does
    /// not continue it. All pictures of a chunk are from one generation.
    pub(super) fn add(
        &mut self,
        campaign: i64,
        common: Option<i64>,
        place: i64,
        values: &[impl AsRef<[u8]>],
    ) -> rusqlite::Result<()> {
        let next = self.first + self.individuals as i64;
        if (campaign, common, place) != (self.campaign, self.common, next) || !self.has_room(values) {
            self.write()?;
            (self.campaign, self.common, self.first) = (campaign, common, place);
        }
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.extend_from_slice(value.as_ref());
        }
        if self.has_ends {
            // A chunk with more bytes is one individual of more bytes than a value of SQLite can have.
            let end = u32::try_from(self.columns[0].len()).unwrap_or(u32::MAX);
            self.ends.extend(end.to_le_bytes());
        }
        self.individuals += 1;
        Ok(())
    }

    fn has_room(&self, values: &[impl AsRef<[u8]>]) -> bool {
        let fits = |(column, value): (&Vec<u8>, &[u8])| {
            self.individuals == 0 || self.has_ends || column.len() == value.len() * self.individuals
        };
        let bytes = self.columns.iter().map(Vec::len).sum::<usize>();
        let more = values.iter().map(|value| value.as_ref().len()).sum::<usize>();
        self.individuals < MOST
            && (self.individuals == 0 || bytes + more <= BYTES)
            && self
                .columns
                .iter()
                .zip(values.iter().map(AsRef::as_ref))
                .all(fits)
    }

    /// Inserts the current chunk, and begins an empty one.
    fn write(&mut self) -> rusqlite::Result<()> {
        if self.individuals == 0 {
            return Ok(());
        }
        let individuals = self.individuals as i64;
        let common: &dyn ToSql = if self.has_ends { &self.ends } else { &self.common };
        let keys: [&dyn ToSql; 4] = [&self.campaign, &self.first, &individuals, common];
        let columns = self.columns.iter().map(|column| column as &dyn ToSql);
        self.insert
            .execute(params_from_iter(keys.into_iter().chain(columns)))?;
        self.individuals = 0;
        self.ends.clear();
        self.columns.iter_mut().for_each(Vec::clear);
        Ok(())
    }

    /// Inserts the last chunk.
    pub(super) fn finish(mut self) -> rusqlite::Result<()> {
        self.write()
    }
}

/// Reads the chunks of a table, and keeps the last one.
pub(super) struct Reader<'c> {
    select: CachedStatement<'c>,
    table: &'static str,
    campaign: i64,
    /// Places that `chunk` contains, or places that no chunk contains if it is `None`.
    known: Range<u64>,
    chunk: Option<Chunk>,
}

impl Reader<'_> {
    /// The individual at `place`, if any.
    pub(super) fn at(&mut self, place: u64) -> Result<Option<Member<'_>>, StoreError> {
        self.next(&mut (place..place.saturating_add(1)))
    }

    /// The first individual in `range`, if any. Cuts the range off behind the individual.
    pub(super) fn next(&mut self, range: &mut Range<u64>) -> Result<Option<Member<'_>>, StoreError> {
        while !range.is_empty() {
            let place = range.start;
            self.seek(place)?;
            if self.chunk.is_some() {
                range.start += 1;
                return Ok(self.chunk.as_ref().map(|chunk| Member { chunk, place }));
            }
            range.start = self.known.end;
        }
        Ok(None)
    }

    /// Sets `chunk` to the chunk that contains `place`, if any. Decodes no other chunk, which could be damaged.
    fn seek(&mut self, place: u64) -> Result<(), StoreError> {
        if self.known.contains(&place) {
            return Ok(());
        }
        self.known = 0..0;
        let mut rows = self.select.query(params![self.campaign, clamped(place)])?;
        let row = rows.next()?;
        let first: Option<i64> = row.map(|row| row.get(0)).transpose()?;
        let gap_end = first.map_or(u64::MAX, |first| first.try_into().unwrap_or(0));
        let within = row.filter(|_| gap_end <= place);
        self.chunk = within.map(|row| Chunk::read(row, self.table)).transpose()?;
        // In a damaged row, the end can be too large for SQLite to compare.
        self.chunk = self.chunk.take().filter(|chunk| chunk.end() > place);
        self.known = place..self.chunk.as_ref().map_or(gap_end.max(place + 1), Chunk::end);
        Ok(())
    }
}

/// A chunk whose lengths fit each other.
#[derive(Debug, PartialEq)]
struct Chunk {
    first: u64,
    individuals: usize,
    /// Value of the column [`Table::common`], which all individuals of the chunk share; 0 for pictures.
    common: i64,
    ends: Option<Vec<usize>>,
    columns: Vec<Vec<u8>>,
}

impl Chunk {
    /// The chunk in a row of (first, individuals, common, columns ...).
    fn read(row: &Row<'_>, table: &str) -> Result<Self, StoreError> {
        let (first, individuals): (i64, i64) = (row.get(0)?, row.get(1)?);
        let damaged = |what: &str| {
            let last = first.saturating_add(individuals).saturating_sub(1);
            StoreError::damaged(format!("individuals {first} to {last}: {what} in {table}"))
        };
        let place = u64::try_from(first).map_err(|_| damaged("a negative index"))?;
        let individuals = usize::try_from(individuals).unwrap_or(0);
        if !(1..=MOST).contains(&individuals) {
            return Err(damaged("a wrong number of individuals"));
        }
        let columns = 3..row.as_ref().column_count();
        let columns = columns
            .map(|column| row.get(column))
            .collect::<Result<Vec<Vec<u8>>, _>>()?;
        let (common, ends) = match row.get_ref(2)? {
            ValueRef::Blob(ends) => (0, Some(ends_in(ends))),
            common => (common.as_i64().map_err(rusqlite::Error::from)?, None),
        };
        let is_whole = match &ends {
            Some(ends) => {
                ends.len() == individuals
                    && ends.is_sorted()
                    && columns.iter().all(|column| ends.last() == Some(&column.len()))
            }
            None => columns
                .iter()
                .all(|column| column.len().is_multiple_of(individuals)),
        };
        match is_whole {
            true => Ok(Self {
                first: place,
                individuals,
                common,
                ends,
                columns,
            }),
            false => Err(damaged("values whose lengths do not fit their number")),
        }
    }

    const fn end(&self) -> u64 {
        self.first + self.individuals as u64
    }
}

/// An individual in its chunk.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member<'a> {
    chunk: &'a Chunk,
    pub(super) place: u64,
}

impl<'a> Member<'a> {
    /// Generation or checkpoint that all individuals of the chunk share; 0 for pictures.
    pub(super) const fn common(self) -> i64 {
        self.chunk.common
    }

    /// The individual's value of each column.
    pub(super) fn values<const N: usize>(self) -> [&'a [u8]; N] {
        std::array::from_fn(|column| self.value(column))
    }

    /// The novelty of an individual.
    ///
    /// # Errors
    /// If it is not a number.
    pub(super) fn novelty(self) -> Result<f64, StoreError> {
        let novelty = self.value(NOVELTY).try_into().map(f64::from_le_bytes).ok();
        let novelty = novelty.filter(|novelty| !novelty.is_nan());
        novelty.ok_or_else(|| {
            StoreError::damaged(format!("individual {}: its novelty is not a number", self.place))
        })
    }

    /// The individual's value of a column.
    pub(super) fn value(self, column: usize) -> &'a [u8] {
        let Chunk {
            first,
            individuals,
            ends,
            columns,
            ..
        } = self.chunk;
        let (at, values) = ((self.place - first) as usize, &columns[column]);
        match ends {
            Some(ends) => &values[at.checked_sub(1).map_or(0, |before| ends[before])..ends[at]],
            None => {
                let width = values.len() / individuals;
                &values[at * width..(at + 1) * width]
            }
        }
    }
}

fn ends_in(column: &[u8]) -> Vec<usize> {
    let ends = column.as_chunks().0.iter();
    ends.map(|end| u32::from_le_bytes(*end) as usize).collect()
}

/// Number of individuals in a campaign's archive, if no chunk is missing.
pub(super) fn archive_len(connection: &Connection, campaign: i64) -> Result<u64, StoreError> {
    let mut statement = connection.prepare_cached(
        "SELECT coalesce((SELECT first + individuals FROM individual_chunks WHERE campaign = ?1
            ORDER BY first DESC LIMIT 1), 0)",
    )?;
    let len: i64 = statement.query_row([campaign], |row| row.get(0))?;
    Ok(len.unsigned_abs())
}

/// Gives the individuals of an archive, from the first on, this novelty.
pub(super) fn set_novelty(
    transaction: &Transaction<'_>,
    campaign: i64,
    novelty: &[f64],
) -> Result<(), StoreError> {
    let mut chunks = INDIVIDUALS.reader(transaction, campaign, "TRUE")?;
    let mut update = transaction
        .prepare("UPDATE individual_chunks SET novelty = ?3 WHERE campaign = ?1 AND first = ?2")?;
    let mut range = 0..novelty.len() as u64;
    while let Some(Member { chunk, .. }) = chunks.next(&mut range)? {
        let mut column = chunk.columns[NOVELTY].clone();
        for (value, novelty) in column
            .as_chunks_mut()
            .0
            .iter_mut()
            .zip(&novelty[chunk.first as usize..])
        {
            *value = novelty.to_le_bytes();
        }
        update.execute(params![campaign, clamped(chunk.first), column])?;
        range.start = chunk.end();
    }
    Ok(())
}

#[cfg(test)]
pub(crate) mod tests;
