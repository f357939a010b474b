//! What a table of Parquet comes to in memory, as its footer and the headers of its pages say before anything of it is decoded.
//!
//! A page of some bytes can say that it has a billion values, and a text that is written once can be in every row. The library
//! decodes what a file says; so what is more than an export comes to is refused here.

use crate::thrift::Thrift;
use parquet::{
    basic::{Compression, Type},
    file::metadata::{ColumnChunkMetaData, ParquetMetaData, RowGroupMetaData},
};
use std::{fs::File, io, os::unix::fs::FileExt as _};

/// Most bytes of a footer: that of a table of 2,000 row groups has six million.
const MAX_FOOTER_BYTES: u64 = 16 << 20;
/// Most bytes that a row group comes to in memory: an export's come to half of them at most, where all numbers have four bytes.
const MAX_GROUP_BYTES: u64 = 128 << 20;
/// Most bytes of a page when it is decompressed: an export's have about one million.
const MAX_PAGE_BYTES: u64 = 16 << 20;
/// Bytes that the header of a page is looked for in.
const HEADER_BYTES: u64 = 16 << 10;
/// Bytes for each value beside its own: its place in lists, and whether it is there.
const BESIDE: u64 = 8;

/// The kinds of pages.
const DATA: i64 = 0;
const DICTIONARY: i64 = 2;
const DATA_V2: i64 = 3;
/// The encodings that an export has: the others can say more in fewer bytes.
const ENCODINGS: [i64; 4] = [PLAIN, PLAIN_DICTIONARY, RLE, RLE_DICTIONARY];
const PLAIN: i64 = 0;
const PLAIN_DICTIONARY: i64 = 2;
const RLE: i64 = 3;
const RLE_DICTIONARY: i64 = 8;

/// Checks that a file ends with a footer that can be read without allocating more than it is long.
pub(crate) fn check_footer(file: &File) -> Result<(), String> {
    let failed = |error: io::Error| error.to_string();
    let length = file.metadata().map_err(failed)?.len();
    let end = length.checked_sub(8).ok_or("it is shorter than a footer")?;
    let mut tail = [0; 8];
    file.read_exact_at(&mut tail, end).map_err(failed)?;
    let [a, b, c, d, magic @ ..] = tail;
    if magic != *b"PAR1" {
        return Err(
            "it does not end as a Parquet file does: it was cut off, or is something else".to_owned(),
        );
    }
    let footer = u64::from(u32::from_le_bytes([a, b, c, d]));
    let start = end
        .checked_sub(footer)
        .ok_or("its footer is longer than the file")?;
    if footer > MAX_FOOTER_BYTES {
        return Err(format!(
            "its footer has {footer} bytes, at most {MAX_FOOTER_BYTES} are read"
        ));
    }
    let mut bytes = vec![0; footer as usize];
    file.read_exact_at(&mut bytes, start).map_err(failed)?;
    let is_whole = Thrift::new(&bytes).skip_struct();
    is_whole.ok_or_else(|| "its footer is damaged".to_owned())
}

/// Checks that a table has so many rows, and that none of its row groups comes to more than an export's. Returns the bytes that a
/// row comes to in the row group where it comes to most, as a mean.
pub(crate) fn check(file: &File, metadata: &ParquetMetaData, rows: u64) -> Result<u64, String> {
    let length = file.metadata().map_err(|error| error.to_string())?.len();
    let (mut found, mut of_row) = (0_u64, 0_u64);
    for (place, group) in metadata.row_groups().iter().enumerate() {
        let of_group = u64::try_from(group.num_rows()).ok();
        found = of_group
            .and_then(|rows| found.checked_add(rows))
            .ok_or("a row group has a number of rows that is none")?;
        let bytes = group_bytes(file, length, group)?;
        if bytes > MAX_GROUP_BYTES {
            return Err(format!(
                "row group {place} comes to {bytes} bytes in memory, at most {MAX_GROUP_BYTES} are read"
            ));
        }
        of_row = of_row.max(bytes / of_group.unwrap_or(1).max(1));
    }
    let said = u64::try_from(metadata.file_metadata().num_rows()).ok();
    match found == rows && said == Some(rows) {
        true => Ok(of_row),
        false => Err(format!(
            "it has {found} rows, and not {rows} as the campaign says"
        )),
    }
}

fn group_bytes(file: &File, length: u64, group: &RowGroupMetaData) -> Result<u64, String> {
    let mut bytes = 0_u64;
    for column in group.columns() {
        let name = column.column_path().string();
        let of_column =
            column_bytes(file, length, column).map_err(|reason| format!("column {name}: {reason}"))?;
        bytes = bytes.saturating_add(of_column);
    }
    Ok(bytes)
}

/// What a column of a row group comes to.
fn column_bytes(file: &File, length: u64, column: &ColumnChunkMetaData) -> Result<u64, String> {
    if !matches!(
        column.compression(),
        Compression::UNCOMPRESSED | Compression::ZSTD(_)
    ) {
        return Err("it is not compressed by zstd".to_owned());
    }
    let start = column
        .dictionary_page_offset()
        .unwrap_or(column.data_page_offset());
    let range = u64::try_from(start)
        .ok()
        .zip(u64::try_from(column.compressed_size()).ok());
    let range = range.and_then(|(start, bytes)| Some((start, start.checked_add(bytes)?)));
    let Some((mut at, end)) = range.filter(|(_, end)| *end <= length) else {
        return Err("its pages are not within the file".to_owned());
    };
    let (mut values, mut uncompressed, mut dictionary) = (0_u64, 0_u64, 0_u64);
    while at < end {
        let page = page(file, at, end)?;
        if page.uncompressed > MAX_PAGE_BYTES {
            return Err(format!(
                "a page has {} bytes, at most {MAX_PAGE_BYTES} are read",
                page.uncompressed
            ));
        }
        values = values.saturating_add(page.values);
        uncompressed = uncompressed.saturating_add(page.uncompressed);
        if page.kind == DICTIONARY {
            dictionary = dictionary.saturating_add(page.uncompressed);
        }
        at = page.end;
    }
    let width = match column.column_type() {
        Type::BOOLEAN => 1,
        Type::INT32 | Type::FLOAT => 4,
        Type::INT64 | Type::DOUBLE => 8,
        // A text is at most as long as all that are written once.
        Type::BYTE_ARRAY => dictionary,
        Type::INT96 | Type::FIXED_LEN_BYTE_ARRAY => return Err("no export has values of its kind".to_owned()),
    };
    let of_values = values.saturating_mul(width.saturating_add(BESIDE));
    Ok(of_values.saturating_add(uncompressed))
}

/// What the header of a page says.
#[derive(Debug)]
struct Page {
    kind: i64,
    /// Where the next page begins.
    end: u64,
    uncompressed: u64,
    values: u64,
}

/// The page whose header is at `at`, of a column that ends at `end`.
fn page(file: &File, at: u64, end: u64) -> Result<Page, String> {
    let damaged = || "the header of a page is damaged".to_owned();
    let mut bytes = vec![0; (end - at).min(HEADER_BYTES) as usize];
    file.read_exact_at(&mut bytes, at)
        .map_err(|error| error.to_string())?;
    let mut thrift = Thrift::new(&bytes);
    let header = Header::read(&mut thrift).ok_or_else(damaged)?;
    let (uncompressed, compressed) = (header.uncompressed, header.compressed);
    let sizes = u64::try_from(uncompressed)
        .ok()
        .zip(u64::try_from(compressed).ok());
    let (uncompressed, compressed) = sizes.ok_or_else(damaged)?;
    let read = (bytes.len() - thrift.left()) as u64;
    let next = compressed.checked_add(at + read).filter(|next| *next <= end);
    let is_data = matches!(header.kind, DATA | DATA_V2);
    if is_data && !header.has_known_encoding {
        return Err("it has an encoding that no export has".to_owned());
    }
    Ok(Page {
        kind: header.kind,
        end: next.ok_or_else(damaged)?,
        uncompressed,
        values: u64::try_from(header.values).map_err(|_| damaged())?,
    })
}

/// The fields of a page's header that its sizes follow from.
#[derive(Debug)]
struct Header {
    kind: i64,
    uncompressed: i64,
    compressed: i64,
    values: i64,
    has_known_encoding: bool,
}

impl Header {
    fn read(thrift: &mut Thrift<'_>) -> Option<Self> {
        let mut header = Self {
            kind: DATA,
            uncompressed: 0,
            compressed: 0,
            values: 0,
            has_known_encoding: true,
        };
        let mut last = 0;
        let mut seen = Vec::new();
        while let Some(field) = thrift.field(last)? {
            // What is there twice, two readers may understand in two ways.
            if seen.contains(&field.id) {
                return None;
            }
            seen.push(field.id);
            match field.id {
                1 => header.kind = thrift.whole(field)?,
                2 => header.uncompressed = thrift.whole(field)?,
                3 => header.compressed = thrift.whole(field)?,
                // A data page, a dictionary page, and a data page of version 2, which has its encoding elsewhere.
                5 | 7 if Thrift::is_struct(field) => header.read_page(thrift, 2)?,
                8 if Thrift::is_struct(field) => header.read_page(thrift, 4)?,
                _ => thrift.skip(field)?,
            }
            last = field.id;
        }
        Some(header)
    }

    fn read_page(&mut self, thrift: &mut Thrift<'_>, encoding: i64) -> Option<()> {
        let (mut last, mut seen) = (0, Vec::new());
        while let Some(field) = thrift.field(last)? {
            if seen.contains(&field.id) {
                return None;
            }
            seen.push(field.id);
            match field.id {
                1 => self.values = self.values.max(thrift.whole(field)?),
                id if id == encoding => self.has_known_encoding &= ENCODINGS.contains(&thrift.whole(field)?),
                _ => thrift.skip(field)?,
            }
            last = field.id;
        }
        Some(())
    }
}
