//! The gradient of a batch, a chunk of images at a time on every core.
//!
//! Chunks are dealt out to a fixed number of lanes. A lane takes its chunks in order and adds up their gradients;
//! the lanes' sums are then added in order. So the result depends on the number of lanes and on the size of the
//! chunks, which are constants, and not on the number of threads; and a chunk stays in a core's cache from image to
//! gradient.

use crate::{
    network::{Network, Tape},
    real::Real,
};
use rayon::prelude::*;

/// Number of lanes, and so of threads that can be busy.
const LANES: usize = 16;

/// Buffers for a batch after the other.
#[derive(Debug)]
pub(crate) struct Lanes<T> {
    lanes: Vec<Lane<T>>,
}

#[derive(Debug, Clone)]
struct Lane<T> {
    tape: Tape<T>,
    images: Vec<T>,
    d_embeddings: Vec<T>,
    gradient: Vec<T>,
    loss: f64,
}

impl<T: Real> Lanes<T> {
    pub(crate) fn new(network: &Network<T>) -> Self {
        let lane = Lane {
            tape: Tape::default(),
            images: Vec::new(),
            d_embeddings: Vec::new(),
            gradient: vec![T::zero(); network.parameters().len()],
            loss: 0.0,
        };
        Self {
            lanes: vec![lane; LANES],
        }
    }

    /// Writes the gradient by the weights to `sum`, and returns the sum of the chunks' losses.
    ///
    /// `images` makes the images of a chunk (it is given an empty list); `loss` is given their embeddings and makes
    /// the gradient by them.
    pub(crate) fn gradient(
        &mut self,
        network: &Network<T>,
        chunks: usize,
        images: impl Fn(usize, &mut Vec<T>) + Sync,
        loss: impl Fn(usize, &[T], &mut [T]) -> f64 + Sync,
        sum: &mut [T],
    ) -> f64 {
        self.lanes.par_iter_mut().enumerate().for_each(|(first, lane)| {
            lane.gradient.fill(T::zero());
            lane.loss = 0.0;
            for chunk in (first..chunks).step_by(LANES) {
                lane.images.clear();
                images(chunk, &mut lane.images);
                let embeddings = network.forward(&lane.images, &mut lane.tape);
                lane.d_embeddings.clear();
                lane.d_embeddings.resize(embeddings.len(), T::zero());
                lane.loss += loss(chunk, embeddings, &mut lane.d_embeddings);
                network.backward(&lane.images, &mut lane.tape, &lane.d_embeddings, &mut lane.gradient);
            }
        });
        let lanes = &self.lanes;
        let piece = 1 << 14;
        sum.par_chunks_mut(piece).enumerate().for_each(|(i, sum)| {
            sum.fill(T::zero());
            for lane in lanes {
                for (sum, &value) in sum.iter_mut().zip(&lane.gradient[i * piece..]) {
                    *sum += value;
                }
            }
        });
        lanes.iter().map(|lane| lane.loss).sum()
    }
}
