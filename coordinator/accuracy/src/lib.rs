//! How well distances between behaviours agree with classes that people gave them.
//!
//! [`Accuracy`] is the paper's measure, on any vectors, and [`Summary`] what several of them come to; [`Labels`] reads a labelled set. What makes vectors of images
//! is elsewhere.

mod grey_image;
mod labels;
mod summary;
mod triplets;

pub use labels::{Labels, Swarm};
pub use summary::Summary;
pub use triplets::{Accuracy, RANDOM, Tally};
