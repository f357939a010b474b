//! Group normalisation (Wu & He 2018). It uses no statistics of the batch, so chunks of images are independent, and training
//! and inference behave alike.

use super::Backward;
use crate::real::Real;
use murmuration_proto::training::Shape;

/// Added to every variance.
pub(crate) const EPSILON: f64 = 1e-5;

/// Parameters: one scale per channel, then one shift per channel. The forward pass keeps the mean and the reciprocal of the
/// deviation of every group of every sample.
#[derive(Debug, Clone, Copy)]
pub(crate) struct GroupNormalisation {
    pub(crate) shape: Shape,
    pub(crate) groups: usize,
}

impl GroupNormalisation {
    pub(crate) fn forward<T: Real>(self, parameters: &[T], input: &[T], output: &mut [T], notes: &mut [T]) {
        let channels = self.shape.channels;
        let (scales, shifts) = parameters.split_at(channels);
        let mut factors = vec![T::zero(); channels];
        let mut terms = vec![T::zero(); channels];
        let samples = input
            .chunks_exact(self.shape.len())
            .zip(output.chunks_exact_mut(self.shape.len()));
        for ((input, output), notes) in samples.zip(notes.chunks_exact_mut(2 * self.groups)) {
            self.note_statistics(input, &mut terms, notes);
            for channel in 0..channels {
                let [mean, rate] = self.noted(notes, channel);
                factors[channel] = scales[channel] * rate;
                terms[channel] = shifts[channel] - mean * factors[channel];
            }
            for (input, output) in input
                .chunks_exact(channels)
                .zip(output.chunks_exact_mut(channels))
            {
                let coefficients = factors.iter().zip(&terms);
                for ((output, &input), (&factor, &term)) in output.iter_mut().zip(input).zip(coefficients) {
                    *output = input * factor + term;
                }
            }
        }
    }

    pub(crate) fn backward<T: Real>(self, pass: Backward<T>) {
        let Some(d_input) = pass.d_input else { return };
        let (channels, len) = (self.shape.channels, self.shape.len());
        let scales = &pass.parameters[..channels];
        let (d_scales, d_shifts) = pass.d_parameters.split_at_mut(channels);
        let count = T::of((len / self.groups) as f64);
        let mut line = vec![[T::zero(); 3]; channels];
        let samples = pass.input.chunks_exact(len).zip(pass.d_output.chunks_exact(len));
        let notes = pass.notes.chunks_exact(2 * self.groups);
        for (((input, d_output), d_input), notes) in samples.zip(d_input.chunks_exact_mut(len)).zip(notes) {
            let sums = self.sums(input, d_output);
            // The gradient by the normalised values, summed over each group, alone and times those values.
            let mut group_sums = vec![[T::zero(); 2]; self.groups];
            for channel in 0..channels {
                let [mean, rate] = self.noted(notes, channel);
                let [alone, times_input] = sums[channel];
                let times_normalised = (times_input - mean * alone) * rate;
                d_shifts[channel] += alone;
                d_scales[channel] += times_normalised;
                let group = &mut group_sums[self.group(channel)];
                group[0] += alone * scales[channel];
                group[1] += times_normalised * scales[channel];
            }
            for (channel, line) in line.iter_mut().enumerate() {
                let [mean, rate] = self.noted(notes, channel);
                let [alone, times_normalised] = group_sums[self.group(channel)];
                let slope = -(rate * rate * times_normalised / count);
                *line = [
                    rate * scales[channel],
                    slope,
                    -(rate * alone / count) - mean * slope,
                ];
            }
            let pixels = input.chunks_exact(channels).zip(d_output.chunks_exact(channels));
            for ((input, d_output), d_input) in pixels.zip(d_input.chunks_exact_mut(channels)) {
                let values = input.iter().zip(d_output).zip(&line);
                for (d_input, ((&input, &d_output), &[factor, slope, term])) in d_input.iter_mut().zip(values)
                {
                    *d_input = d_output * factor + input * slope + term;
                }
            }
        }
    }

    const fn group(self, channel: usize) -> usize {
        channel * self.groups / self.shape.channels
    }

    /// Mean and reciprocal of the deviation of the channel's group.
    fn noted<T: Real>(self, notes: &[T], channel: usize) -> [T; 2] {
        let group = self.group(channel);
        [notes[2 * group], notes[2 * group + 1]]
    }

    /// Computes the statistics of one sample's groups; `sums` is a buffer of one value per channel.
    fn note_statistics<T: Real>(self, input: &[T], sums: &mut [T], notes: &mut [T]) {
        let (channels, members) = (self.shape.channels, self.shape.channels / self.groups);
        let count = T::of((self.shape.len() / self.groups) as f64);
        let mean_of = |sums: &[T]| sums.iter().fold(T::zero(), |total, &sum| total + sum) / count;
        sum_by_channel(input, sums, |_, value| value);
        for (notes, sums) in notes.chunks_exact_mut(2).zip(sums.chunks_exact(members)) {
            notes[0] = mean_of(sums);
        }
        let means: Vec<T> = (0..channels)
            .map(|channel| self.noted(notes, channel)[0])
            .collect();
        sum_by_channel(input, sums, |channel, value| {
            (value - means[channel]) * (value - means[channel])
        });
        for (notes, sums) in notes.chunks_exact_mut(2).zip(sums.chunks_exact(members)) {
            notes[1] = T::one() / (mean_of(sums) + T::of(EPSILON)).root();
        }
    }

    /// For every channel of one sample: the sum of the gradients, and of the gradients times the inputs.
    fn sums<T: Real>(self, input: &[T], d_output: &[T]) -> Vec<[T; 2]> {
        let channels = self.shape.channels;
        let mut sums = vec![[T::zero(); 2]; channels];
        for (input, d_output) in input.chunks_exact(channels).zip(d_output.chunks_exact(channels)) {
            for ((sums, &input), &d_output) in sums.iter_mut().zip(input).zip(d_output) {
                sums[0] += d_output;
                sums[1] += d_output * input;
            }
        }
        sums
    }
}

/// Number of pixels that are summed separately before their sum is added to the total, because a long sum of small numbers
/// loses precision.
const SUMMED_TOGETHER: usize = 32;

/// Writes the sum of `term(channel, value)` over all pixels to `sums`, one per channel.
fn sum_by_channel<T: Real>(input: &[T], sums: &mut [T], term: impl Fn(usize, T) -> T) {
    let channels = sums.len();
    let mut part = vec![T::zero(); channels];
    sums.fill(T::zero());
    for pixels in input.chunks(SUMMED_TOGETHER * channels) {
        part.fill(T::zero());
        for pixel in pixels.chunks_exact(channels) {
            for (channel, (part, &value)) in part.iter_mut().zip(pixel).enumerate() {
                *part += term(channel, value);
            }
        }
        for (sum, &part) in sums.iter_mut().zip(&part) {
            *sum += part;
        }
    }
}
