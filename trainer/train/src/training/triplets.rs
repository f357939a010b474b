//! A step of the paper's recipes: a batch of triplets, whose loss is computed per chunk.

use super::Training;
use crate::{
    augment::Augmentation,
    loss::triplets,
    network::{Network, append_image},
};
use murmuration_swarm::{PictureShape, Purpose, RandomStream, training::RandomTriplets};

/// Number of values of a chunk's forward pass. With more images in a chunk, packing a dense layer's weights costs less per image;
/// with fewer images, more values stay in a core's cache.
const CHUNK_VALUES: usize = 3 << 20;

/// Triplets in a chunk: a power of two, like the size of most batches.
fn chunk(network: &Network) -> usize {
    let most = CHUNK_VALUES / (3 * network.values_per_image());
    1 << most.max(1).ilog2()
}

/// The pictures of a triplet. If `positive` is `None`, the positive is the augmented anchor.
pub(super) struct Triplet<'a> {
    pub(super) anchor: &'a [u8],
    pub(super) positive: Option<&'a [u8]>,
    pub(super) negative: &'a [u8],
}

/// Takes one step of the optimiser on `triplets`, and returns their mean loss. `key` is the seed of the augmentations.
pub(super) fn learn(training: &mut Training, recipe: &RandomTriplets, triplets: &[Triplet], key: u64) -> f64 {
    let augmentation = Augmentation::from(training.configuration.recipe());
    let state = &mut training.state;
    let architecture = state.network.architecture();
    let (shape, dimensions) = (architecture.pictures(), architecture.dimensions());
    let at_once = chunk(&state.network);
    let total = training.shards.gradient_by_chunk(
        &state.network,
        triplets.len().div_ceil(at_once),
        |chunk, images| {
            let first = chunk * at_once;
            let triplets = &triplets[first..(first + at_once).min(triplets.len())];
            let stream = |i: usize| RandomStream::derive(key, Purpose::Augment, (first + i) as u64);
            append(triplets, shape, augmentation, stream, images);
        },
        |_, embeddings, gradient| {
            triplets::loss(embeddings, dimensions, recipe.margin, triplets.len(), gradient)
        },
        &mut training.gradient,
    );
    state.descend(&training.gradient, recipe.weight_decay);
    total / triplets.len() as f64
}

/// Appends the images of a chunk: all anchors, all positives, all negatives. `stream` returns the random stream for the i-th
/// positive's augmentation.
fn append(
    triplets: &[Triplet],
    shape: PictureShape,
    augmentation: Augmentation,
    stream: impl Fn(usize) -> RandomStream,
    images: &mut Vec<f32>,
) {
    let plain = |picture: &[u8], images: &mut Vec<f32>| {
        append_image(shape, picture, images);
    };
    for triplet in triplets {
        plain(triplet.anchor, images);
    }
    for (i, triplet) in triplets.iter().enumerate() {
        if let Some(positive) = triplet.positive {
            plain(positive, images);
            continue;
        }
        let start = images.len();
        images.resize(start + shape.bytes(), 0.0);
        augmentation.apply(triplet.anchor, shape, &mut stream(i), &mut images[start..]);
    }
    for triplet in triplets {
        plain(triplet.negative, images);
    }
}
