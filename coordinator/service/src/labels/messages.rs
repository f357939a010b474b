//! Conversions of labels and queries to and from their messages, and of their errors to statuses.

use murmuration_model::labels::{Action, Agreement, Annotator, Change, Entry, RequestId};
use murmuration_proto::{parts::parts, v1};
use murmuration_store::{LabelError, Undone};
use murmuration_swarm::Invalid;
use std::collections::BTreeSet;

/// The change for an answer; `now_ms` is the time of the change if the message has no time.
pub(super) fn change(message: v1::Answer, now_ms: u64) -> Result<Change, Invalid> {
    let time_ms = match message.time_ms {
        0 => now_ms,
        given if given <= i64::MAX.unsigned_abs() => given,
        other => return Err(Invalid::new("time_ms", other, "at most 2^63 - 1")),
    };
    Ok(Change {
        annotator: message.annotator.parse()?,
        time_ms,
        action: Action::Answer {
            index: message.index,
            answer: message.answer.parse()?,
        },
    })
}

/// Checks that the earlier entries of a repeated request are answers of the synthetic annotator.
pub(super) fn check_synthetic(before: &[Entry], request: &RequestId) -> Result<(), LabelError> {
    let synthetic = Annotator::synthetic();
    let is_own = |entry: &Entry| {
        entry.change.annotator == synthetic && matches!(entry.change.action, Action::Answer { .. })
    };
    match before.iter().all(is_own) {
        true => Ok(()),
        false => Err(LabelError::OtherRequest(request.clone())),
    }
}

/// The first number that occurs twice.
pub(super) fn repeated(numbers: &[u64]) -> Option<u64> {
    let mut seen = BTreeSet::new();
    numbers.iter().copied().find(|number| !seen.insert(*number))
}

/// The log entry of a change of classes.
pub(super) fn change_of_classes(number: u64, change: &Change) -> v1::LabelEntry {
    v1::LabelEntry::from(Entry {
        number,
        change: change.clone(),
        supersedes: None,
    })
}

/// The added entries, part by part.
pub(super) fn appended(entries: Vec<Entry>) -> impl Iterator<Item = v1::AppendLabelsResponse> {
    let entries = entries.into_iter().map(v1::LabelEntry::from);
    parts(entries, |entries| v1::AppendLabelsResponse { entries })
}

/// The undone answers and the entries that undid them, part by part.
pub(super) fn undone(undone: Vec<Undone>) -> impl Iterator<Item = v1::UndoLabelsResponse> {
    let (entries, answers): (Vec<_>, Vec<_>) = undone
        .into_iter()
        .map(|Undone { entry, answer }| (v1::LabelEntry::from(entry), v1::Label::from(answer)))
        .unzip();
    let entries = parts(entries, |entries| v1::UndoLabelsResponse {
        entries,
        ..v1::UndoLabelsResponse::default()
    });
    let answers = parts(answers, |undone| v1::UndoLabelsResponse {
        undone,
        ..v1::UndoLabelsResponse::default()
    });
    entries.chain(answers)
}

/// The agreement of two annotators, part by part.
pub(super) fn agreed(agreement: Agreement) -> impl Iterator<Item = v1::Agreement> {
    let mut first = v1::Agreement::from(agreement);
    let confusions = std::mem::take(&mut first.confusions);
    let disagreements = std::mem::take(&mut first.disagreements);
    let confusions = parts(confusions, |confusions| v1::Agreement {
        confusions,
        ..v1::Agreement::default()
    });
    let disagreements = parts(disagreements, |disagreements| v1::Agreement {
        disagreements,
        ..v1::Agreement::default()
    });
    std::iter::once(first).chain(confusions).chain(disagreements)
}
