//! Labels and queries as the messages that carry them, and their errors as statuses.

use crate::{
    labels::{
        Action, Agreement, Change, Class, ClassName, Colour, Confusion, Disagreement, Entry, Label, Labels,
        Refusal,
    },
    queries::{Asked, Holder, Query, QueryError, Wish},
    space::SpaceError,
    store::{LabelError, Undone},
};
use murmuration_proto::{Invalid, parts::parts, v1};
use tonic::Status;

/// Most queries that somebody holds at once.
const MAX_QUERIES: u32 = 100;
/// Most characters of a window's name.
const MAX_SESSION: usize = 64;

/// What an answer says; `now_ms` is when, unless it tells.
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

/// What was added, part by part.
pub(super) fn appended(entries: Vec<Entry>) -> impl Iterator<Item = v1::AppendLabelsResponse> {
    let entries = entries.into_iter().map(v1::LabelEntry::from);
    parts(entries, |entries| v1::AppendLabelsResponse { entries })
}

/// What was taken back, by what, part by part.
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

/// The answers that stand, part by part.
pub(super) fn listed(labels: &Labels) -> impl Iterator<Item = v1::ListLabelsResponse> + use<> {
    let digest = v1::ListLabelsResponse {
        digest: labels.digest().to_string(),
        ..v1::ListLabelsResponse::default()
    };
    let labels: Vec<v1::Label> = labels.standing().map(Into::into).collect();
    let labels = parts(labels, |labels| v1::ListLabelsResponse {
        labels,
        ..v1::ListLabelsResponse::default()
    });
    std::iter::once(digest).chain(labels)
}

/// How far two annotators agree, part by part.
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
        })
    }
}

impl TryFrom<v1::NextQueriesRequest> for Wish {
    type Error = Invalid;

    fn try_from(message: v1::NextQueriesRequest) -> Result<Self, Invalid> {
        let strategy = message.strategy().try_into()?;
        if !(1..=MAX_QUERIES).contains(&message.count) {
            let allowed = format!("a whole number from 1 to {MAX_QUERIES}");
            return Err(Invalid::new("count", message.count, allowed));
        }
        if message.session.chars().count() > MAX_SESSION {
            let allowed = format!("at most {MAX_SESSION} characters");
            return Err(Invalid::new("session", "more", allowed));
        }
        if message.again.len() > MAX_QUERIES as usize {
            let allowed = format!("at most {MAX_QUERIES} individuals");
            return Err(Invalid::new("again", message.again.len(), allowed));
        }
        Ok(Self {
            holder: Holder {
                annotator: message.annotator.parse()?,
                session: message.session,
            },
            strategy,
            agreement: message.agreement,
            count: message.count as usize,
            again: message.again.into_iter().map(|index| index as usize).collect(),
        })
    }
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
            labels: class.labels,
            near: class.near.iter().map(ToString::to_string).collect(),
        }
    }
}

impl From<Asked> for v1::NextQueriesResponse {
    fn from(asked: Asked) -> Self {
        let query = |query: Query| v1::Query {
            index: query.index as u64,
            reason: query.reason.to_string(),
        };
        Self {
            queries: asked.queries.into_iter().map(query).collect(),
            answered: asked.answered,
            own: asked.own,
            synthetic: asked.synthetic,
            individuals: asked.individuals,
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

impl From<LabelError> for Status {
    fn from(error: LabelError) -> Self {
        let said = error.to_string();
        match error {
            LabelError::Store(error) => error.into(),
            LabelError::OtherRequest(_) | LabelError::Refused(Refusal::ClassExists(_)) => {
                Self::already_exists(said)
            }
            LabelError::Refused(Refusal::NoClass(_)) => Self::not_found(said),
            LabelError::Refused(Refusal::IntoItself(_)) => Self::invalid_argument(said),
            LabelError::Refused(Refusal::TooManyClasses(_)) => Self::resource_exhausted(said),
            LabelError::Refused(Refusal::NothingToUndo(_) | Refusal::NothingToWithdraw { .. }) => {
                Self::failed_precondition(said)
            }
        }
    }
}

impl From<QueryError> for Status {
    fn from(error: QueryError) -> Self {
        let said = error.to_string();
        match error {
            QueryError::Store(error) => error.into(),
            QueryError::Space(SpaceError::Store(error)) => error.into(),
            QueryError::Space(SpaceError::Misfit(_)) => Self::internal(said),
            QueryError::Space(SpaceError::Interrupted(_)) => Self::unavailable(said),
            QueryError::Broken => Self::internal(said),
        }
    }
}
