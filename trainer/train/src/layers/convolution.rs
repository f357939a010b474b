//! Convolutions, computed directly on pictures. A matrix of patches would be more than twice as large as its picture, and each of
//! three passes would write and read the matrix.

mod kernels;
mod meetings;
#[cfg(test)]
mod tests;

use super::{Backward, plane};
use crate::real::Real;
use kernels::{Gather, Products, WIDTH};
use meetings::{Geometry, Meetings};
use murmuration_swarm::training::Shape;
use pulp::Arch;
use std::sync::Arc;

/// Parameters: one row of weights per output channel (row, column, channel of the kernel), then the biases.
#[derive(Debug, Clone)]
pub(crate) struct Convolution {
    pub(crate) input: Shape,
    pub(crate) output: Shape,
    pub(crate) kernel: usize,
    pub(crate) stride: usize,
    pub(crate) padding: usize,
    meetings: Arc<Meetings>,
}

impl Convolution {
    pub(crate) fn new(input: Shape, output: Shape, kernel: usize, stride: usize, padding: usize) -> Self {
        let geometry = Geometry {
            input,
            output,
            kernel,
            stride,
            padding,
        };
        Self {
            input,
            output,
            kernel,
            stride,
            padding,
            meetings: Arc::new(Meetings::new(geometry)),
        }
    }

    /// Number of values under one position of the kernel.
    pub(crate) const fn patch(&self) -> usize {
        self.kernel * self.kernel * self.input.channels
    }

    /// The kernel, if it convolves one channel with one channel, with stride 1 and without padding. [`plane`] convolves with such
    /// kernels row by row.
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
        let first = scratch_of(scratch, 0);
        first.extend_from_slice(biases);
        first.resize(channels.next_multiple_of(WIDTH), T::zero());
        let begun = first.len();
        pack(
            channels,
            patch,
            |channel, row| weights[channel * patch + row],
            first,
        );
        let (first, weights) = scratch.split_at(begun);
        let samples = self.meetings.samples;
        let blocks = input.chunks(samples * self.input.len());
        for (input, output) in blocks.zip(output.chunks_mut(samples * self.output.len())) {
            Arch::new().dispatch(Gather {
                groups: &self.meetings.outputs,
                samples: input.len() / self.input.len(),
                source: input,
                weights,
                first,
                channels,
                target: output,
            });
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
        self.add_parameter_gradient(pass.input, pass.d_output, d_weights, d_biases, pass.scratch);
        if let Some(d_input) = pass.d_input {
            self.input_gradient(weights, pass.d_output, d_input, pass.scratch);
        }
    }

    fn add_parameter_gradient<T: Real>(
        &self,
        input: &[T],
        d_output: &[T],
        d_weights: &mut [T],
        d_biases: &mut [T],
        scratch: &mut Vec<T>,
    ) {
        let (patch, channels) = (self.patch(), self.output.channels);
        let wide = channels.next_multiple_of(WIDTH);
        let padded = if wide == channels {
            0
        } else {
            d_output.len() / channels * wide
        };
        let (sums, rest) = scratch_of(scratch, (patch + 1) * wide + padded).split_at_mut(patch * wide);
        let (alone, gradient) = rest.split_at_mut(wide);
        for (wide, own) in gradient
            .chunks_exact_mut(wide)
            .zip(d_output.chunks_exact(channels))
        {
            wide[..channels].copy_from_slice(own);
        }
        let gradient = if wide == channels { d_output } else { gradient };
        let samples = self.meetings.samples;
        let blocks = input.chunks(samples * self.input.len());
        for (input, gradient) in blocks.zip(gradient.chunks(samples * self.output.pixels() * wide)) {
            Arch::new().dispatch(Products {
                strips: &self.meetings.strips,
                samples: input.len() / self.input.len(),
                values: input,
                gradient,
                channels: wide,
                sums,
                alone,
            });
        }
        for (row, sums) in sums.chunks_exact(wide).enumerate() {
            for (weights, &sum) in d_weights.chunks_exact_mut(patch).zip(sums) {
                weights[row] += sum;
            }
        }
        for (d_bias, &sum) in d_biases.iter_mut().zip(&*alone) {
            *d_bias += sum;
        }
    }

    fn input_gradient<T: Real>(
        &self,
        weights: &[T],
        d_output: &[T],
        d_input: &mut [T],
        scratch: &mut Vec<T>,
    ) {
        let (patch, channels, outputs) = (self.patch(), self.input.channels, self.output.channels);
        let first = scratch_of(scratch, channels.next_multiple_of(WIDTH));
        let begun = first.len();
        let weight = |channel: usize, row: usize| {
            let (part, output) = (row / outputs, row % outputs);
            weights[output * patch + part * channels + channel]
        };
        pack(channels, self.kernel * self.kernel * outputs, weight, first);
        let (first, weights) = scratch.split_at(begun);
        let samples = self.meetings.samples;
        let blocks = d_output.chunks(samples * self.output.len());
        for (d_output, d_input) in blocks.zip(d_input.chunks_mut(samples * self.input.len())) {
            Arch::new().dispatch(Gather {
                groups: &self.meetings.inputs,
                samples: d_output.len() / self.output.len(),
                source: d_output,
                weights,
                first,
                channels,
                target: d_input,
            });
        }
    }
}

/// The scratch buffer, filled with this number of zeros.
fn scratch_of<T: Real>(scratch: &mut Vec<T>, zeros: usize) -> &mut Vec<T> {
    scratch.clear();
    scratch.resize(zeros, T::zero());
    scratch
}

/// Appends the weights of `channels` in rows of [`WIDTH`] channels; all rows of the first channels precede all rows of the next
/// channels.
fn pack<T: Real>(channels: usize, rows: usize, weight: impl Fn(usize, usize) -> T, to: &mut Vec<T>) {
    for from in (0..channels).step_by(WIDTH) {
        for row in 0..rows {
            let own = from..channels.min(from + WIDTH);
            let missing = WIDTH - own.len();
            to.extend(own.map(|channel| weight(channel, row)));
            to.extend(std::iter::repeat_n(T::zero(), missing));
        }
    }
}
