//! How an embedder is trained, as written in campaign files and checkpoints: the network's layers, the recipe and all its
//! numbers. The types are only data; the `trainer` crate trains networks.

mod architecture;
mod configuration;
mod labelled_recipe;
mod network;
mod numbers;
mod recipe;
#[cfg(test)]
mod texts;
mod unlabelled_recipe;

pub use architecture::{Architecture, ArchitectureError, Layer, Shape, parameters};
pub use configuration::{Configuration, ConfigurationError};
pub use labelled_recipe::{Labelled, PaperLabelled};
pub use recipe::Recipe;
pub use unlabelled_recipe::{InBatch, RandomTriplets};

use numbers::{crop, size};
