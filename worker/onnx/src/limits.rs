//! Limits on the size of a model and of its values.

use std::ops::RangeInclusive;

/// Maximum number of bytes of a model file (64 MiB).
pub const MAX_MODEL_BYTES: usize = 64 << 20;
/// Maximum number of numbers in any value between two nodes, for each image (4 Mi).
pub const MAX_VALUE_ELEMENTS: usize = 4 << 20;
/// Maximum number of numbers in all values between nodes together, for each image (64 Mi).
pub const MAX_ELEMENTS: usize = 64 << 20;
/// Maximum number of multiplications of all nodes together, for each image (2 Gi: about a second of one core).
pub const MAX_PRODUCTS: usize = 2 << 30;
/// Maximum number of nodes of a graph.
pub const MAX_NODES: usize = 1024;
/// Allowed dimensions of an embedding.
pub const EMBEDDING_DIMENSIONS: RangeInclusive<usize> = 1..=1024;
/// Allowed sides of an image, in pixels.
pub const IMAGE_SIDES: RangeInclusive<usize> = 1..=1000;
