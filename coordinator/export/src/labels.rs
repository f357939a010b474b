//! The table of the label log: every entry, and which answers stand.

use crate::{
    ExportError,
    columns::{Described as _, TableWriter, column, number_column, optional_column, text_column},
};
use arrow_array::{ArrayRef, BooleanArray, TimestampMillisecondArray, types::UInt64Type};
use arrow_schema::{DataType, Field, Schema, TimeUnit};
use murmuration_proto::v1::{self, label_entry::Action};
use murmuration_store::transfer::ReceivedCampaign;
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
            "answer, undo, withdraw; create, rename, merge, colour, delete or shortcut, of a class; revert",
        ),
        nullable("index", DataType::UInt64).about("the individual that an answer or withdrawal is about"),
        nullable("class", DataType::Utf8)
            .about("the class's name at that time; for an answer, also `not sure` or `skip`"),
        nullable("value", DataType::Utf8).about(
            "the new name, the class merged into, the new colour, the new key, or the entry that is reverted",
        ),
        nullable("supersedes", DataType::UInt64)
            .about("the entry whose answer no longer stands because of this one"),
        column("request", DataType::Utf8)
            .about("entries of one request were added together; its answers are undone together"),
        column("stands", DataType::Boolean).about("whether the entry is an answer that stands"),
    ])
}

/// The action of an entry of the label log, in four columns.
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
        }
    }
}

/// Writes the table of a campaign's label log.
pub(crate) fn write(path: &Path, campaign: &ReceivedCampaign) -> Result<(), ExportError> {
    let mut table = TableWriter::create(path, columns())?;
    let stand: BTreeSet<u64> = campaign.labels().standing().map(|label| label.entry).collect();
    for log in campaign.log() {
        let log = log?;
        let entries = || log.iter().map(|(_, entry)| entry);
        let message = entries().map(|entry| v1::LabelEntry::from(entry.clone()).action.map(Row::of));
        let rows: Vec<Row> = message.flatten().collect();
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
