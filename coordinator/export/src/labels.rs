//! The table of the label log: every entry as it was said, and which answers stand.

use crate::{
    ExportError,
    columns::{
        Described as _, TableWriter, column, number_column, numbers, open, optional, optional_column,
        text_column, texts,
    },
    digests,
};
use arrow_array::{
    ArrayRef, BooleanArray, RecordBatch, TimestampMillisecondArray,
    cast::AsArray as _,
    types::{TimestampMillisecondType, UInt64Type},
};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use murmuration_model::labels::{Entry, Labels, Preference, RequestId};
use murmuration_proto::v1::{self, label_entry::Action};
use std::{collections::BTreeSet, path::Path, sync::Arc};

/// The columns of the table.
pub(crate) fn columns() -> Schema {
    let time = DataType::Timestamp(TimeUnit::Millisecond, Some("UTC".into()));
    let nullable = |name: &str, kind| Field::new(name, kind, true);
    Schema::new(vec![
        column("entry", DataType::UInt64).about("place in the label log, from 0"),
        column("time", time).unit("milliseconds since 1970-01-01 UTC"),
        column("annotator", DataType::Utf8).about("who; `synthetic` is the rule-based judge"),
        column("action", DataType::Utf8).about(
            "answer, undo, withdraw; create, rename, merge, colour, delete or shortcut, of a class; revert; compare, withdraw \
             comparison",
        ),
        nullable("index", DataType::UInt64).about("the individual that an answer or withdrawal is about; the reference of a comparison"),
        nullable("class", DataType::Utf8)
            .about("the class as it was called then; of an answer also `not sure` or `skip`; of a comparison `left`, `right` or `neither`"),
        nullable("value", DataType::Utf8).about(
            "the new name, the class merged into, the new colour, the new key, the entry that is reverted or withdrawn, or the \
             individuals on the left and on the right",
        ),
        nullable("supersedes", DataType::UInt64)
            .about("the entry whose answer no longer stands because of this one"),
        column("request", DataType::Utf8)
            .about("entries of one request were added together; its answers are undone together"),
        column("stands", DataType::Boolean).about("whether the entry is an answer or comparison that stands"),
    ])
}

/// The name of the withdrawal of a comparison.
const WITHDRAWAL: &str = "withdraw comparison";

/// An action in four columns.
struct Row {
    action: &'static str,
    index: Option<u64>,
    class: Option<String>,
    value: Option<String>,
}

impl Row {
    fn of(action: Action) -> Self {
        let row = |action, index, class, value| Self {
            action,
            index,
            class,
            value,
        };
        match action {
            Action::Answer(answer) => row("answer", Some(answer.index), Some(answer.answer), None),
            Action::Undo(v1::Undo {}) => row("undo", None, None, None),
            Action::Withdraw(v1::Withdraw { index }) => row("withdraw", Some(index), None, None),
            Action::Create(create) => row("create", None, Some(create.class), None),
            Action::Rename(rename) => row("rename", None, Some(rename.class), Some(rename.to)),
            Action::Merge(merge) => row("merge", None, Some(merge.class), Some(merge.into)),
            Action::Colour(colour) => row("colour", None, Some(colour.class), Some(colour.colour)),
            Action::Delete(delete) => row("delete", None, Some(delete.class), None),
            Action::Shortcut(chosen) => row("shortcut", None, Some(chosen.class), Some(chosen.shortcut)),
            Action::Revert(revert) => row("revert", None, None, Some(revert.entry.to_string())),
            Action::Compare(comparison) => {
                let preference = Preference::try_from(comparison.preference()).ok();
                let asked = comparison.triple.unwrap_or_default();
                row(
                    "compare",
                    Some(asked.reference),
                    preference.map(|preference| preference.to_string()),
                    Some(format!("{} {}", asked.left, asked.right)),
                )
            }
            Action::WithdrawComparison(withdrawal) => {
                row(WITHDRAWAL, None, None, Some(withdrawal.entry.to_string()))
            }
        }
    }
}

/// The action of a row; `None` if its columns are those of no action.
fn action(name: &str, columns: (Option<u64>, Option<String>, Option<String>)) -> Option<Action> {
    Some(match (name, columns) {
        ("answer", (Some(index), Some(answer), None)) => Action::Answer(v1::Answer {
            index,
            answer,
            ..v1::Answer::default()
        }),
        ("undo", (None, None, None)) => Action::Undo(v1::Undo {}),
        ("withdraw", (Some(index), None, None)) => Action::Withdraw(v1::Withdraw { index }),
        ("create", (None, Some(class), None)) => Action::Create(v1::CreateClass { class }),
        ("rename", (None, Some(class), Some(to))) => Action::Rename(v1::RenameClass { class, to }),
        ("merge", (None, Some(class), Some(into))) => Action::Merge(v1::MergeClass { class, into }),
        ("colour", (None, Some(class), Some(colour))) => Action::Colour(v1::ColourClass { class, colour }),
        ("delete", (None, Some(class), None)) => Action::Delete(v1::DeleteClass { class }),
        ("shortcut", (None, Some(class), Some(shortcut))) => {
            Action::Shortcut(v1::ShortcutClass { class, shortcut })
        }
        ("revert", (None, None, Some(entry))) => Action::Revert(v1::RevertChange {
            entry: entry.parse().ok()?,
        }),
        ("compare", (Some(reference), Some(preference), Some(sides))) => {
            let preference: Preference = preference.parse().ok()?;
            let (left, right) = sides.split_once(' ')?;
            Action::Compare(v1::Comparison {
                triple: Some(v1::Triple {
                    reference,
                    left: left.parse().ok()?,
                    right: right.parse().ok()?,
                }),
                preference: v1::Preference::from(preference).into(),
            })
        }
        (WITHDRAWAL, (None, None, Some(entry))) => Action::WithdrawComparison(v1::ComparisonWithdrawal {
            entry: entry.parse().ok()?,
        }),
        _ => return None,
    })
}

/// The entries whose answers or comparisons stand.
fn standing(labels: &Labels) -> BTreeSet<u64> {
    let compared = labels.comparisons().map(|comparison| comparison.entry);
    labels
        .standing()
        .map(|label| label.entry)
        .chain(compared)
        .collect()
}

/// Writes the table of a log, which comes to `labels`.
pub(crate) fn write(path: &Path, log: &[(RequestId, Entry)], labels: &Labels) -> Result<(), ExportError> {
    let mut table = TableWriter::create(path, columns())?;
    let stand = standing(labels);
    for log in log.chunks(4096) {
        let entries = || log.iter().map(|(_, entry)| entry);
        let said = entries().map(|entry| v1::LabelEntry::from(entry.clone()).action.map(Row::of));
        let rows: Vec<Row> = said.flatten().collect();
        let times = entries().map(|entry| entry.change.time_ms.cast_signed());
        let times = TimestampMillisecondArray::from_iter_values(times).with_timezone("UTC");
        let stands = entries().map(|entry| Some(stand.contains(&entry.number)));
        let columns: Vec<ArrayRef> = vec![
            number_column::<UInt64Type>(entries().map(|entry| entry.number)),
            Arc::new(times),
            text_column(entries().map(|entry| Some(entry.change.annotator.as_str()))),
            text_column(rows.iter().map(|row| Some(row.action))),
            optional_column::<UInt64Type>(rows.iter().map(|row| row.index)),
            text_column(rows.iter().map(|row| row.class.as_deref())),
            text_column(rows.iter().map(|row| row.value.as_deref())),
            optional_column::<UInt64Type>(entries().map(|entry| entry.supersedes)),
            text_column(log.iter().map(|(request, _)| Some(request.as_str()))),
            Arc::new(stands.collect::<BooleanArray>()),
        ];
        table.add(columns)?;
    }
    table.finish()
}

/// Reads the table of a log of so many entries: `sink` gets them some at a time, each with whether the table says that it stands.
pub(crate) fn read(
    path: &Path,
    entries: u64,
    sink: &mut dyn FnMut(Vec<(v1::ExportedLabel, bool)>) -> Result<(), ExportError>,
) -> Result<(), ExportError> {
    for rows in open(path, digests::open(path)?, &columns(), entries)? {
        let rows = rows.map_err(|error| ExportError::damaged(path, error))?;
        sink(entries_of(path, &rows)?)?;
    }
    Ok(())
}

/// The entries in some rows.
fn entries_of(path: &Path, rows: &RecordBatch) -> Result<Vec<(v1::ExportedLabel, bool)>, ExportError> {
    let mut log = Vec::with_capacity(rows.num_rows());
    let owned = |column| texts(rows, column).map(|text| text.map(str::to_owned));
    let (entries, times) = (
        numbers::<UInt64Type>(rows, 0),
        numbers::<TimestampMillisecondType>(rows, 1),
    );
    let whose = owned(2).zip(owned(8));
    let said = owned(3)
        .zip(optional::<UInt64Type>(rows, 4))
        .zip(owned(5))
        .zip(owned(6));
    let supersedes = optional::<UInt64Type>(rows, 7);
    let stands = rows.column(9).as_boolean().iter();
    let columns = entries
        .iter()
        .zip(times)
        .zip(whose)
        .zip(said)
        .zip(supersedes)
        .zip(stands);
    for (((((&number, &time), (annotator, request)), said), supersedes), stands) in columns {
        let (((name, index), class), value) = said;
        let damaged = |what: &str| ExportError::damaged(path, format!("entry {number}: {what}"));
        let time_ms = u64::try_from(time).map_err(|_| damaged("its time is before 1970"))?;
        let annotator = annotator.unwrap_or_default();
        let mut action = action(&name.unwrap_or_default(), (index, class, value))
            .ok_or_else(|| damaged("its columns are those of no action"))?;
        if let Action::Answer(answer) = &mut action {
            (answer.time_ms, answer.annotator) = (time_ms, annotator.clone());
        }
        let entry = v1::LabelEntry {
            number,
            annotator,
            time_ms,
            supersedes,
            action: Some(action),
        };
        let label = v1::ExportedLabel {
            entry: Some(entry),
            request_id: request.unwrap_or_default(),
        };
        log.push((label, stands.unwrap_or_default()));
    }
    Ok(log)
}

/// Whether the entries that a table says stand are those that do.
pub(crate) fn check_standing(path: &Path, labels: &Labels, said: &BTreeSet<u64>) -> Result<(), ExportError> {
    match standing(labels) == *said {
        true => Ok(()),
        false => Err(ExportError::damaged(
            path,
            "its column `stands` does not follow from the others",
        )),
    }
}
