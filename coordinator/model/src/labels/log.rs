//! The log: what people said, in the order in which they said it.

use super::{Annotator, Answer, ClassName, Colour, Preference, Shortcut, Triple};

/// What somebody says about a campaign's behaviours or classes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Change {
    /// Who.
    pub annotator: Annotator,
    /// When, milliseconds since 1970-01-01 UTC.
    pub time_ms: u64,
    /// What.
    pub action: Action,
}

/// What can be said.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Action {
    /// The answer to which class an individual is of. A class that there is not yet is created.
    Answer {
        /// Index of the individual in its archive.
        index: u64,
        /// The answer.
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
    /// Gives a class another name.
    Rename {
        /// The class.
        class: ClassName,
        /// Its name from now on, which no other class that is there has.
        to: ClassName,
    },
    /// Makes one class of two.
    Merge {
        /// The class that ends; its labels go to the other.
        class: ClassName,
        /// The class that goes on.
        into: ClassName,
    },
    /// Gives a class another colour.
    Colour {
        /// The class.
        class: ClassName,
        /// Its colour from now on.
        colour: Colour,
    },
    /// Ends a class: the answers that name it no longer stand.
    Delete {
        /// The class.
        class: ClassName,
    },
    /// Gives a class a key on the keyboard; a class that has this key loses it.
    Shortcut {
        /// The class.
        class: ClassName,
        /// Its key from now on; `None` for whichever is free.
        shortcut: Option<Shortcut>,
    },
    /// Reverts the newest change of classes that has not been reverted.
    Revert {
        /// The entry of that change.
        entry: u64,
    },
    /// The answer to which of two individuals is more like a third. An answer of the same annotator to the same question does not
    /// stand any more.
    Compare {
        /// What was asked.
        triple: Triple,
        /// The answer.
        preference: Preference,
    },
    /// Takes back the annotator's comparison of this entry; nothing that it superseded stands again. The coordinator does so for
    /// comparisons with individuals that are not in the archive any more.
    WithdrawComparison {
        /// The entry of the comparison.
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
    /// What was said.
    pub change: Change,
    /// The answer or comparison that no longer stands because of this one: of an answer, that of the same annotator about the same
    /// individual or question if there was one; of an undo or a withdrawal, the one that was undone.
    pub supersedes: Option<u64>,
}

/// Why something cannot be said; the log is as it was.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// There is no class of that name.
    #[error("there is no class \"{0}\": `murmuration classes` lists the classes")]
    NoClass(ClassName),
    /// The name is taken.
    #[error("class \"{0}\" exists already: merge the two classes, or choose another name")]
    ClassExists(ClassName),
    /// There are 1,000 classes.
    #[error("class \"{0}\" cannot be added: the campaign has 1,000 classes, the most that it can have")]
    TooManyClasses(ClassName),
    /// A class cannot be merged into itself.
    #[error("class \"{0}\" cannot be merged into itself")]
    IntoItself(ClassName),
    /// The change is not the newest one.
    #[error(
        "entry {0} of the label log is not the newest change of classes that stands: somebody has changed a class since, or \
         reverted it already"
    )]
    NotNewestChange(u64),
    /// None of the annotator's answers stands.
    #[error("{0} has no answer to undo")]
    NothingToUndo(Annotator),
    /// The annotator has said nothing about the individual.
    #[error("{annotator} has no answer about individual {index} to withdraw")]
    NothingToWithdraw {
        /// The annotator.
        annotator: Annotator,
        /// Index of the individual.
        index: u64,
    },
    /// The comparison is not the annotator's, or does not stand.
    #[error("{annotator} has no comparison in entry {entry} of the label log to withdraw")]
    NoComparison {
        /// The annotator.
        annotator: Annotator,
        /// The entry.
        entry: u64,
    },
    /// None of the annotator's comparisons stands.
    #[error("{0} has no comparison to withdraw")]
    NothingCompared(Annotator),
}
