//! Measures how well distances between behaviours agree with the classes that annotators gave them.
//!
//! [`Accuracy`] is the paper's measure, for any vectors. [`Summary`] has mean and spread of several figures. [`LabelledSet`] reads
//! a labelled set. Embedding images is done elsewhere.

mod grey_image;
mod labelled_set;
mod triplets;

pub use labelled_set::{LabelledSet, Swarm};
pub use triplets::{Accuracy, RANDOM, Summary, Tally};
