//! The log: what people said, in the order in which they said it.

use super::{Annotator, Answer, ClassName, Colour};

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
    /// Undoes the annotator's answer about an individual that is not in the archive any more; nothing that it
    /// superseded stands again.
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
    /// The answer that no longer stands because of this one: of an answer, that of the same annotator about the same
    /// individual if there was one; of an undo or a withdrawal, the one that was undone.
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
}
