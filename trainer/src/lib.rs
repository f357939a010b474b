//! The trainer: learns embedders from trajectory images, without labels, and writes them as ONNX checkpoints.
#![deny(missing_docs)]

pub mod architecture;
mod layers;
pub mod network;
mod real;

pub use real::Real;
