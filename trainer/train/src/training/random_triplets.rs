//! An epoch of the paper's recipe: new random triplets.

use super::{
    EpochLoss, Training,
    triplets::{Triplet, learn},
};
use crate::pictures::Pictures;
use murmuration_swarm::{RandomStream, training::RandomTriplets};
use rand::RngExt as _;
use std::sync::Arc;

pub(super) fn epoch(
    training: &mut Training,
    recipe: &RandomTriplets,
    stream: &mut RandomStream,
) -> EpochLoss {
    let pictures = Arc::clone(&training.pictures);
    let mut total = 0.0;
    for _ in 0..recipe.steps {
        let behaviours = training.held_out.trained_on();
        let drawn = (0..recipe.batch).map(|_| draw(&pictures, behaviours, stream));
        let triplets: Vec<Triplet> = drawn.collect();
        total += learn(training, recipe, &triplets, stream.random());
    }
    EpochLoss {
        mean: total / recipe.steps as f64,
        triplets: (recipe.steps * recipe.batch) as u64,
    }
}

/// Draws a triplet: one view of each of two behaviours. The positive is made from the anchor.
fn draw<'a>(pictures: &'a Pictures, behaviours: &[usize], stream: &mut RandomStream) -> Triplet<'a> {
    let count = behaviours.len() as u64;
    let anchor = stream.below(count);
    let other = (anchor + 1 + stream.below(count - 1)) % count;
    let mut view = |i: u64| {
        let view = stream.below(pictures.views() as u64) as usize;
        pictures.picture(behaviours[i as usize], view)
    };
    Triplet {
        anchor: view(anchor),
        positive: None,
        negative: view(other),
    }
}
