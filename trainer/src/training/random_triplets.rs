//! An epoch of the paper's recipe: fresh random triplets.

use super::{
    EpochLoss, Training,
    triplets::{Triplet, learn},
};
use crate::pictures::Pictures;
use murmuration_proto::{Stream, training::RandomTriplets};
use std::sync::Arc;

pub(super) fn epoch(training: &mut Training, recipe: &RandomTriplets, stream: &mut Stream) -> EpochLoss {
    let pictures = Arc::clone(&training.pictures);
    let mut total = 0.0;
    for _ in 0..recipe.steps {
        let behaviours = training.held_out.trained_on();
        let drawn = (0..recipe.batch).map(|_| draw(&pictures, behaviours, stream));
        let triplets: Vec<Triplet> = drawn.collect();
        total += learn(training, recipe, &triplets, stream.bits());
    }
    EpochLoss {
        mean: total / recipe.steps as f64,
        triplets: (recipe.steps * recipe.batch) as u64,
    }
}

/// Two behaviours, a view of each. The positive is made of the anchor.
fn draw<'a>(pictures: &'a Pictures, behaviours: &[usize], stream: &mut Stream) -> Triplet<'a> {
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
