//! Compares whole networks with PyTorch, in f64. `tests/fixtures/pytorch.py` computed the expected numbers.

use crate::{
    loss::{in_batch, triplets},
    network::Network,
    onnx::channels_first,
    optimise::Adam,
    pictures::tests::grey,
    shards::Shards,
};
use murmuration_swarm::training::{Architecture, Layer, Shape};
use serde::Deserialize;

/// PyTorch's results for one step.
#[derive(Deserialize)]
struct Step {
    embeddings: Vec<f64>,
    loss: f64,
    /// Every 29th number of the gradient, with the weights in PyTorch's order.
    gradient: Vec<f64>,
    /// Every 29th weight after one step of Adam, in PyTorch's order.
    after: Vec<f64>,
}

#[derive(Deserialize)]
struct Fixture {
    paper: Step,
    compact: Step,
}

const EVERY: usize = 29;
const PICTURES: usize = 24;

fn fixture() -> Fixture {
    serde_json::from_str(include_str!("../tests/fixtures/pytorch.json")).unwrap()
}

fn noise(count: usize) -> Vec<f64> {
    let noise = |i: u32| {
        let first = (i + 1).wrapping_mul(2_654_435_761);
        f64::from((first ^ (first >> 15)).wrapping_mul(2_246_822_519)) / f64::from(1u32 << 31) - 1.0
    };
    (0..count as u32).map(noise).collect()
}

fn pictures(side: usize) -> Vec<f64> {
    let grey = |picture: usize, i: usize| (i / (picture + 1)).pow(2) * 7 % 256;
    let pictures = (0..PICTURES).flat_map(|picture| (0..side * side).map(move |i| grey(picture, i)));
    pictures.map(|grey| grey as f64 / 255.0).collect()
}

/// Every layer with weights, with its number of rows of weights and the numbers of pixels and channels of a row.
fn rows(architecture: &Architecture) -> Vec<(Layer, usize, usize, usize)> {
    let rows = |(layer, input, _): (Layer, Shape, Shape)| match layer {
        Layer::Convolution { channels, kernel, .. } => {
            Some((layer, channels, kernel * kernel, input.channels))
        }
        Layer::Dense { units } => Some((layer, units, input.pixels(), input.channels)),
        Layer::GroupNormalisation { .. } => Some((layer, input.channels, 1, 1)),
        _ => None,
    };
    architecture.shaped_layers().filter_map(rows).collect()
}

/// The fixture's weights, in our order.
fn weights(architecture: &Architecture) -> Vec<f64> {
    let mut weights = Vec::new();
    for (layer, rows, pixels, channels) in rows(architecture) {
        let size = pixels * channels;
        if matches!(layer, Layer::GroupNormalisation { .. }) {
            weights.extend(noise(rows).iter().map(|value| value * 0.5 + 1.0));
            weights.extend(noise(rows).iter().map(|value| value * 0.5));
            continue;
        }
        let more = if matches!(layer, Layer::Convolution { .. }) {
            0.3
        } else {
            0.0
        };
        let scaled = |value: f64| (value + more) * 2.0 / (size as f64).sqrt();
        // `channels_first` with pixels and channels exchanged puts the channels last.
        weights.extend(
            channels_first(&noise(rows * size), channels, pixels)
                .into_iter()
                .map(scaled),
        );
        weights.extend(noise(rows).into_iter().map(scaled));
    }
    weights
}

/// Our weights, or gradients, in PyTorch's order.
fn in_their_order(architecture: &Architecture, ours: &[f64]) -> Vec<f64> {
    let mut theirs = Vec::new();
    let mut ours = ours;
    for (_, rows, pixels, channels) in rows(architecture) {
        let (weights, rest) = ours.split_at(rows * pixels * channels);
        let (biases, rest) = rest.split_at(rows);
        theirs.extend(channels_first(weights, pixels, channels));
        theirs.extend_from_slice(biases);
        ours = rest;
    }
    theirs
}

#[track_caller]
fn check_close(what: &str, ours: &[f64], theirs: &[f64]) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    for (i, (a, b)) in ours.iter().zip(theirs).enumerate() {
        assert!(
            (a - b).abs() < 1e-9 * b.abs().max(1.0),
            "{what} {i}: {a}, not {b}"
        );
    }
}

fn check(
    architecture: Architecture,
    expected: &Step,
    rate: f64,
    gradient_of: impl Fn(&Network<f64>, &mut Shards<f64>, &[f64], &mut [f64]) -> f64,
) {
    let mut network = Network::<f64>::initialise(architecture.clone(), 1);
    network.parameters_mut().copy_from_slice(&weights(&architecture));
    let images = pictures(architecture.pictures().side());
    let mut gradient = vec![0.0; network.parameters().len()];
    let mut shards = Shards::new(&network);
    check_close("embeddings", &network.embed_scaled(&images), &expected.embeddings);
    let loss = gradient_of(&network, &mut shards, &images, &mut gradient);
    check_close("loss", &[loss], &[expected.loss]);
    let sample = |ours: &[f64]| -> Vec<f64> {
        in_their_order(&architecture, ours)
            .into_iter()
            .step_by(EVERY)
            .collect()
    };
    check_close("gradient", &sample(&gradient), &expected.gradient);
    Adam::new(gradient.len()).step(network.parameters_mut(), &gradient, rate, 1e-2);
    check_close("weight", &sample(network.parameters()), &expected.after);
}

#[test]
fn the_papers_network_and_triplets() {
    let architecture = Architecture::paper(grey(10), 5).unwrap();
    check(
        architecture,
        &fixture().paper,
        0.08,
        |network, shards, images, gradient| {
            // The eight triplets form two chunks: triplets 0 to 4, and triplets 5 to 7.
            let chunk = |chunk: usize| if chunk == 0 { 0..5 } else { 5..8 };
            let take = |chunk_number: usize, into: &mut Vec<f64>| {
                for part in 0..3 {
                    let triplets = chunk(chunk_number);
                    into.extend_from_slice(
                        &images[(part * 8 + triplets.start) * 100..(part * 8 + triplets.end) * 100],
                    );
                }
            };
            let total = shards.gradient_by_chunk(
                network,
                2,
                take,
                |_, embeddings, gradient| triplets::loss(embeddings, 5, 0.1, 8, gradient),
                gradient,
            );
            total / 8.0
        },
    );
}

#[test]
fn the_compact_network_and_in_batch_triplets() {
    let architecture = Architecture::compact(grey(20), 5).unwrap();
    check(
        architecture,
        &fixture().compact,
        1e-3,
        |network, shards, images, gradient| {
            shards.gradient_at_once(
                network,
                images,
                7,
                |embeddings, gradient| in_batch::loss(embeddings, 5, 0.1, gradient),
                gradient,
            )
        },
    );
}
