//! The log: what people said, in the order in which they said it.

use super::{Annotator, Answer, ClassName, Colour, Shortcut};

/// An entry of the label log, before it is numbered: an answer, or a change of classes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    pub annotator: Annotator,
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
    pub action: Action,
}

/// An answer, or a change of classes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The answer to which class an individual is of. A class that there is not yet is created.
    Answer {
        /// Index of the individual in its archive.
        index: u64,
        answer: Answer,
    },
    /// Undoes the newest of the annotator's own answers that stand; what that had superseded stands again.
    Undo,
    /// Takes back the annotator's answer about an individual; nothing that it superseded stands again. The coordinator does so
    /// for individuals that are not in the archive any more.
    Withdraw {
        /// Index that the individual had.
        index: u64,
    },
    /// Adds a class, which is there also while no answer names it.
    Create {
        /// Its name, which no class that is there has.
        class: ClassName,
    },
    Rename {
        class: ClassName,
        /// Its name from now on, which no other class that is there has.
        to: ClassName,
    },
    Merge {
        /// The class that ends; its labels go to the other.
        class: ClassName,
        /// The class that goes on.
        into: ClassName,
    },
    Colour {
        class: ClassName,
        colour: Colour,
    },
    /// Ends a class: the answers that name it no longer stand.
    Delete {
        class: ClassName,
    },
    /// Gives a class a key on the keyboard; a class that has this key loses it.
    Shortcut {
        class: ClassName,
        /// Its key from now on; `None` for whichever is free.
        shortcut: Option<Shortcut>,
    },
    /// Reverts the newest change of classes that has not been reverted.
    Revert {
        /// The entry of that change.
        entry: u64,
    },
}

impl Action {
    /// The same action, with the names that it gives spelled as the paper's classes are (see [`ClassName::spelled`]).
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

/// One entry of a campaign's log; entries are never changed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Place in the log, from 0.
    pub number: u64,
    pub change: Change,
    /// The answer that no longer stands because of this entry: of an answer, the same annotator's earlier one about the same
    /// individual, if there was one; of an undo or a withdrawal, the answer that was undone or withdrawn.
    pub supersedes: Option<u64>,
}

/// Why something cannot be said; the log is as it was.
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

/// An answer that stands, with what the log says today.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Label {
    pub entry: u64,
    pub index: u64,
    pub annotator: Annotator,
    /// The answer, its class by its name of today.
    pub answer: Answer,
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
}
