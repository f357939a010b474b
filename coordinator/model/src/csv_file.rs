//! CSV files that people and other tools write: rows of cells, by the names of the columns.
//!
//! Columns may be in any order, and columns that nobody asks for are ignored. Errors name the file, the line and the column. Rows are
//! read one after another, so a file can be longer than the memory. This module reads text; it opens no files.

mod column_names;
mod lines;
mod quotes;

pub use column_names::ColumnNames;

use csv::{ErrorKind, StringRecord};
use lines::Lines;
use murmuration_swarm::{Invalid, counted, text::quoted};
use std::{
    io::Read,
    path::{Path, PathBuf},
    str::FromStr,
    sync::Arc,
};

/// Whole numbers from here on are not exact in the floating-point numbers of other tools.
pub(crate) const FIRST_INEXACT: u64 = 1 << 53;

/// Why a CSV file cannot be read.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum CsvError {
    #[error("{}: {error}", path.display())]
    Unreadable { path: PathBuf, error: String },
    #[error("{}: the file is empty; its first line must name its columns", path.display())]
    Empty { path: PathBuf },
    #[error("{}, line {line}: {problem}: save the file as UTF-8", path.display())]
    Encoding {
        path: PathBuf,
        line: u64,
        problem: &'static str,
    },
    #[error("{}, line {line}: {problem} column {column:?}; its columns are {columns}", path.display())]
    Column {
        path: PathBuf,
        line: u64,
        column: String,
        /// The text `there is no` or `there is more than one`.
        problem: &'static str,
        columns: String,
    },
    #[error("{}, line {line}: the row has {cells}, the header {columns}", path.display())]
    Uneven {
        path: PathBuf,
        line: u64,
        cells: String,
        /// Number of columns in the header, in words.
        columns: String,
    },
    #[error("{}, line 1: the columns are separated by {separator}; save the file with commas", path.display())]
    Separator { path: PathBuf, separator: &'static str },
    #[error("{}, line {line}: a cell begins with a quote but does not end with one", path.display())]
    Quote { path: PathBuf, line: u64 },
    #[error("{}, line {line}: {error}", path.display())]
    Cell {
        path: PathBuf,
        line: u64,
        /// The column, its value, and the allowed values.
        error: Invalid,
    },
}

/// The path and the columns of a file, which all its rows share.
#[derive(Debug)]
pub struct Header {
    path: PathBuf,
    /// Line of the names of the columns.
    line: u64,
    columns: StringRecord,
    names: ColumnNames,
}

/// A file whose header has been read.
pub struct CsvFile<R> {
    header: Arc<Header>,
    reader: csv::Reader<Lines<R>>,
}

/// A row of a file.
#[derive(Debug, Clone)]
pub struct CsvRow {
    header: Arc<Header>,
    line: u64,
    cells: StringRecord,
}

impl Header {
    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn has(&self, column: &str) -> bool {
        self.places(column).next().is_some()
    }

    /// The names of all columns, as the file has them.
    pub fn columns(&self) -> impl Iterator<Item = &str> {
        self.columns.iter().map(str::trim)
    }

    /// The name of a column in the file.
    pub fn name_of<'a>(&'a self, column: &'a str) -> &'a str {
        self.names.in_file(column)
    }

    /// Whether a column has another name in the file than ours.
    pub fn is_renamed(&self, column: &str) -> bool {
        self.names.names(column)
    }

    fn places<'a>(&'a self, column: &'a str) -> impl Iterator<Item = usize> + 'a {
        let name = self.name_of(column);
        let named = self
            .columns()
            .enumerate()
            .filter(move |(_, other)| *other == name);
        named.map(|(place, _)| place)
    }

    /// Checks that the file has a column.
    ///
    /// # Errors
    /// If the column is missing or repeated.
    pub fn need(&self, column: &str) -> Result<(), CsvError> {
        let problem = match self.places(column).count() {
            1 => return Ok(()),
            0 => "there is no",
            _ => "there is more than one",
        };
        Err(CsvError::Column {
            path: self.path.clone(),
            line: self.line,
            column: self.name_of(column).to_owned(),
            problem,
            columns: self.columns().collect::<Vec<_>>().join(", "),
        })
    }

    /// The separator of the columns, if it is not a comma.
    fn other_separator(&self) -> Option<&'static str> {
        let only = self.columns.get(0).filter(|_| self.columns.len() == 1)?;
        let others = [(';', "semicolons"), ('\t', "tabs")];
        let other = others.into_iter().find(|(mark, _)| only.contains(*mark));
        other.map(|(_, name)| name)
    }
}

impl<R: Read> CsvFile<R> {
    /// Reads the header of the file at `path`, whose bytes `reader` has. The file must have the columns `needed`.
    ///
    /// # Errors
    /// If the text is not CSV, or a needed column is missing or repeated.
    pub fn open(path: &Path, reader: R, needed: &[&str]) -> Result<Self, CsvError> {
        Self::open_named(path, reader, needed, ColumnNames::default())
    }

    /// As [`CsvFile::open`], for a file whose columns have the names `names`.
    ///
    /// # Errors
    /// As [`CsvFile::open`].
    pub fn open_named(path: &Path, reader: R, needed: &[&str], names: ColumnNames) -> Result<Self, CsvError> {
        let lines = Lines::new(reader);
        let mut file = Self {
            header: Arc::new(Header {
                path: path.to_owned(),
                line: 1,
                columns: StringRecord::new(),
                names: ColumnNames::default(),
            }),
            reader: csv::ReaderBuilder::new().has_headers(false).from_reader(lines),
        };
        let mut columns = StringRecord::new();
        let line = file.read(&mut columns)?;
        if file.reader.get_ref().is_utf16() {
            return Err(file.encoding(1));
        }
        let Some(line) = line else {
            let path = path.to_owned();
            return Err(CsvError::Empty { path });
        };
        file.header = Arc::new(Header {
            path: path.to_owned(),
            line,
            columns,
            names,
        });
        if let Some(separator) = file.header.other_separator() {
            let path = path.to_owned();
            return Err(CsvError::Separator { path, separator });
        }
        for column in needed.iter().copied().chain(file.header.names.named()) {
            file.header.need(column)?;
        }
        Ok(file)
    }

    pub const fn header(&self) -> &Arc<Header> {
        &self.header
    }

    /// Reads the next record and returns its line; `None` at the end of the file.
    fn read(&mut self, record: &mut StringRecord) -> Result<Option<u64>, CsvError> {
        let read = self.reader.read_record(record);
        let next = self.reader.position().line();
        // A record ends where the next one begins, so empty lines before the record do not matter.
        let within = record.iter().flat_map(str::bytes).filter(|&byte| byte == b'\n');
        let line = next.saturating_sub(1 + within.count() as u64);
        match self.reader.get_ref().unclosed() {
            Some(opened) if opened < next => {
                return Err(CsvError::Quote {
                    path: self.header.path.clone(),
                    line: opened,
                });
            }
            _ => {}
        }
        match read {
            Ok(is_record) => Ok(is_record.then_some(line)),
            Err(error) => Err(self.refused(&error, line, next)),
        }
    }

    /// The error about a record that cannot be read. The record begins in line `line`, and the next record in line `next`.
    fn refused(&self, error: &csv::Error, line: u64, next: u64) -> CsvError {
        let path = self.header.path.clone();
        match error.kind() {
            ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => CsvError::Uneven {
                path,
                line,
                cells: counted(*len, "cell"),
                columns: counted(*expected_len, "column"),
            },
            ErrorKind::Utf8 { .. } => self.encoding(next.saturating_sub(1)),
            ErrorKind::Io(error) => CsvError::Unreadable {
                path,
                error: error.to_string(),
            },
            _ => CsvError::Unreadable {
                path,
                error: error.to_string(),
            },
        }
    }

    fn encoding(&self, line: u64) -> CsvError {
        CsvError::Encoding {
            path: self.header.path.clone(),
            line,
            problem: match self.reader.get_ref().is_utf16() {
                true => "the text is UTF-16",
                false => "the text is not UTF-8",
            },
        }
    }
}

impl<R: Read> Iterator for CsvFile<R> {
    type Item = Result<CsvRow, CsvError>;

    fn next(&mut self) -> Option<Self::Item> {
        let mut cells = StringRecord::new();
        let line = self.read(&mut cells).transpose()?;
        let header = self.header.clone();
        Some(line.map(|line| CsvRow { header, line, cells }))
    }
}

impl CsvRow {
    /// The row's line in the file, from 1.
    pub const fn line(&self) -> u64 {
        self.line
    }

    pub fn header(&self) -> &Header {
        &self.header
    }

    /// The cell of a column, without spaces around it; empty if the column is missing.
    pub fn cell(&self, column: &str) -> &str {
        let place = self.header.places(column).next();
        let cell = place.and_then(|place| self.cells.get(place));
        cell.unwrap_or_default().trim()
    }

    pub fn refused(&self, error: Invalid) -> CsvError {
        CsvError::Cell {
            path: self.header.path.clone(),
            line: self.line,
            error,
        }
    }

    /// An error about a cell of the row. `allowed` describes the allowed values.
    pub fn refuse(&self, column: &str, allowed: &str) -> CsvError {
        let name = self.header.name_of(column);
        self.refused(match self.cell(column) {
            "" => Invalid::missing(name, allowed),
            text => Invalid::new(name, quoted(text), allowed),
        })
    }

    /// The whole number in a column.
    ///
    /// # Errors
    /// If the column is missing, or its value is not a whole number up to 4294967295.
    pub fn whole(&self, column: &str) -> Result<u32, CsvError> {
        self.whole_number(column, "a whole number from 0 to 4294967295")
    }

    /// The whole number in a column. Other tools write whole numbers below 2^53 with a fraction of zeros, such as `7.0`.
    ///
    /// # Errors
    /// If the column is missing, or its value is not a whole number of this type. `allowed` describes these numbers.
    pub fn whole_number<T: FromStr>(&self, column: &str, allowed: &str) -> Result<T, CsvError> {
        self.header.need(column)?;
        let number = without_zeros(self.cell(column)).parse();
        number.map_err(|_| self.refuse(column, allowed))
    }

    /// The finite number in a column.
    ///
    /// # Errors
    /// If the column is missing, or its value is not a finite number.
    pub fn finite(&self, column: &str) -> Result<f64, CsvError> {
        self.header.need(column)?;
        let number = self
            .cell(column)
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite());
        number.ok_or_else(|| self.refuse(column, "a finite number"))
    }

    /// The value in a column; `None` if the cell is empty or the column is missing.
    ///
    /// # Errors
    /// If the cell has no value of this type. `allowed` describes the allowed values.
    pub fn given<T: FromStr>(&self, column: &str, allowed: &str) -> Result<Option<T>, CsvError> {
        match self.cell(column) {
            "" => Ok(None),
            text => text.parse().map(Some).map_err(|_| self.refuse(column, allowed)),
        }
    }
}

/// Whether other tools write this text where they have no value: pandas and R, for example.
pub fn is_no_value(cell: &str) -> bool {
    let words = ["", "nan", "na", "n/a", "none", "null", "<na>"];
    words.iter().any(|word| cell.trim().eq_ignore_ascii_case(word))
}

/// The text of a whole number, without a fraction of zeros.
pub fn without_zeros(text: &str) -> &str {
    match text.split_once('.') {
        Some((whole, zeros))
            if zeros.bytes().all(|digit| digit == b'0')
                && whole.parse::<u64>().is_ok_and(|number| number < FIRST_INEXACT) =>
        {
            whole
        }
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Reads `text` in pieces of `piece` bytes; returns the cells of a column with the lines of their rows.
    fn read(text: &[u8], piece: usize) -> Result<Vec<(u64, String)>, String> {
        struct Pieces<'a>(std::slice::Chunks<'a, u8>);
        impl Read for Pieces<'_> {
            fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
                let piece = self.0.next().unwrap_or_default();
                bytes[..piece.len()].copy_from_slice(piece);
                Ok(piece.len())
            }
        }
        let rows = || -> Result<Vec<_>, CsvError> {
            let file = CsvFile::open(Path::new("t.csv"), Pieces(text.chunks(piece)), &["id", "class"])?;
            file.map(|row| row.map(|row| (row.line(), row.cell("class").to_owned())))
                .collect()
        };
        rows().map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check(text: &str, expected: Result<&[(u64, &str)], &str>) {
        for piece in [1, 2, 1000] {
            let found = read(text.as_bytes(), piece);
            let expected = expected.map(|rows| {
                let owned = rows.iter().map(|(line, cell)| (*line, (*cell).to_owned()));
                owned.collect::<Vec<_>>()
            });
            assert_eq!(found, expected.map_err(str::to_owned), "{text:?} by {piece}");
        }
    }

    #[test]
    fn rows_have_their_lines_whatever_ends_them() {
        let rows: &[_] = &[(2, "ring"), (4, "two\nlines"), (6, "clump")];
        let text = "id,class\n1,ring\n\n2,\"two\nlines\"\n 3 , clump ";
        for end in ["\n", "\r\n", "\r"] {
            check(&text.replace('\n', end), Ok(rows));
            check(&(text.replace('\n', end) + end), Ok(rows));
        }
        check("\u{feff}id,class\n1,ring\n", Ok(&[(2, "ring")]));
        check("\n\nid,class\n1,ring\n", Ok(&[(4, "ring")]));
        check("id,class", Ok(&[]));
    }

    #[test]
    fn what_is_wrong_is_named_with_its_line() {
        check(
            "",
            Err("t.csv: the file is empty; its first line must name its columns"),
        );
        check(
            "\n\r\n",
            Err("t.csv: the file is empty; its first line must name its columns"),
        );
        check(
            "id,class,id\n1,ring,2\n",
            Err("t.csv, line 1: there is more than one column \"id\"; its columns are id, class, id"),
        );
        check(
            "id,class\r1,ring\r2\r",
            Err("t.csv, line 3: the row has 1 cell, the header 2 columns"),
        );
        check(
            "id;class\n1;ring\n",
            Err("t.csv, line 1: the columns are separated by semicolons; save the file with commas"),
        );
        let unclosed = Err("t.csv, line 3: a cell begins with a quote but does not end with one");
        check("id,class\n1,ring\n2,\"clump\n3,ring\n", unclosed);
        check("id,class\n1,ring\n\"2,clump\n3,ring\n", unclosed);
        check("id,class\n1,ring\n2,\"clump\" \"x\n", unclosed);
        let long = format!("id,class\n1,{}\n", "x".repeat(2 << 20));
        check(&long, Err("t.csv: a row has more than 1048576 bytes"));
    }

    #[test]
    fn text_in_another_encoding_is_named() {
        let encoded = |words: &str, bytes: fn(u16) -> [u8; 2]| {
            let units = words.encode_utf16().flat_map(bytes);
            read(&units.collect::<Vec<_>>(), 7).unwrap_err()
        };
        let utf16 = "t.csv, line 1: the text is UTF-16: save the file as UTF-8";
        for words in ["\u{feff}id,class\n1,ring\n", "id,class\n1,ring\n"] {
            assert_eq!(encoded(words, u16::to_le_bytes), utf16);
            assert_eq!(encoded(words, u16::to_be_bytes), utf16);
        }
        assert_eq!(
            read(b"id,class\n1,ring\n2,M\xfchle\n", 7).unwrap_err(),
            "t.csv, line 3: the text is not UTF-8: save the file as UTF-8"
        );
    }

    #[test]
    fn a_whole_number_may_have_a_fraction_of_zeros() {
        let number = |cell: &str| {
            let text = format!("n\n{cell}\n");
            let mut file = CsvFile::open(Path::new("t.csv"), text.as_bytes(), &["n"]).unwrap();
            file.next()
                .unwrap()
                .unwrap()
                .whole_number::<u64>("n", "whole")
                .ok()
        };
        assert_eq!(number("7.0"), Some(7));
        assert_eq!(number("7.00"), Some(7));
        assert_eq!(number("9007199254740991.0"), Some((1 << 53) - 1));
        assert_eq!(number("18446744073709551615"), Some(u64::MAX));
        for refused in ["9007199254740992.0", "7.5", "-7.0", "7e0", "x.0", "nan"] {
            assert_eq!(number(refused), None, "{refused}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            cells in prop::collection::vec("[a-z,\"\n]{1,6}", 1..30), end in prop::sample::select(vec!["\n", "\r\n", "\r"]),
        ) {
            let mut writer = csv::WriterBuilder::new().from_writer(Vec::new());
            writer.write_record(["id", "class"]).unwrap();
            for cell in &cells {
                writer.write_record(["1", cell]).unwrap();
            }
            let text = String::from_utf8(writer.into_inner().unwrap()).unwrap();
            let rows = read(text.replace('\n', end).as_bytes(), 3).unwrap();
            let read: Vec<&str> = rows.iter().map(|(_, cell)| cell.as_str()).collect();
            let trimmed: Vec<&str> = cells.iter().map(|cell| cell.trim()).collect();
            prop_assert_eq!(read, trimmed);
        }
    }
}
