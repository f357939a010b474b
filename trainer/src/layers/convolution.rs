//! Convolutions, by copying the patch under every position of the kernel into a row of a matrix.

use super::{Backward, plane};
use crate::real::{Real, matrix, multiply};
use murmuration_proto::training::Shape;

/// Parameters: one row of weights per output channel (row, column, channel of the kernel), then the biases.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Convolution {
    pub(crate) input: Shape,
    pub(crate) output: Shape,
    pub(crate) kernel: usize,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
}

/// Number of values of the matrix of patches that fit in a core's cache together with the factors.
const PATCHES_AT_ONCE: usize = 1 << 16;

impl Convolution {
    /// Number of values under one position of the kernel.
    pub(crate) const fn patch(&self) -> usize {
        self.kernel * self.kernel * self.input.channels
    }

    /// The kernel, if pictures can be convolved in place, without a matrix.
    fn plane<'a, T>(&self, weights: &'a [T]) -> Option<plane::Kernel<'a, T>> {
        let is_plane =
            self.input.channels == 1 && self.output.channels == 1 && self.stride == 1 && self.padding == 0;
        is_plane.then_some(plane::Kernel {
            side: self.kernel,
            weights,
        })
    }

    pub(crate) fn forward<T: Real>(
        &self,
        parameters: &[T],
        input: &[T],
        output: &mut [T],
        scratch: &mut Vec<T>,
    ) {
        let (patch, channels) = (self.patch(), self.output.channels);
        let (weights, biases) = parameters.split_at(channels * patch);
        if let Some(kernel) = self.plane(weights) {
            plane::correlate(kernel, biases[0], self.input.side, input, output);
            return;
        }
        for pixel in output.chunks_exact_mut(channels) {
            pixel.copy_from_slice(biases);
        }
        let weights = matrix(channels, patch, weights);
        let block = self.samples_at_once();
        let blocks = input.chunks(block * self.input.len());
        for (input, output) in blocks.zip(output.chunks_mut(block * self.output.len())) {
            let places = output.len() / channels;
            let patches = self.patches(input, places, scratch);
            multiply(matrix(places, patch, patches), weights.t(), true, output);
        }
    }

    pub(crate) fn backward<T: Real>(&self, pass: Backward<T>) {
        let (patch, channels) = (self.patch(), self.output.channels);
        let weights = &pass.parameters[..channels * patch];
        let (d_weights, d_biases) = pass.d_parameters.split_at_mut(channels * patch);
        if let Some(kernel) = self.plane(weights) {
            let side = self.input.side;
            let d_bias = &mut d_biases[0];
            plane::add_parameter_gradient(side, pass.input, pass.d_output, d_weights, d_bias);
            if let Some(d_input) = pass.d_input {
                plane::input_gradient(kernel, side, pass.d_output, d_input, pass.scratch);
            }
            return;
        }
        for pixel in pass.d_output.chunks_exact(channels) {
            for (sum, &value) in d_biases.iter_mut().zip(pixel) {
                *sum += value;
            }
        }
        let mut d_input = pass.d_input;
        if let Some(d_input) = d_input.as_deref_mut() {
            d_input.fill(T::zero());
        }
        let block = self.samples_at_once();
        let weights = matrix(channels, patch, weights);
        let blocks = pass.input.chunks(block * self.input.len());
        let d_outputs = pass.d_output.chunks(block * self.output.len());
        for (i, (input, d_output)) in blocks.zip(d_outputs).enumerate() {
            let places = d_output.len() / channels;
            let d_output = matrix(places, channels, d_output);
            let patches = self.patches(input, places, pass.scratch);
            multiply(d_output.t(), matrix(places, patch, patches), true, d_weights);
            if let Some(d_input) = d_input.as_deref_mut() {
                multiply(d_output, weights, false, patches);
                let start = i * block * self.input.len();
                self.add_patches(patches, &mut d_input[start..start + input.len()]);
            }
        }
    }

    fn samples<'a, T>(&self, input: &'a [T]) -> impl Iterator<Item = &'a [T]> + use<'a, T> {
        input.chunks_exact(self.input.len())
    }

    fn samples_at_once(&self) -> usize {
        (PATCHES_AT_ONCE / (self.output.pixels() * self.patch())).max(1)
    }

    /// The patches of some samples, one per row.
    fn patches<'a, T: Real>(&self, input: &[T], places: usize, scratch: &'a mut Vec<T>) -> &'a mut [T] {
        scratch.clear();
        scratch.resize(places * self.patch(), T::zero());
        let rows = self.output.pixels() * self.patch();
        for (input, rows) in self.samples(input).zip(scratch.chunks_exact_mut(rows)) {
            self.for_each_run(|pixel, place, len| {
                rows[place..place + len].copy_from_slice(&input[pixel..pixel + len]);
            });
        }
        scratch
    }

    /// The reverse: adds every patch to its original place.
    fn add_patches<T: Real>(&self, patches: &[T], d_input: &mut [T]) {
        let rows = self.output.pixels() * self.patch();
        for (d_input, rows) in d_input
            .chunks_exact_mut(self.input.len())
            .zip(patches.chunks_exact(rows))
        {
            self.for_each_run(|pixel, place, len| {
                for (sum, &value) in d_input[pixel..pixel + len].iter_mut().zip(&rows[place..]) {
                    *sum += value;
                }
            });
        }
    }

    /// Visits the rows of every patch of a sample, with their offsets in the picture and in the matrix, and their lengths.
    /// Leaves out the padding.
    fn for_each_run(&self, mut visit: impl FnMut(usize, usize, usize)) {
        let (side, channels) = (self.input.side, self.input.channels);
        let inside = |from: usize| {
            let first = self.padding.saturating_sub(from);
            let end = (side + self.padding).saturating_sub(from).min(self.kernel);
            first..end
        };
        for row in 0..self.output.side {
            for column in 0..self.output.side {
                let (top, left) = (row * self.stride, column * self.stride);
                let columns = inside(left);
                let place = (row * self.output.side + column) * self.patch();
                for i in inside(top) {
                    let pixel = (top + i - self.padding) * side + left + columns.start - self.padding;
                    let from = place + (i * self.kernel + columns.start) * channels;
                    visit(pixel * channels, from, columns.len() * channels);
                }
            }
        }
    }
}
