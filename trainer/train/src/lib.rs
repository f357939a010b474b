//! Trains embedders on trajectory images, first without labels, then on labels, and writes them as ONNX checkpoints.
//!
//! [`training::Training`] takes [`pictures::Pictures`] and a [`Configuration`](murmuration_swarm::training::Configuration) and
//! runs one epoch at a time. [`onnx::export`] makes a checkpoint of its embedder. [`onnx::import`] reads a checkpoint back, to
//! train its network further on [`labelled_pictures::LabelledPictures`] ([`training::FineTuning`]). All these functions use the
//! rayon pool of their caller. The network side, which leases trainings, is the crate `murmuration-trainer`.

mod augment;
pub mod bench;
pub mod labelled_pictures;
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
mod shards;
pub mod training;
mod vectors;

pub use real::Real;
