//! The trainer: learns embedders from trajectory images, first without labels, then from what people say of them, and
//! writes them as ONNX checkpoints.
//!
//! [`training::Training`] takes [`pictures::Pictures`] and a [`Configuration`](murmuration_proto::training::Configuration) in and is stepped an
//! epoch at a time; [`onnx::export`] makes a checkpoint of its embedder. [`onnx::import`] reads one back, to be trained
//! further on [`labelled_pictures::LabelledPictures`] ([`training::FineTuning`]). They work in the rayon pool that they
//! are called in. [`client`] is the network face: it leases trainings from a coordinator and publishes what they come
//! to.
#![deny(missing_docs)]

mod augment;
pub mod bench;
pub mod client;
pub mod labelled_pictures;
mod lanes;
mod layers;
mod loss;
pub mod network;
pub mod onnx;
mod optimise;
pub mod pictures;
mod publication;
#[cfg(test)]
mod pytorch;
pub mod quality;
mod real;
pub mod training;

pub use real::Real;
