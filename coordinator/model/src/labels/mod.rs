//! Labels: an append-only log of answers about behaviours, and its current state.
//!
//! [`Labels`] is a pure function of a campaign's log: the log's entries determine the classes, the standing answers, and the
//! answers that these superseded. This module does no I/O. The store keeps the log, and the query strategies choose the next
//! behaviours for annotators.

mod agreement;
mod cells;
mod classes;
mod columns;
mod confusion_matrix;
mod current;
mod file;
mod file_error;
mod given;
mod log;
mod messages;
mod names;
mod near;
mod shortcut;
mod table;

pub use agreement::{Agreement, Confusion, Disagreement};
pub use cells::{is_formula, of_cell, to_cell};
pub use classes::class_numbers;
pub use confusion_matrix::ConfusionMatrix;
pub use current::{BrokenLog, Class, LabelDigest, Labels};
pub use file::{LabelFile, Newest, Row};
pub use file_error::LabelFileError;
pub use given::{GivenClass, given_classes};
pub use log::{Action, Change, Entry, Label, Refusal};
pub use names::{Annotator, Answer, ClassKey, ClassName, Colour, RequestId};
pub use shortcut::Shortcut;
pub use table::{ANSWER_COLUMNS, Labelled, Table, answer_row, to_csv};

#[cfg(test)]
mod tests;
