//! The trainer: learns embedders from trajectory images, without labels, and writes them as ONNX checkpoints.
#![deny(missing_docs)]

pub mod accuracy;
pub mod architecture;
mod augment;
mod lanes;
mod layers;
mod loss;
pub mod network;
pub mod onnx;
mod optimise;
pub mod pictures;
mod real;
pub mod recipe;
pub mod training;

pub use real::Real;
