//! Convolutions of one channel with one channel, stride 1, no padding (the paper's), row by row: a matrix of
//! patches would be nine times the picture, to be multiplied by a single column.

use super::Convolution;
use crate::real::{Real, dot};

/// Adds to `output` what the kernel makes of one picture.
pub(super) fn add_correlation<T: Real>(layer: &Convolution, weights: &[T], input: &[T], output: &mut [T]) {
    for (row, output) in output.chunks_exact_mut(layer.output.side).enumerate() {
        for (&weight, start) in weights.iter().zip(starts(layer, row)) {
            for (sum, &value) in output.iter_mut().zip(&input[start..]) {
                *sum += value * weight;
            }
        }
    }
}

/// Adds to `d_input` the gradient by one picture.
pub(super) fn add_input_gradient<T: Real>(
    layer: &Convolution,
    weights: &[T],
    d_output: &[T],
    d_input: &mut [T],
) {
    for (row, d_output) in d_output.chunks_exact(layer.output.side).enumerate() {
        for (&weight, start) in weights.iter().zip(starts(layer, row)) {
            for (sum, &value) in d_input[start..].iter_mut().zip(d_output) {
                *sum += value * weight;
            }
        }
    }
}

/// Adds to `d_weights` the gradient by the kernel, as far as one picture goes.
pub(super) fn add_weight_gradient<T: Real>(
    layer: &Convolution,
    input: &[T],
    d_output: &[T],
    d_weights: &mut [T],
) {
    for (row, d_output) in d_output.chunks_exact(layer.output.side).enumerate() {
        for (sum, start) in d_weights.iter_mut().zip(starts(layer, row)) {
            *sum += dot(&input[start..start + d_output.len()], d_output);
        }
    }
}

/// Where in the picture each value of the kernel begins to slide for one row that comes out.
fn starts(layer: &Convolution, row: usize) -> impl Iterator<Item = usize> + use<> {
    let (kernel, side) = (layer.kernel, layer.input.side);
    (0..kernel).flat_map(move |i| (0..kernel).map(move |j| (row + i) * side + j))
}
