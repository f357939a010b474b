//! How large a model, and what it makes, may be.

use std::ops::RangeInclusive;

/// Most bytes of a model file (64 MiB).
pub const MAX_MODEL_BYTES: usize = 64 << 20;
/// Most numbers in any value between two nodes, for each image (4 Mi).
pub const MAX_VALUE_ELEMENTS: usize = 4 << 20;
/// Most numbers in all values between nodes together, for each image (64 Mi).
pub const MAX_ELEMENTS: usize = 64 << 20;
/// Most multiplications of all nodes together, for each image (2 Gi: about a second of one core).
pub const MAX_PRODUCTS: usize = 2 << 30;
/// Most nodes of a graph.
pub const MAX_NODES: usize = 1024;
/// Dimensions that an embedding may have.
pub const EMBEDDING_DIMENSIONS: RangeInclusive<usize> = 1..=1024;
/// Sides that an image may have, in pixels.
pub const IMAGE_SIDES: RangeInclusive<usize> = 1..=1000;
