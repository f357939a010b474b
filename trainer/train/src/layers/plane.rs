//! The convolutions of the paper's network: one channel with one channel, with stride 1 and without padding, computed directly on
//! pictures. A matrix of patches would be nine times as large as the picture, and be multiplied by a single column.
//!
//! A run is some neighbouring values of an output row: their sums stay in registers until every weight of the kernel is applied.
//! Vectors have the CPU's widest size. Their size changes no bit of the result, because no sum is reordered and no product is fused.

use crate::real::Real;
use pulp::{Arch, Simd, WithSimd};

/// Number of values in a run. If the length of a row is not a multiple of this number, the last run overlaps the run before. If a
/// row is shorter than this number, a run is a single value.
const RUN: usize = 16;

/// A kernel, row after row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Kernel<'a, T> {
    pub(super) side: usize,
    pub(super) weights: &'a [T],
}

/// Convolves pictures of `side` x `side` with the kernel and writes the result plus `bias` to `outputs`.
pub(super) fn correlate<T: Real>(kernel: Kernel<T>, bias: T, side: usize, inputs: &[T], outputs: &mut [T]) {
    Arch::new().dispatch(Forward {
        kernel,
        bias,
        side,
        inputs,
        outputs,
    });
}

/// Writes the gradient with respect to the pictures of `side` x `side` to `d_inputs`; `room` is a scratch buffer.
pub(super) fn input_gradient<T: Real>(
    kernel: Kernel<T>,
    side: usize,
    d_outputs: &[T],
    d_inputs: &mut [T],
    room: &mut Vec<T>,
) {
    Arch::new().dispatch(InputGradient {
        kernel,
        side,
        d_outputs,
        d_inputs,
        room,
    });
}

/// Adds the gradient with respect to the weights of a square kernel to `d_weights`, and the gradient with respect to the bias to
/// `d_bias`. Pictures have `side` x `side` pixels.
pub(super) fn add_parameter_gradient<T: Real>(
    side: usize,
    inputs: &[T],
    d_outputs: &[T],
    d_weights: &mut [T],
    d_bias: &mut T,
) {
    Arch::new().dispatch(ParameterGradient {
        kernel: d_weights.len().isqrt(),
        side,
        inputs,
        d_outputs,
        d_weights,
        d_bias,
    });
}

struct Forward<'a, T> {
    kernel: Kernel<'a, T>,
    bias: T,
    side: usize,
    inputs: &'a [T],
    outputs: &'a mut [T],
}

impl<T: Real> WithSimd for Forward<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let to = self.side + 1 - self.kernel.side;
        let inputs = self.inputs.chunks_exact(self.side * self.side);
        for (input, output) in inputs.zip(self.outputs.chunks_exact_mut(to * to)) {
            correlate_one(self.kernel, self.bias, self.side, input, output);
        }
    }
}

struct InputGradient<'a, T> {
    kernel: Kernel<'a, T>,
    side: usize,
    d_outputs: &'a [T],
    d_inputs: &'a mut [T],
    room: &'a mut Vec<T>,
}

impl<T: Real> WithSimd for InputGradient<'_, T> {
    type Output = ();

    /// Adds a border of zeros to the gradients, and correlates the result with the reversed kernel.
    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let (from, to) = (self.side, self.side + 1 - self.kernel.side);
        let border = self.kernel.side - 1;
        let wide = to + 2 * border;
        self.room.clear();
        self.room.extend(self.kernel.weights.iter().rev());
        self.room.resize(self.room.len() + wide * wide, T::zero());
        let (weights, bordered) = self.room.split_at_mut(self.kernel.weights.len());
        let reversed = Kernel {
            side: self.kernel.side,
            weights,
        };
        let d_outputs = self.d_outputs.chunks_exact(to * to);
        for (d_output, d_input) in d_outputs.zip(self.d_inputs.chunks_exact_mut(from * from)) {
            let rows = bordered.chunks_exact_mut(wide).skip(border);
            for (row, values) in rows.zip(d_output.chunks_exact(to)) {
                row[border..border + to].copy_from_slice(values);
            }
            correlate_one(reversed, T::zero(), wide, bordered, d_input);
        }
    }
}

struct ParameterGradient<'a, T> {
    kernel: usize,
    side: usize,
    inputs: &'a [T],
    d_outputs: &'a [T],
    d_weights: &'a mut [T],
    d_bias: &'a mut T,
}

impl<T: Real> WithSimd for ParameterGradient<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        *self.d_bias += sum(self.d_outputs);
        let to = self.side + 1 - self.kernel;
        if to < RUN {
            self.run::<1>(to);
        } else {
            self.run::<RUN>(to);
        }
    }
}

impl<T: Real> ParameterGradient<'_, T> {
    /// Adds the gradient with respect to the weights, in runs of `N` values; output rows have `to` values.
    #[inline(always)]
    fn run<const N: usize>(self, to: usize) {
        // Values that the last run of a row shares with the run before must count only once.
        let mut fresh = [T::one(); N];
        fresh[..(N - to % N) % N].fill(T::zero());
        for (i, weight) in self.d_weights.iter_mut().enumerate() {
            let (down, right) = (i / self.kernel, i % self.kernel);
            let mut sums = [T::zero(); N];
            let samples = self.inputs.chunks_exact(self.side * self.side);
            for (input, d_output) in samples.zip(self.d_outputs.chunks_exact(to * to)) {
                let rows = input.chunks_exact(self.side).skip(down);
                for (row, d_row) in rows.zip(d_output.chunks_exact(to)) {
                    let (row, last) = (&row[right..], to - N);
                    for start in (0..last).step_by(N) {
                        add_products(&row[start..], &d_row[start..], [T::one(); N], &mut sums);
                    }
                    add_products(&row[last..], &d_row[last..], fresh, &mut sums);
                }
            }
            *weight += sums.iter().fold(T::zero(), |total, &sum| total + sum);
        }
    }
}

/// Adds the weighted products of a run of values and a run of slopes.
#[inline(always)]
fn add_products<T: Real, const N: usize>(values: &[T], slopes: &[T], counts: [T; N], sums: &mut [T; N]) {
    // The exact length lets the compiler use vectors.
    let (values, slopes) = (&values[..N], &slopes[..N]);
    let products = values.iter().zip(slopes).zip(counts);
    for (sum, ((&value, &slope), count)) in sums.iter_mut().zip(products) {
        *sum += value * (slope * count);
    }
}

/// The sum of many values, in [`RUN`] partial sums.
#[inline(always)]
fn sum<T: Real>(values: &[T]) -> T {
    let mut sums = [T::zero(); RUN];
    let (runs, rest) = values.as_chunks::<RUN>();
    for run in runs {
        for (sum, &value) in sums.iter_mut().zip(run) {
            *sum += value;
        }
    }
    sums.iter()
        .chain(rest)
        .fold(T::zero(), |total, &value| total + value)
}

#[inline(always)]
fn correlate_one<T: Real>(kernel: Kernel<T>, bias: T, side: usize, input: &[T], output: &mut [T]) {
    match (side + 1 - kernel.side < RUN, kernel.side) {
        (true, _) => correlate_runs::<T, 1, 1>(kernel, bias, side, input, output),
        (false, 3) => correlate_runs::<T, RUN, 3>(kernel, bias, side, input, output),
        (false, _) => correlate_runs::<T, RUN, 1>(kernel, bias, side, input, output),
    }
}

/// Convolves in runs of `N` values. The loop over a row's weights is unrolled by `GROUP`, which divides the number of these
/// weights.
#[inline(always)]
fn correlate_runs<T: Real, const N: usize, const GROUP: usize>(
    kernel: Kernel<T>,
    bias: T,
    side: usize,
    input: &[T],
    output: &mut [T],
) {
    let to = side + 1 - kernel.side;
    let (weights, _) = kernel.weights.as_chunks::<GROUP>();
    let groups = kernel.side / GROUP;
    for (row, output) in output.chunks_exact_mut(to).enumerate() {
        for start in (0..to).step_by(N).map(|start| start.min(to - N)) {
            let mut sums = [bias; N];
            for (down, weights) in weights.chunks_exact(groups).enumerate() {
                let line = &input[(row + down) * side + start..][..N + kernel.side - 1];
                for (i, weights) in weights.iter().enumerate() {
                    let line = &line[i * GROUP..][..N + GROUP - 1];
                    for (right, &weight) in weights.iter().enumerate() {
                        for (sum, &value) in sums.iter_mut().zip(&line[right..right + N]) {
                            *sum += value * weight;
                        }
                    }
                }
            }
            output[start..start + N].copy_from_slice(&sums);
        }
    }
}
