//! Average pooling to a grid of equal windows.

use super::Backward;
use crate::real::Real;
use murmuration_swarm::training::Shape;

/// See [`murmuration_swarm::training::Layer::AveragePooling`].
#[derive(Debug, Clone, Copy)]
pub(crate) struct AveragePooling {
    pub(crate) input: Shape,
    pub(crate) output: Shape,
}

impl AveragePooling {
    /// Number of pixels from the start of a window to the start of the next window.
    pub(crate) const fn stride(self) -> usize {
        self.input.side / self.output.side
    }

    /// Pixels along a side of a window.
    pub(crate) const fn window(self) -> usize {
        self.input.side - (self.output.side - 1) * self.stride()
    }

    pub(crate) fn forward<T: Real>(self, input: &[T], output: &mut [T]) {
        let share = self.share();
        output.fill(T::zero());
        let samples = input.chunks_exact(self.input.len());
        for (input, output) in samples.zip(output.chunks_exact_mut(self.output.len())) {
            self.for_each_pair(|from, to| {
                let to = &mut output[to..to + self.input.channels];
                for (sum, &value) in to.iter_mut().zip(&input[from..]) {
                    *sum += value * share;
                }
            });
        }
    }

    pub(crate) fn backward<T: Real>(self, pass: Backward<T>) {
        let Some(d_input) = pass.d_input else { return };
        let share = self.share();
        d_input.fill(T::zero());
        let samples = d_input.chunks_exact_mut(self.input.len());
        for (d_input, d_output) in samples.zip(pass.d_output.chunks_exact(self.output.len())) {
            self.for_each_pair(|from, to| {
                let from = &mut d_input[from..from + self.input.channels];
                for (sum, &value) in from.iter_mut().zip(&d_output[to..]) {
                    *sum += value * share;
                }
            });
        }
    }

    /// The weight of each pixel of a window.
    fn share<T: Real>(self) -> T {
        T::of(1.0 / (self.window() * self.window()) as f64)
    }

    /// Calls `visit` for every pixel of every window: with the offset of the pixel's channels in the input, and of the window's
    /// channels in the output.
    fn for_each_pair(self, mut visit: impl FnMut(usize, usize)) {
        let (grid, side, channels) = (self.output.side, self.input.side, self.input.channels);
        for (to, row) in (0..grid).flat_map(|i| (0..grid).map(move |j| (i * grid + j, (i, j)))) {
            let (top, left) = (row.0 * self.stride(), row.1 * self.stride());
            for i in top..top + self.window() {
                for j in left..left + self.window() {
                    visit((i * side + j) * channels, to * channels);
                }
            }
        }
    }
}
