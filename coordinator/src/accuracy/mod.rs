//! How well distances between behaviours agree with classes that people gave them.
//!
//! [`Accuracy`] is the paper's measure, on any vectors; [`Labels`] reads a labelled set. What makes vectors of images
//! is elsewhere.

mod grey_image;
mod labels;
mod triplets;

pub use labels::{Labels, LabelsError};
pub use triplets::{Accuracy, RANDOM, Tally};
