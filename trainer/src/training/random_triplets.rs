//! An epoch of the paper's recipe: fresh random triplets, whose loss each chunk has for itself.

use super::{EpochLoss, Training};
use crate::{augment::Augmentation, loss::triplets, network::scaled, pictures::Pictures};
use murmuration_proto::{Purpose, Stream, training::RandomTriplets};
use std::sync::Arc;

/// Triplets in a chunk.
pub(super) const CHUNK: usize = 64;

pub(super) fn epoch(training: &mut Training, recipe: &RandomTriplets, stream: &mut Stream) -> EpochLoss {
    let mut total = 0.0;
    for _ in 0..recipe.steps {
        total += step(training, recipe, stream);
    }
    EpochLoss {
        mean: total / recipe.steps as f64,
        triplets: (recipe.steps * recipe.batch) as u64,
    }
}

/// A step on random triplets of the pictures; returns their mean loss.
fn step(training: &mut Training, recipe: &RandomTriplets, stream: &mut Stream) -> f64 {
    let pictures = &*Arc::clone(&training.pictures);
    let behaviours = training.held_out.trained_on();
    let pairs: Vec<Pair> = (0..recipe.batch)
        .map(|_| Pair::draw(behaviours, pictures.views(), stream))
        .collect();
    let batch = Batch {
        pictures,
        pairs: &pairs,
        augmentation: Augmentation::from(training.configuration.recipe()),
        key: stream.bits(),
    };
    learn(training, recipe, |chunk, images| batch.append(chunk, images))
}

/// One step of the optimiser on `batch` triplets, whose images `images` appends a chunk at a time: all anchors, all
/// positives, all negatives. Returns their mean loss.
pub(super) fn learn(
    training: &mut Training,
    recipe: &RandomTriplets,
    images: impl Fn(usize, &mut Vec<f32>) + Sync,
) -> f64 {
    let state = &mut training.state;
    let dimensions = state.network.architecture().dimensions();
    let total = training.lanes.gradient_by_chunk(
        &state.network,
        recipe.batch.div_ceil(CHUNK),
        images,
        |_, embeddings, gradient| {
            triplets::loss(embeddings, dimensions, recipe.margin, recipe.batch, gradient)
        },
        &mut training.gradient,
    );
    state.descend(&training.gradient, recipe.weight_decay);
    total / recipe.batch as f64
}

/// What a triplet is made of, each a behaviour and one of its views. The positive is made of the anchor.
struct Pair {
    anchor: (usize, usize),
    negative: (usize, usize),
}

impl Pair {
    fn draw(behaviours: &[usize], views: usize, stream: &mut Stream) -> Self {
        let count = behaviours.len() as u64;
        let anchor = stream.below(count);
        let other = (anchor + 1 + stream.below(count - 1)) % count;
        let mut view = || stream.below(views as u64) as usize;
        let [anchor, negative] = [anchor, other].map(|i| behaviours[i as usize]);
        Self {
            anchor: (anchor, view()),
            negative: (negative, view()),
        }
    }
}

struct Batch<'a> {
    pictures: &'a Pictures,
    pairs: &'a [Pair],
    augmentation: Augmentation,
    /// Seed of the augmentations.
    key: u64,
}

impl Batch<'_> {
    /// Appends the images of a chunk: all anchors, all positives, all negatives.
    fn append(&self, chunk: usize, images: &mut Vec<f32>) {
        let first = chunk * CHUNK;
        let pairs = &self.pairs[first..(first + CHUNK).min(self.pairs.len())];
        let side = self.pictures.side();
        let plain = |(behaviour, view)| {
            self.pictures
                .picture(behaviour, view)
                .iter()
                .map(|&grey| scaled::<f32>(grey))
        };
        images.extend(pairs.iter().flat_map(|pair| plain(pair.anchor)));
        for (i, pair) in pairs.iter().enumerate() {
            let start = images.len();
            images.resize(start + side * side, 0.0);
            let mut stream = Stream::derive(self.key, Purpose::Augment, (first + i) as u64);
            let picture = self.pictures.picture(pair.anchor.0, pair.anchor.1);
            self.augmentation
                .apply(picture, side, &mut stream, &mut images[start..]);
        }
        images.extend(pairs.iter().flat_map(|pair| plain(pair.negative)));
    }
}
