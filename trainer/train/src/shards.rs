//! The gradient of a batch, computed on all cores, one chunk of images at a time.
//!
//! Chunks are distributed over a fixed number of shards. A shard takes its chunks in order and adds up their gradients. After
//! that, the shards' sums are added in order. The result depends on the number of shards and the size of chunks, which are
//! constants, but not on the number of threads.

use crate::{
    network::{Network, Room, Tape},
    real::Real,
};
use rayon::prelude::*;
use std::sync::{Mutex, PoisonError};

/// Number of shards, which is the maximum number of busy threads.
const SHARDS: usize = 16;
/// Number of weights that one task sums over the shards.
const SUMMED_AT_ONCE: usize = 1 << 14;

/// Buffers, reused from batch to batch.
#[derive(Debug)]
pub(crate) struct Shards<T> {
    shards: Vec<Shard<T>>,
    /// A workbench for each thread that has been busy at the same time as the others. A shard can take any workbench.
    workbenches: Mutex<Vec<Workbench<T>>>,
}

#[derive(Debug, Clone)]
struct Shard<T> {
    gradient: Vec<T>,
    loss: f64,
    /// A tape for each chunk. Between its forward and its backward pass, a chunk waits for the embeddings of all chunks.
    tapes: Vec<Tape<T>>,
}

/// The buffers of a thread.
#[derive(Debug)]
struct Workbench<T> {
    tape: Tape<T>,
    room: Room<T>,
    images: Vec<T>,
    d_embeddings: Vec<T>,
}

impl<T> Default for Workbench<T> {
    fn default() -> Self {
        Self {
            tape: Tape::default(),
            room: Room::default(),
            images: Vec::new(),
            d_embeddings: Vec::new(),
        }
    }
}

impl<T: Real> Shards<T> {
    pub(crate) fn new(network: &Network<T>) -> Self {
        let shard = Shard {
            gradient: vec![T::zero(); network.parameters().len()],
            loss: 0.0,
            tapes: Vec::new(),
        };
        Self {
            shards: vec![shard; SHARDS],
            workbenches: Mutex::default(),
        }
    }

    /// The gradient of a loss that is computed per chunk, so that a chunk stays in a core's cache from image to gradient. Writes
    /// the gradient with respect to the weights to `sum`, and returns the sum of the losses.
    ///
    /// `images` fills an empty list with the images of a chunk. `loss` computes the gradient with respect to the embeddings of
    /// these images.
    pub(crate) fn gradient_by_chunk(
        &mut self,
        network: &Network<T>,
        chunks: usize,
        images: impl Fn(usize, &mut Vec<T>) + Sync,
        loss: impl Fn(usize, &[T], &mut [T]) -> f64 + Sync,
        sum: &mut [T],
    ) -> f64 {
        self.for_each_lane(|first, shard, workbench| {
            shard.gradient.fill(T::zero());
            shard.loss = 0.0;
            for chunk in (first..chunks).step_by(SHARDS) {
                let Workbench {
                    tape,
                    room,
                    images: chunk_images,
                    d_embeddings,
                } = workbench;
                chunk_images.clear();
                images(chunk, chunk_images);
                let embeddings = network.forward(chunk_images, tape, room);
                d_embeddings.clear();
                d_embeddings.resize(embeddings.len(), T::zero());
                shard.loss += loss(chunk, embeddings, d_embeddings);
                network.backward(chunk_images, tape, room, d_embeddings, &mut shard.gradient);
            }
        });
        self.add_up(sum);
        self.shards.iter().map(|shard| shard.loss).sum()
    }

    /// The gradient of a loss that needs the embeddings of all `images`, in chunks of `chunk` images that wait between their
    /// forward and backward passes. Writes the gradient with respect to the weights to `sum`.
    ///
    /// `loss` computes the gradient with respect to the embeddings.
    pub(crate) fn gradient_at_once<L>(
        &mut self,
        network: &Network<T>,
        images: &[T],
        chunk: usize,
        loss: impl FnOnce(&[T], &mut [T]) -> L,
        sum: &mut [T],
    ) -> L {
        let architecture = network.architecture();
        let dimensions = architecture.dimensions();
        let images: Vec<&[T]> = images.chunks(chunk * architecture.pictures().bytes()).collect();
        self.for_each_lane(|first, shard, workbench| {
            let images = images.iter().skip(first).step_by(SHARDS);
            shard.tapes.resize_with(images.len(), Tape::default);
            for (images, tape) in images.zip(&mut shard.tapes) {
                network.forward(images, tape, &mut workbench.room);
            }
        });
        let tape = |i: usize| &self.shards[i % SHARDS].tapes[i / SHARDS];
        let embeddings: Vec<&[T]> = (0..images.len()).map(|i| tape(i).embeddings()).collect();
        let embeddings = embeddings.concat();
        let mut d_embeddings = vec![T::zero(); embeddings.len()];
        let loss = loss(&embeddings, &mut d_embeddings);
        let d_embeddings: Vec<&[T]> = d_embeddings.chunks(chunk * dimensions).collect();
        self.for_each_lane(|first, shard, workbench| {
            shard.gradient.fill(T::zero());
            let chunks = images.iter().zip(&d_embeddings).skip(first).step_by(SHARDS);
            for ((images, d_embeddings), tape) in chunks.zip(&mut shard.tapes) {
                network.backward(
                    images,
                    tape,
                    &mut workbench.room,
                    d_embeddings,
                    &mut shard.gradient,
                );
            }
        });
        self.add_up(sum);
        loss
    }

    /// Calls `work` for every shard, with the shard's number and a thread's buffers.
    fn for_each_lane(&mut self, work: impl Fn(usize, &mut Shard<T>, &mut Workbench<T>) + Sync) {
        let workbenches = &self.workbenches;
        let free = || workbenches.lock().unwrap_or_else(PoisonError::into_inner);
        self.shards
            .par_iter_mut()
            .enumerate()
            .for_each(|(number, shard)| {
                let mut workbench = free().pop().unwrap_or_default();
                work(number, shard, &mut workbench);
                free().push(workbench);
            });
    }

    /// Adds the gradients of the shards, in the order of the shards, and writes the result to `sum`.
    fn add_up(&self, sum: &mut [T]) {
        sum.par_chunks_mut(SUMMED_AT_ONCE)
            .enumerate()
            .for_each(|(i, sum)| {
                sum.fill(T::zero());
                for shard in &self.shards {
                    for (sum, &value) in sum.iter_mut().zip(&shard.gradient[i * SUMMED_AT_ONCE..]) {
                        *sum += value;
                    }
                }
            });
    }
}
