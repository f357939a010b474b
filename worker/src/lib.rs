//! The worker: a client that takes evaluations from a coordinator and computes them with `murmuration-sim`.

pub mod client;
