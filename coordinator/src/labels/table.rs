//! Labels as CSV: `id, class, annotator, time`.
//!
//! Limits: text in and out, no files.

use super::{Annotator, Answer};
use csv::{ErrorKind, ReaderBuilder, StringRecord};
use murmuration_proto::{Invalid, v1};
use std::path::{Path, PathBuf};

const COLUMNS: [&str; 4] = ["id", "class", "annotator", "time"];

/// A file of answers, read and understood.
#[derive(Debug)]
pub struct Table {
    file: PathBuf,
    text: Vec<u8>,
    rows: Vec<Row>,
}

/// What is wrong with a file of answers: the file, its line where there is one, and what is allowed there.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct TableError(String);

/// An answer, and where in the text its row begins.
#[derive(Debug)]
struct Row {
    byte: usize,
    answer: v1::Answer,
}

/// Where the columns are; a file without the last two takes them from elsewhere.
struct Places {
    id: usize,
    class: usize,
    annotator: Option<usize>,
    time: Option<usize>,
}

impl Table {
    /// Reads the answers in the text of `file`; rows without a class are passed over. `annotator` is who gave those that do
    /// not say.
    ///
    /// # Errors
    /// Where the text is not CSV, a column or a value is missing or not allowed, or no row has a class.
    pub fn parse(file: &Path, text: Vec<u8>, annotator: Option<&Annotator>) -> Result<Self, TableError> {
        let mut table = Self {
            file: file.to_owned(),
            text,
            rows: Vec::new(),
        };
        table.rows = table.answers(annotator)?;
        if table.rows.is_empty() {
            return Err(TableError(format!("{}: no row has a class", file.display())));
        }
        Ok(table)
    }

    fn answers(&self, annotator: Option<&Annotator>) -> Result<Vec<Row>, TableError> {
        let mut reader = ReaderBuilder::new().from_reader(self.text.as_slice());
        let places = Places::of(reader.headers().map_err(|error| self.not_csv(&error))?)
            .map_err(|column| self.error(0, &format!("there is no column \"{column}\"")))?;
        let mut rows = Vec::new();
        for record in reader.into_records() {
            let record = record.map_err(|error| self.not_csv(&error))?;
            let byte = record.position().map_or(0, |position| position.byte() as usize);
            if record[places.class].trim().is_empty() {
                continue;
            }
            let answer = places.answer(&record, annotator);
            let answer = answer.map_err(|error| self.error(byte, &error))?;
            rows.push(Row { byte, answer });
        }
        Ok(rows)
    }

    /// Checks that all of them are about individuals of an archive of `len`.
    ///
    /// # Errors
    /// Names the first that is not.
    pub fn check_indices(&self, campaign: &str, len: u64) -> Result<(), TableError> {
        let beyond = self.rows.iter().find(|row| row.answer.index >= len);
        beyond.map_or(Ok(()), |row| {
            let allowed = format!("the index of one of the {len} individuals in the archive of {campaign}");
            Err(self.error(row.byte, &Invalid::new("id", row.answer.index, allowed)))
        })
    }

    /// The answers, in their order.
    #[must_use]
    pub fn into_answers(self) -> Vec<v1::Answer> {
        self.rows.into_iter().map(|row| row.answer).collect()
    }

    fn not_csv(&self, error: &csv::Error) -> TableError {
        match error.kind() {
            ErrorKind::UnequalLengths {
                pos: Some(position),
                expected_len,
                len,
            } => {
                let said = format!("{len} cells under {expected_len} names of columns");
                self.error(position.byte() as usize, &said)
            }
            _ => TableError(format!("{}: {error}", self.file.display())),
        }
    }

    /// An error about the row at `byte`, or after the empty lines there.
    fn error(&self, byte: usize, error: &dyn std::fmt::Display) -> TableError {
        let (before, rest) = self.text.split_at(byte.min(self.text.len()));
        let empty = rest.iter().take_while(|&&character| b"\r\n".contains(&character));
        let line = 1 + before
            .iter()
            .chain(empty)
            .filter(|&&character| character == b'\n')
            .count();
        TableError(format!("{}, line {line}: {error}", self.file.display()))
    }
}

impl Places {
    /// Names the column that is missing.
    fn of(columns: &StringRecord) -> Result<Self, &'static str> {
        let [id, class, annotator, time] =
            COLUMNS.map(|name| columns.iter().position(|column| column == name));
        Ok(Self {
            id: id.ok_or(COLUMNS[0])?,
            class: class.ok_or(COLUMNS[1])?,
            annotator,
            time,
        })
    }

    fn answer(&self, record: &StringRecord, annotator: Option<&Annotator>) -> Result<v1::Answer, Invalid> {
        let whole = |field: &str, text: &str| {
            let number = text.trim().parse::<u64>();
            let shown = || format!("\"{}\"", text.escape_debug());
            number.map_err(|_| Invalid::new(field, shown(), "a whole number"))
        };
        let cell = |place: Option<usize>| place.map_or("", |place| record[place].trim());
        let annotator = match (cell(self.annotator), annotator) {
            ("", Some(annotator)) => annotator.to_string(),
            ("", None) => {
                let allowed = "a name, here or with --annotator";
                return Err(Invalid::new("annotator", "nothing", allowed));
            }
            (named, _) => named.parse::<Annotator>()?.to_string(),
        };
        Ok(v1::Answer {
            index: whole("id", &record[self.id])?,
            answer: record[self.class].parse::<Answer>()?.to_string(),
            annotator,
            time_ms: match cell(self.time) {
                "" => 0,
                time => whole("time", time)?,
            },
        })
    }
}

/// Answers as a text that [`Table::parse`] understands.
///
/// # Errors
/// Where the answers cannot be written as CSV.
pub fn to_csv<'a>(answers: impl Iterator<Item = &'a v1::Answer>) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(COLUMNS)?;
    for answer in answers {
        let (index, time) = (answer.index.to_string(), answer.time_ms.to_string());
        let cells = [&index, &answer.answer, &answer.annotator, &time];
        writer.write_record(cells)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn read_text(text: &str, annotator: Option<&str>) -> Result<Table, String> {
        let annotator = annotator.map(|name| name.parse::<Annotator>().unwrap());
        let text = text.as_bytes().to_vec();
        Table::parse(Path::new("labels.csv"), text, annotator.as_ref()).map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check_refused(text: &str, said: &str) {
        let error = read_text(text, None).unwrap_err();
        assert!(error.contains(said), "{error}\nnot {said:?}");
    }

    #[test]
    fn rows_with_a_class_are_read_whatever_other_columns_there_are() {
        let table = read_text(
            "x,class,id,annotator\n1,ring,7,ana\n2,,8,\n3,\"not sure\",9, \n",
            Some("ben"),
        );
        let answers = table.unwrap().into_answers();
        let read: Vec<_> = answers
            .iter()
            .map(|answer| (answer.index, answer.answer.as_str(), answer.annotator.as_str()))
            .collect();
        assert_eq!(read, [(7, "ring", "ana"), (9, "not sure", "ben")]);
    }

    #[test]
    fn a_bad_row_is_named() {
        let head = "id,class,annotator,time\n1,ring,ana,5\n";
        check_refused(
            &format!("{head}x,ring,ana,5\n"),
            "line 3: id = \"x\": must be a whole number",
        );
        check_refused(&format!("{head}2,ring,,5\n"), "line 3: annotator = nothing");
        check_refused(&format!("{head}2,ring,ana,soon\n"), "line 3: time = \"soon\"");
        check_refused(
            &format!("{head}2,{},ana,5\n", "x".repeat(65)),
            "must be 1 to 64 characters",
        );
        check_refused(
            &format!("{head}\r\n\n2,ring\n"),
            "line 5: 2 cells under 4 names of columns",
        );
        check_refused(&format!("{head}\n2,\"a\nb\",ana,\n"), "line 4: class = \"a\\nb\"");
        check_refused("id,klass\n1,ring\n", "line 1: there is no column \"class\"");
        check_refused("id,class\n1,\n", "no row has a class");
    }

    fn answers() -> impl Strategy<Value = Vec<v1::Answer>> {
        let word = || "[a-z,\"' é]{0,8}[a-z\"]";
        let answer =
            (any::<u64>(), word(), word(), any::<u64>()).prop_map(|(index, class, annotator, time_ms)| {
                v1::Answer {
                    index,
                    answer: class.trim().to_owned(),
                    annotator: annotator.trim().to_owned(),
                    time_ms,
                }
            });
        prop::collection::vec(answer, 1..20)
    }

    proptest! {
        #[test]
        fn what_is_written_reads_back(answers in answers()) {
            let text = to_csv(answers.iter()).unwrap();
            let table = Table::parse(Path::new("labels.csv"), text, None).unwrap();
            prop_assert_eq!(table.into_answers(), answers);
        }
    }
}
