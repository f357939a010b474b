//! How an embedder is to be trained, as campaign files and checkpoints say it: the network's layers, the recipe and
//! every number of it. Data alone; the `trainer` does what it says.

mod architecture;
mod configuration;
mod labelled_recipe;
mod recipe;
mod unlabelled_recipe;

pub use architecture::{Architecture, ArchitectureError, Layer, Shape, parameters};
pub use configuration::{Configuration, ConfigurationError, NetworkSettings, Settings};
pub use labelled_recipe::{Labelled, PaperLabelled};
pub use recipe::Recipe;
pub use unlabelled_recipe::{InBatch, RandomTriplets};
