//! Conversions of labels to and from their messages.

use super::{
    Action, Agreement, Annotator, Change, Class, ClassName, Colour, Confusion, Disagreement, Entry, Label,
    Shortcut,
};
use murmuration_proto::v1;
use murmuration_swarm::Invalid;

impl TryFrom<v1::change_class_request::Change> for Action {
    type Error = Invalid;

    fn try_from(change: v1::change_class_request::Change) -> Result<Self, Invalid> {
        use v1::change_class_request::Change;
        let named = |field: &str, name: String| {
            name.parse::<ClassName>().map_err(|error| Invalid {
                field: field.to_owned(),
                ..error
            })
        };
        Ok(match change {
            Change::Create(create) => Self::Create {
                class: named("create.class", create.class)?,
            },
            Change::Rename(rename) => Self::Rename {
                class: named("rename.class", rename.class)?,
                to: named("rename.to", rename.to)?,
            },
            Change::Merge(merge) => Self::Merge {
                class: named("merge.class", merge.class)?,
                into: named("merge.into", merge.into)?,
            },
            Change::Colour(colour) => Self::Colour {
                class: named("colour.class", colour.class)?,
                colour: colour.colour.parse::<Colour>()?,
            },
            Change::Delete(delete) => Self::Delete {
                class: named("delete.class", delete.class)?,
            },
            Change::Shortcut(chosen) => Self::Shortcut {
                class: named("shortcut.class", chosen.class)?,
                shortcut: shortcut(&chosen.shortcut)?,
            },
            Change::Revert(revert) => Self::Revert { entry: revert.entry },
        })
    }
}

/// A key; `None` if the text is empty.
fn shortcut(text: &str) -> Result<Option<Shortcut>, Invalid> {
    (!text.is_empty()).then(|| text.parse()).transpose()
}

impl From<Entry> for v1::LabelEntry {
    fn from(entry: Entry) -> Self {
        use v1::label_entry::Action as Said;
        let Change {
            annotator,
            time_ms,
            action,
        } = entry.change;
        let annotator = annotator.to_string();
        let action = match action {
            Action::Answer { index, answer } => Said::Answer(v1::Answer {
                index,
                answer: answer.to_string(),
                time_ms,
                annotator: annotator.clone(),
            }),
            Action::Undo => Said::Undo(v1::Undo {}),
            Action::Withdraw { index } => Said::Withdraw(v1::Withdraw { index }),
            Action::Create { class } => Said::Create(v1::CreateClass {
                class: class.to_string(),
            }),
            Action::Rename { class, to } => Said::Rename(v1::RenameClass {
                class: class.to_string(),
                to: to.to_string(),
            }),
            Action::Merge { class, into } => Said::Merge(v1::MergeClass {
                class: class.to_string(),
                into: into.to_string(),
            }),
            Action::Colour { class, colour } => Said::Colour(v1::ColourClass {
                class: class.to_string(),
                colour: colour.to_string(),
            }),
            Action::Delete { class } => Said::Delete(v1::DeleteClass {
                class: class.to_string(),
            }),
            Action::Shortcut { class, shortcut } => Said::Shortcut(v1::ShortcutClass {
                class: class.to_string(),
                shortcut: shortcut.map_or_else(String::new, |key| key.to_string()),
            }),
            Action::Revert { entry } => Said::Revert(v1::RevertChange { entry }),
        };
        Self {
            number: entry.number,
            annotator,
            time_ms,
            supersedes: entry.supersedes,
            action: Some(action),
        }
    }
}

impl TryFrom<v1::LabelEntry> for Entry {
    type Error = Invalid;

    /// An entry of another store's log.
    fn try_from(message: v1::LabelEntry) -> Result<Self, Invalid> {
        use v1::label_entry::Action as Said;
        let class = |name: String| name.parse::<ClassName>();
        let text = message
            .action
            .ok_or_else(|| Invalid::missing("action", "a change of the log"))?;
        let action = match text {
            Said::Answer(answer) => Action::Answer {
                index: answer.index,
                answer: answer.answer.parse()?,
            },
            Said::Undo(v1::Undo {}) => Action::Undo,
            Said::Withdraw(v1::Withdraw { index }) => Action::Withdraw { index },
            Said::Create(create) => Action::Create {
                class: class(create.class)?,
            },
            Said::Rename(rename) => Action::Rename {
                class: class(rename.class)?,
                to: class(rename.to)?,
            },
            Said::Merge(merge) => Action::Merge {
                class: class(merge.class)?,
                into: class(merge.into)?,
            },
            Said::Colour(colour) => Action::Colour {
                class: class(colour.class)?,
                colour: colour.colour.parse()?,
            },
            Said::Delete(delete) => Action::Delete {
                class: class(delete.class)?,
            },
            Said::Shortcut(chosen) => Action::Shortcut {
                class: class(chosen.class)?,
                shortcut: shortcut(&chosen.shortcut)?,
            },
            Said::Revert(revert) => Action::Revert { entry: revert.entry },
        };
        if message.time_ms > i64::MAX.unsigned_abs() {
            return Err(Invalid::new("time_ms", message.time_ms, "at most 2^63 - 1"));
        }
        Ok(Self {
            number: message.number,
            change: Change {
                annotator: Annotator::known(&message.annotator)?,
                time_ms: message.time_ms,
                action,
            },
            supersedes: message.supersedes,
        })
    }
}

impl From<Label> for v1::Label {
    fn from(label: Label) -> Self {
        Self {
            entry: label.entry,
            answer: Some(v1::Answer {
                index: label.index,
                answer: label.answer.to_string(),
                time_ms: label.time_ms,
                annotator: label.annotator.to_string(),
            }),
        }
    }
}

impl From<Class> for v1::LabelClass {
    fn from(class: Class) -> Self {
        Self {
            name: class.name.to_string(),
            colour: class.colour.to_string(),
            shortcut: class.shortcut.map_or_else(String::new, |key| key.to_string()),
            labels: class.labels,
            near: class.near.iter().map(ToString::to_string).collect(),
        }
    }
}

impl From<Agreement> for v1::Agreement {
    fn from(agreement: Agreement) -> Self {
        let confusion = |confusion: Confusion| v1::Confusion {
            first: confusion.first.to_string(),
            second: confusion.second.to_string(),
            individuals: confusion.individuals,
        };
        let disagreement = |disagreement: Disagreement| v1::Disagreement {
            index: disagreement.index,
            first: disagreement.first.to_string(),
            second: disagreement.second.to_string(),
        };
        Self {
            both: agreement.both,
            agreed: agreement.agreed,
            kappa: agreement.kappa,
            confusions: agreement.confusions.into_iter().map(confusion).collect(),
            disagreements: agreement.disagreements.into_iter().map(disagreement).collect(),
        }
    }
}
