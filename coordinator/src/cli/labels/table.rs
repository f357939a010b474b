//! Labels as CSV: `id, class, annotator, time`.

use super::super::CliError;
use crate::labels::{Annotator, Answer};
use csv::{ReaderBuilder, StringRecord};
use murmuration_proto::{Invalid, v1};
use std::path::Path;

const COLUMNS: [&str; 4] = ["id", "class", "annotator", "time"];

/// An answer, and the line that it comes from, from 1.
#[derive(Debug, PartialEq)]
pub(super) struct Row {
    pub(super) line: u64,
    pub(super) answer: v1::Answer,
}

/// Where the columns are; a file without the last two takes them from elsewhere.
struct Places {
    id: usize,
    class: usize,
    annotator: Option<usize>,
    time: Option<usize>,
}

/// Reads the answers of a file; rows without a class are passed over. `annotator` is who gave those that do not say.
pub(super) fn read(file: &Path, annotator: Option<&Annotator>) -> Result<Vec<Row>, CliError> {
    let refused = |error: csv::Error| CliError::Input(format!("{}: {error}", file.display()));
    let mut reader = ReaderBuilder::new().from_path(file).map_err(refused)?;
    let places = Places::of(reader.headers().map_err(refused)?).map_err(|column| {
        let said = format!("{}, line 1: there is no column \"{column}\"", file.display());
        CliError::Input(said)
    })?;
    let mut rows = Vec::new();
    for record in reader.into_records() {
        let record = record.map_err(refused)?;
        let line = record.position().map_or(0, csv::Position::line);
        if record[places.class].trim().is_empty() {
            continue;
        }
        let answer = places
            .answer(&record, annotator)
            .map_err(|error| at(file, line, &error))?;
        rows.push(Row { line, answer });
    }
    if rows.is_empty() {
        let said = format!("{}: no row has a class", file.display());
        return Err(CliError::Input(said));
    }
    Ok(rows)
}

/// An error about one line of a file.
pub(super) fn at(file: &Path, line: u64, error: &Invalid) -> CliError {
    CliError::Input(format!("{}, line {line}: {error}", file.display()))
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

/// Writes answers to a file that [`read`] understands.
pub(super) fn write<'a>(file: &Path, answers: impl Iterator<Item = &'a v1::Answer>) -> Result<(), CliError> {
    let failed = |error: csv::Error| CliError::Failed(format!("cannot write {}: {error}", file.display()));
    let mut writer = csv::Writer::from_path(file).map_err(failed)?;
    writer.write_record(COLUMNS).map_err(failed)?;
    for answer in answers {
        let (index, time) = (answer.index.to_string(), answer.time_ms.to_string());
        let cells = [&index, &answer.answer, &answer.annotator, &time];
        writer.write_record(cells).map_err(failed)?;
    }
    writer.flush().map_err(|error| CliError::unwritable(file, &error))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fs;

    fn read_text(text: &str, annotator: Option<&str>) -> Result<Vec<Row>, String> {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("labels.csv");
        fs::write(&file, text).unwrap();
        let annotator = annotator.map(|name| name.parse::<Annotator>().unwrap());
        read(&file, annotator.as_ref()).map_err(|error| error.to_string())
    }

    #[track_caller]
    fn check_refused(text: &str, said: &str) {
        let error = read_text(text, None).unwrap_err();
        assert!(error.contains(said), "{error}\nnot {said:?}");
    }

    #[test]
    fn rows_with_a_class_are_read_whatever_other_columns_there_are() {
        let rows = read_text(
            "x,class,id,annotator\n1,ring,7,ana\n2,,8,\n3,\"not sure\",9, \n",
            Some("ben"),
        )
        .unwrap();
        let read: Vec<_> = rows
            .iter()
            .map(|row| {
                let answer = &row.answer;
                (
                    row.line,
                    answer.index,
                    answer.answer.as_str(),
                    answer.annotator.as_str(),
                )
            })
            .collect();
        assert_eq!(read, [(2, 7, "ring", "ana"), (4, 9, "not sure", "ben")]);
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
        check_refused(&format!("{head}2,ring\n"), "line: 3");
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
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join("labels.csv");
            write(&file, answers.iter()).unwrap();
            let rows = read(&file, None).unwrap();
            let read: Vec<_> = rows.into_iter().map(|row| row.answer).collect();
            prop_assert_eq!(read, answers);
        }
    }
}
