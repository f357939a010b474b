//! The label log: answers and changes of classes, in order.

use super::{Annotator, Answer, ClassName, Colour, Shortcut};

/// An entry of the label log, before it gets its number.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    pub annotator: Annotator,
    /// Time of the change, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
    pub action: Action,
}

#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// An answer about the class of an individual. A class that does not exist yet is created.
    Answer {
        /// Index of the individual in its archive.
        index: u64,
        answer: Answer,
    },
    /// Undoes the annotator's newest standing answer. The answer that the undone answer superseded stands again.
    Undo,
    /// Withdraws the annotator's answer about an individual. An answer that the withdrawn answer superseded does not stand again.
    /// The coordinator withdraws answers about individuals that have left the archive.
    Withdraw {
        /// Index that the individual had.
        index: u64,
    },
    /// Creates a class, which is present even while no answer names it.
    Create {
        /// Name of the new class, which no present class has.
        class: ClassName,
    },
    Rename {
        class: ClassName,
        /// New name of the class, which no other present class has.
        to: ClassName,
    },
    Merge {
        /// The class that is merged; its labels go to `into`.
        class: ClassName,
        /// The class that remains.
        into: ClassName,
    },
    Colour {
        class: ClassName,
        colour: Colour,
    },
    /// Deletes a class: the answers that name it no longer stand.
    Delete {
        class: ClassName,
    },
    /// Assigns a class a key on the keyboard, and takes the key from any other class.
    Shortcut {
        class: ClassName,
        /// The new key of the class; `None` for any free key.
        shortcut: Option<Shortcut>,
    },
    /// Reverts the newest change of classes that has not been reverted.
    Revert {
        /// The entry of the change that is reverted.
        entry: u64,
    },
}

impl Action {
    /// The same action, with its names spelled as the paper's classes (see [`ClassName::spelled`]).
    pub(super) fn spelled(self) -> Self {
        match self {
            Self::Answer {
                index,
                answer: Answer::Class(class),
            } => Self::Answer {
                index,
                answer: Answer::Class(class.spelled()),
            },
            Self::Create { class } => Self::Create {
                class: class.spelled(),
            },
            Self::Rename { class, to } => Self::Rename {
                class,
                to: to.spelled(),
            },
            other => other,
        }
    }
}

/// One entry of a campaign's log. Entries never change.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Place in the log, from 0.
    pub number: u64,
    pub change: Change,
    /// The entry of the answer that stands no more because of this entry. For an answer, it is the same annotator's earlier
    /// answer about the same individual, if any. For an undo or a withdrawal, it is the answer that was undone or withdrawn.
    pub supersedes: Option<u64>,
}

/// Why a change is refused. The log is then unchanged.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    #[error("there is no class \"{0}\": `murmuration classes` lists the classes")]
    NoClass(ClassName),
    #[error("class \"{0}\" exists already: merge the two classes, or choose another name")]
    ClassExists(ClassName),
    #[error("class \"{0}\" cannot be added: the campaign has 1,000 classes, the most that it can have")]
    TooManyClasses(ClassName),
    #[error(
        "the label log has {entries} entries, and no room for {more} more of the {most} that it can have"
    )]
    Full { entries: u64, more: usize, most: u64 },
    #[error("class \"{0}\" cannot be merged into itself")]
    IntoItself(ClassName),
    #[error(
        "entry {0} of the label log is not the newest change of classes that stands: somebody has changed a class since, or \
         reverted it already"
    )]
    NotNewestChange(u64),
    #[error("{0} has no answer to undo")]
    NothingToUndo(Annotator),
    #[error("{annotator} has no answer about individual {index} to withdraw")]
    NothingToWithdraw {
        annotator: Annotator,
        /// Index of the individual.
        index: u64,
    },
}

/// A standing answer, with current names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    pub entry: u64,
    pub index: u64,
    pub annotator: Annotator,
    /// The answer, with the current name of its class.
    pub answer: Answer,
    /// Time of the answer, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
}
