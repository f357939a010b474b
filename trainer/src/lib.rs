//! The trainer: learns embedders from trajectory images, without labels, and writes them as ONNX checkpoints.
//!
//! [`training::Training`] takes [`pictures::Pictures`] and a [`Configuration`](murmuration_proto::training::Configuration) in and is stepped an
//! epoch at a time; [`onnx::export`] makes a checkpoint of its embedder. No network, no threads of its own: it works
//! in the rayon pool that it is called in.
#![deny(missing_docs)]

pub mod accuracy;
mod augment;
pub mod bench;
pub mod kin;
mod lanes;
mod layers;
mod loss;
pub mod network;
pub mod onnx;
mod optimise;
pub mod pictures;
#[cfg(test)]
mod pytorch;
pub mod quality;
mod real;
pub mod training;

pub use real::Real;
