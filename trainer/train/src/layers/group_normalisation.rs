//! Group normalisation (Wu & He 2018) and the activation that follows. Group normalisation uses no statistics of the batch, so
//! chunks of images are independent, and training and inference behave alike.
//!
//! Values are processed in lines of a few pixels, because the channels of one pixel are too few for vector loops.

use super::{Activation, Backward};
use crate::real::Real;
use murmuration_swarm::training::Shape;
use pulp::{Arch, Simd, WithSimd};

/// Small number that is added to every variance.
pub(crate) const EPSILON: f64 = 1e-5;

/// Parameters: one scale per channel, then one shift per channel. The forward pass keeps the mean and the reciprocal of the
/// deviation of every group of every sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroupNormalisation {
    pub(crate) shape: Shape,
    pub(crate) groups: usize,
    /// Activation that is applied to the normalised values.
    pub(crate) activation: Option<Activation>,
}

/// Minimum number of values of a line.
const LINE: usize = 128;
/// Number of lines that are summed separately before their sum is added to the total, because a long sum of small numbers
/// loses precision.
const SUMMED_TOGETHER: usize = 64;

impl GroupNormalisation {
    pub(crate) fn forward<T: Real>(self, parameters: &[T], input: &[T], output: &mut [T], notes: &mut [T]) {
        Arch::new().dispatch(Forward {
            layer: self,
            parameters,
            input,
            output,
            notes,
        });
    }

    pub(crate) fn backward<T: Real>(self, pass: Backward<T>) {
        let Some(d_input) = pass.d_input else { return };
        Arch::new().dispatch(Back {
            layer: self,
            parameters: pass.parameters,
            input: pass.input,
            notes: pass.notes,
            d_output: pass.d_output,
            d_input,
            d_parameters: pass.d_parameters,
        });
    }

    const fn group(self, channel: usize) -> usize {
        channel * self.groups / self.shape.channels
    }

    /// Mean and reciprocal of the deviation of the channel's group.
    fn noted<T: Real>(self, notes: &[T], channel: usize) -> [T; 2] {
        let group = self.group(channel);
        [notes[2 * group], notes[2 * group + 1]]
    }

    /// Number of values of a line of whole pixels.
    const fn line(self) -> usize {
        LINE.next_multiple_of(self.shape.channels)
    }

    /// Factor that the activation multiplies negative values by.
    fn slope<T: Real>(self) -> T {
        T::of(self.activation.map_or(1.0, |activation| activation.slope))
    }

    /// Writes the mean of each group to every second note, from `note` on. `sums` has a sum for each channel.
    fn note_means<T: Real>(self, sums: &[T], notes: &mut [T], note: usize) {
        let count = T::of((self.shape.len() / self.groups) as f64);
        let members = self.shape.channels / self.groups;
        for (notes, sums) in notes.chunks_exact_mut(2).zip(sums.chunks_exact(members)) {
            notes[note] = sums.iter().fold(T::zero(), |total, &sum| total + sum) / count;
        }
    }

    /// Writes the factors that the values of a line are multiplied by, and the terms that are added to the products.
    fn coefficients<T: Real>(self, parameters: &[T], notes: &[T], factors: &mut [T], terms: &mut [T]) {
        let channels = self.shape.channels;
        for channel in 0..channels {
            let [mean, rate] = self.noted(notes, channel);
            factors[channel] = parameters[channel] * rate;
            terms[channel] = parameters[channels + channel] - mean * factors[channel];
        }
        repeat(factors, channels);
        repeat(terms, channels);
    }
}

struct Forward<'a, T> {
    layer: GroupNormalisation,
    parameters: &'a [T],
    input: &'a [T],
    output: &'a mut [T],
    notes: &'a mut [T],
}

impl<T: Real> WithSimd for Forward<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let layer = self.layer;
        let (len, line) = (layer.shape.len(), layer.line());
        let mut lines = Lines::new(line, layer.shape.channels);
        let (mut factors, mut terms) = (vec![T::zero(); line], vec![T::zero(); line]);
        let slope = layer.slope();
        let samples = self
            .input
            .chunks_exact(len)
            .zip(self.output.chunks_exact_mut(len));
        for ((input, output), notes) in samples.zip(self.notes.chunks_exact_mut(2 * layer.groups)) {
            terms.fill(T::zero());
            layer.note_means(lines.sum(input, &terms, false), notes, 0);
            for (channel, mean) in terms.iter_mut().take(layer.shape.channels).enumerate() {
                *mean = layer.noted(notes, channel)[0];
            }
            repeat(&mut terms, layer.shape.channels);
            layer.note_means(lines.sum(input, &terms, true), notes, 1);
            for notes in notes.chunks_exact_mut(2) {
                notes[1] = T::one() / (notes[1] + T::of(EPSILON)).root();
            }
            layer.coefficients(self.parameters, notes, &mut factors, &mut terms);
            for (input, output) in input.chunks(line).zip(output.chunks_mut(line)) {
                let values = input.iter().zip(&factors).zip(&terms);
                for (output, ((&input, &factor), &term)) in output.iter_mut().zip(values) {
                    let value = input * factor + term;
                    *output = if value > T::zero() { value } else { value * slope };
                }
            }
        }
    }
}

struct Back<'a, T> {
    layer: GroupNormalisation,
    parameters: &'a [T],
    input: &'a [T],
    notes: &'a [T],
    d_output: &'a [T],
    d_input: &'a mut [T],
    d_parameters: &'a mut [T],
}

impl<T: Real> WithSimd for Back<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let layer = self.layer;
        let (len, line, channels) = (layer.shape.len(), layer.line(), layer.shape.channels);
        let count = T::of((len / layer.groups) as f64);
        let (d_scales, d_shifts) = self.d_parameters.split_at_mut(channels);
        let [mut alone, mut times_input] = [(); 2].map(|()| Lines::new(line, channels));
        let [mut factors, mut terms, mut rates, mut slopes, mut rests] =
            [(); 5].map(|()| vec![T::zero(); line]);
        let mut by_group = vec![[T::zero(); 2]; layer.groups];
        let slope = layer.slope();
        let samples = self.input.chunks_exact(len).zip(self.d_output.chunks_exact(len));
        let notes = self.notes.chunks_exact(2 * layer.groups);
        for (((input, d_output), d_input), notes) in
            samples.zip(self.d_input.chunks_exact_mut(len)).zip(notes)
        {
            layer.coefficients(self.parameters, notes, &mut factors, &mut terms);
            // `d_input` temporarily holds the gradient with respect to the normalised values.
            let parts = SUMMED_TOGETHER * line;
            let chunks = input.chunks(parts).zip(d_output.chunks(parts));
            for ((input, d_output), d_input) in chunks.zip(d_input.chunks_mut(parts)) {
                let values = input.chunks(line).zip(d_output.chunks(line));
                for ((input, d_output), d_input) in values.zip(d_input.chunks_mut(line)) {
                    let sums = alone.part.iter_mut().zip(&mut times_input.part);
                    let values = input.iter().zip(d_output).zip(factors.iter().zip(&terms));
                    for ((d_input, ((&input, &d_output), (&factor, &term))), (alone, times_input)) in
                        d_input.iter_mut().zip(values).zip(sums)
                    {
                        let value = input * factor + term;
                        let slope = if value > T::zero() { T::one() } else { slope };
                        let gradient = d_output * slope;
                        *d_input = gradient;
                        *alone += gradient;
                        *times_input += gradient * input;
                    }
                }
                alone.flush();
                times_input.flush();
            }
            // Sums over each group: the gradients alone, and the gradients times the normalised values.
            by_group.fill([T::zero(); 2]);
            let sums = alone.total().iter().zip(times_input.total());
            for (channel, (&alone, &times_input)) in sums.enumerate() {
                let [mean, rate] = layer.noted(notes, channel);
                let times_normalised = (times_input - mean * alone) * rate;
                d_shifts[channel] += alone;
                d_scales[channel] += times_normalised;
                let group = &mut by_group[layer.group(channel)];
                group[0] += alone * self.parameters[channel];
                group[1] += times_normalised * self.parameters[channel];
            }
            let lines = rates.iter_mut().zip(&mut slopes).zip(&mut rests);
            for (channel, ((factor, slope), rest)) in lines.take(channels).enumerate() {
                let [mean, rate] = layer.noted(notes, channel);
                let [alone, times_normalised] = by_group[layer.group(channel)];
                *factor = rate * self.parameters[channel];
                *slope = -(rate * rate * times_normalised / count);
                *rest = -(rate * alone / count) - mean * *slope;
            }
            for line in [&mut rates, &mut slopes, &mut rests] {
                repeat(line, channels);
            }
            for (input, d_input) in input.chunks(line).zip(d_input.chunks_mut(line)) {
                let values = input.iter().zip(&rates).zip(slopes.iter().zip(&rests));
                for (d_input, ((&input, &factor), (&slope, &rest))) in d_input.iter_mut().zip(values) {
                    *d_input = *d_input * factor + input * slope + rest;
                }
            }
        }
    }
}

/// Fills a line with copies of its first pixel.
fn repeat<T: Real>(line: &mut [T], channels: usize) {
    let (first, rest) = line.split_at_mut(channels);
    for pixel in rest.chunks_exact_mut(channels) {
        pixel.copy_from_slice(first);
    }
}

/// Sums by position in a line, then by channel.
struct Lines<T> {
    part: Vec<T>,
    sums: Vec<T>,
    by_channel: Vec<T>,
}

impl<T: Real> Lines<T> {
    fn new(line: usize, channels: usize) -> Self {
        Self {
            part: vec![T::zero(); line],
            sums: vec![T::zero(); line],
            by_channel: vec![T::zero(); channels],
        }
    }

    /// Sums by channel of the values or, if `squared`, of the squares of their differences from `means`.
    #[inline(always)]
    fn sum(&mut self, values: &[T], means: &[T], squared: bool) -> &[T] {
        let line = self.part.len();
        for lines in values.chunks(SUMMED_TOGETHER * line) {
            for values in lines.chunks(line) {
                if squared {
                    for ((sum, &value), &mean) in self.part.iter_mut().zip(values).zip(means) {
                        *sum += (value - mean) * (value - mean);
                    }
                } else {
                    for (sum, &value) in self.part.iter_mut().zip(values) {
                        *sum += value;
                    }
                }
            }
            self.flush();
        }
        self.total()
    }

    /// Adds `part` to `sums`, and sets `part` to zero.
    #[inline(always)]
    fn flush(&mut self) {
        for (sum, part) in self.sums.iter_mut().zip(&mut self.part) {
            *sum += *part;
            *part = T::zero();
        }
    }

    /// Returns the sums by channel, and sets `sums` to zero.
    #[inline(always)]
    fn total(&mut self) -> &[T] {
        self.by_channel.fill(T::zero());
        for pixel in self.sums.chunks_exact_mut(self.by_channel.len()) {
            for (total, sum) in self.by_channel.iter_mut().zip(pixel) {
                *total += *sum;
                *sum = T::zero();
            }
        }
        &self.by_channel
    }
}
