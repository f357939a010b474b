//! Measures how well distances between behaviours agree with the classes from annotators.
//!
//! [`Accuracy`] is the paper's measure of accuracy, for any vectors. [`Summary`] has the mean and spread of several figures.
//! [`LabelledSet`] reads a labelled set. This crate does not embed images.

mod grey_image;
mod labelled_set;
mod triplets;

pub use labelled_set::{LabelledSet, Swarm};
pub use triplets::{Accuracy, RANDOM, Summary, Tally};
