//! An epoch of the in-batch recipe, batch by batch. Without flattening, an epoch shows every behaviour once, in random order.
//! With flattening, an epoch has as many draws, and draws rare behaviours more often.

use super::{EpochLoss, Training};
use crate::{augment::Augmentation, loss::in_batch};
use murmuration_swarm::{
    Purpose, RandomStream,
    training::{InBatch, Recipe},
};
use rand::RngExt as _;
use rayon::prelude::*;

/// Images in a chunk.
pub(super) const CHUNK: usize = 16;

pub(super) fn epoch(training: &mut Training, recipe: &InBatch, stream: &mut RandomStream) -> EpochLoss {
    let behaviours = match &training.weights {
        Some(weights) => drawn(training.held_out.trained_on(), weights, stream),
        None => {
            let mut behaviours = training.held_out.trained_on().to_vec();
            stream.shuffle(&mut behaviours);
            behaviours
        }
    };
    let batch = recipe.batch.min(behaviours.len());
    let steps = behaviours.len() / batch;
    let mut total = 0.0;
    for (step, behaviours) in behaviours.chunks_exact(batch).enumerate() {
        let done = training.state.epoch as f64 + step as f64 / steps as f64;
        let rate = recipe.learning_rate * (1.0 - done / recipe.epochs as f64);
        training.state.schedule.set_learning_rate(rate);
        total += self::step(training, recipe, behaviours, stream);
    }
    EpochLoss {
        mean: total / steps as f64,
        triplets: (steps * batch * (batch - 1)) as u64,
    }
}

/// Draws behaviours with replacement, in proportion to their weights, as many as `behaviours` has.
fn drawn(behaviours: &[usize], weights: &[f64], stream: &mut RandomStream) -> Vec<usize> {
    let mut total = 0.0;
    let sums: Vec<f64> = behaviours
        .iter()
        .map(|&behaviour| {
            total += weights[behaviour];
            total
        })
        .collect();
    let last = behaviours.len() - 1;
    (0..behaviours.len())
        .map(|_| {
            let at = stream.random::<f64>() * total;
            behaviours[sums.partition_point(|sum| *sum <= at).min(last)]
        })
        .collect()
}

impl Training {
    /// For benchmarks: takes one step of the in-batch recipe, on the same behaviours each time. With another recipe, the function
    /// does nothing.
    pub(crate) fn step_on_first(&mut self, anchors: usize) {
        let Recipe::InBatch(recipe) = self.configuration.recipe().clone() else {
            return;
        };
        let mut behaviours = self.held_out.trained_on().to_vec();
        behaviours.truncate(anchors);
        let mut stream = RandomStream::derive(self.configuration.seed(), Purpose::Train, 0);
        step(self, &recipe, &behaviours, &mut stream);
    }
}

/// One step of the optimiser; returns the batch's loss.
fn step(training: &mut Training, recipe: &InBatch, behaviours: &[usize], stream: &mut RandomStream) -> f64 {
    let images = augmented(training, behaviours, stream);
    let state = &mut training.state;
    let dimensions = state.network.architecture().dimensions();
    let loss = training.shards.gradient_at_once(
        &state.network,
        &images,
        CHUNK,
        |embeddings, gradient| in_batch::loss(embeddings, dimensions, recipe.margin, gradient),
        &mut training.gradient,
    );
    state.descend(&training.gradient, recipe.weight_decay);
    loss
}

/// The images of a batch: an anchor of each behaviour, then a positive of each behaviour, from another view if the behaviour has
/// several.
pub(super) fn augmented(training: &Training, behaviours: &[usize], stream: &mut RandomStream) -> Vec<f32> {
    let pictures = &training.pictures;
    let (shape, views) = (pictures.shape(), pictures.views() as u64);
    let anchors: Vec<u64> = behaviours.iter().map(|_| stream.below(views)).collect();
    let others = anchors.iter().map(|view| match views {
        1 => 0,
        _ => (view + 1 + stream.below(views - 1)) % views,
    });
    let positives: Vec<u64> = others.collect();
    let key = stream.random();
    let augmentation = Augmentation::from(training.configuration.recipe());
    let mut images = vec![0.0; 2 * behaviours.len() * shape.bytes()];
    images
        .par_chunks_mut(shape.bytes())
        .enumerate()
        .for_each(|(i, image)| {
            let views = if i < behaviours.len() {
                &anchors
            } else {
                &positives
            };
            let place = i % behaviours.len();
            let picture = pictures.picture(behaviours[place], views[place] as usize);
            let mut stream = RandomStream::derive(key, Purpose::Augment, i as u64);
            augmentation.apply(picture, shape, &mut stream, image);
        });
    images
}
