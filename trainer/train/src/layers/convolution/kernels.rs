//! The loops of a convolution, with the CPU's widest vectors. A tile of sums stays in registers from its first product to its
//! last; products are added by fused multiply-add. The order in which products are added does not depend on the width of vectors.

use super::meetings::{Group, Place, Span, Strip};
use crate::real::Real;
use pulp::{Simd, WithSimd};

/// Number of channels of a tile. Packed weights and outputs of [`Products`] have a multiple of this number of channels.
pub(super) const WIDTH: usize = 16;

/// Sets every pixel of `target` to `first` plus a sum of weights times values of `source`.
pub(super) struct Gather<'a, T> {
    pub(super) groups: &'a [Group],
    pub(super) samples: usize,
    pub(super) source: &'a [T],
    /// Rows of [`WIDTH`] weights, for every [`WIDTH`] channels of the target.
    pub(super) weights: &'a [T],
    /// A value for each channel, and zeros up to a multiple of [`WIDTH`].
    pub(super) first: &'a [T],
    pub(super) channels: usize,
    pub(super) target: &'a mut [T],
}

impl<T: Real> WithSimd for Gather<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        // The constants are the number of vectors for a tile's channels, and the number of pixels per tile: as many as registers
        // hold.
        match T::lanes::<S>() {
            16 => self.run::<S, 1, 12>(simd),
            8 => self.run::<S, 2, 6>(simd),
            4 => self.run::<S, 4, 6>(simd),
            2 => self.run::<S, 8, 1>(simd),
            _ => self.run::<S, 16, 1>(simd),
        }
    }
}

impl<T: Real> Gather<'_, T> {
    #[inline(always)]
    fn run<S: Simd, const V: usize, const P: usize>(self, simd: S) {
        let blocks = self.first.len() / WIDTH;
        let weights = self.weights.chunks_exact(self.weights.len() / blocks);
        let firsts = self.first.chunks_exact(WIDTH);
        for (block, (weights, first)) in weights.zip(firsts).enumerate() {
            let from = block * WIDTH;
            let own = WIDTH.min(self.channels - from);
            for group in self.groups {
                for places in group.places.of(self.samples).chunks(P) {
                    // Fills the last tile with copies of its last pixel.
                    let mut tile = [places[places.len() - 1]; P];
                    tile[..places.len()].copy_from_slice(places);
                    let sums = sums::<T, S, V, P>(simd, &group.spans, &tile, self.source, weights, first);
                    for (place, sums) in tile.iter().zip(&sums) {
                        let to = place.pixel as usize * self.channels + from;
                        store::<T, S, V>(sums, &mut self.target[to..to + own]);
                    }
                }
            }
        }
    }
}

/// The sums of a tile's pixels.
#[inline(always)]
fn sums<T: Real, S: Simd, const V: usize, const P: usize>(
    simd: S,
    spans: &[Span],
    tile: &[Place; P],
    source: &[T],
    weights: &[T],
    first: &[T],
) -> [[T::Vector<S>; V]; P] {
    let mut sums = [load::<T, S, V>(simd, first); P];
    for &Span { row, shift, len } in spans {
        let (weights, _) = T::vectors::<S>(&weights[row * WIDTH..][..len * WIDTH]).as_chunks::<V>();
        let weights = &weights[..len];
        let mut values: [&[T]; P] = [&[]; P];
        for (values, place) in values.iter_mut().zip(tile) {
            *values = &source[place.source as usize + shift..][..len];
        }
        for (i, weights) in weights.iter().enumerate() {
            // The loop reads all values before the first product: otherwise the compiler would keep a vector of every value, and
            // would have too few registers for the sums.
            let mut here = [T::zero(); P];
            for (value, values) in here.iter_mut().zip(&values) {
                *value = values[i];
            }
            for (&value, sums) in here.iter().zip(&mut sums) {
                let value = T::splat(simd, value);
                for (sum, weight) in sums.iter_mut().zip(weights) {
                    *sum = T::times_plus(simd, value, *weight, *sum);
                }
            }
        }
    }
    sums
}

/// For each pixel, multiplies the values under the kernel with the gradient with respect to this pixel. Adds these products,
/// summed over all pixels, to `sums`.
pub(super) struct Products<'a, T> {
    pub(super) strips: &'a [Strip],
    pub(super) samples: usize,
    pub(super) values: &'a [T],
    /// Gradient: `channels` numbers for each pixel.
    pub(super) gradient: &'a [T],
    /// Number of channels, a multiple of [`WIDTH`].
    pub(super) channels: usize,
    /// Sums of products: `channels` numbers for each value of a patch.
    pub(super) sums: &'a mut [T],
    /// Sums of the gradients alone: `channels` numbers.
    pub(super) alone: &'a mut [T],
}

impl<T: Real> WithSimd for Products<'_, T> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        match T::lanes::<S>() {
            16 => self.run::<S, 1, 12>(simd),
            8 => self.run::<S, 2, 6>(simd),
            4 => self.run::<S, 4, 6>(simd),
            2 => self.run::<S, 8, 1>(simd),
            _ => self.run::<S, 16, 1>(simd),
        }
    }
}

impl<T: Real> Products<'_, T> {
    /// Computes the products in tiles of `M` values.
    #[inline(always)]
    fn run<S: Simd, const V: usize, const M: usize>(mut self, simd: S) {
        for from in (0..self.channels).step_by(WIDTH) {
            self.sum_alone::<S, V>(simd, from);
            for strip in self.strips {
                let places = strip.places.of(self.samples);
                let mut done = 0;
                while done < strip.len {
                    done += match strip.len - done {
                        rest if rest >= M => self.tile::<S, V, M>(simd, places, strip.row, done, from),
                        rest if rest >= 6 => self.tile::<S, V, 6>(simd, places, strip.row, done, from),
                        4.. => self.tile::<S, V, 4>(simd, places, strip.row, done, from),
                        2.. => self.tile::<S, V, 2>(simd, places, strip.row, done, from),
                        _ => self.tile::<S, V, 1>(simd, places, strip.row, done, from),
                    };
                }
            }
        }
    }

    /// Computes the products of the `M` values that follow the first `done` values; returns `M`.
    #[inline(always)]
    fn tile<S: Simd, const V: usize, const M: usize>(
        &mut self,
        simd: S,
        places: &[Place],
        row: usize,
        done: usize,
        from: usize,
    ) -> usize {
        let mut sums = [[T::splat(simd, T::zero()); V]; M];
        for place in places {
            let values = self.values[place.source as usize + done..].first_chunk::<M>();
            let gradient = &self.gradient[place.pixel as usize * self.channels + from..][..WIDTH];
            let gradient = T::vectors::<S>(gradient).first_chunk::<V>();
            let (Some(values), Some(gradient)) = (values, gradient) else {
                continue;
            };
            for (sums, &value) in sums.iter_mut().zip(values) {
                let value = T::splat(simd, value);
                for (sum, gradient) in sums.iter_mut().zip(gradient) {
                    *sum = T::times_plus(simd, value, *gradient, *sum);
                }
            }
        }
        let rows = self.sums.chunks_exact_mut(self.channels).skip(row + done);
        for (row, sums) in rows.zip(&sums) {
            add::<T, S, V>(simd, sums, &mut row[from..from + WIDTH]);
        }
        M
    }

    /// Sums the gradients in four partial sums, because each addition waits for the addition before it.
    #[inline(always)]
    fn sum_alone<S: Simd, const V: usize>(&mut self, simd: S, from: usize) {
        const APART: usize = 4;
        let mut sums = [[T::splat(simd, T::zero()); V]; APART];
        for pixels in self.gradient.chunks(APART * self.channels) {
            for (sums, pixel) in sums.iter_mut().zip(pixels.chunks_exact(self.channels)) {
                let gradient = T::vectors::<S>(&pixel[from..from + WIDTH]);
                for (sum, gradient) in sums.iter_mut().zip(gradient) {
                    *sum = T::plus(simd, *sum, *gradient);
                }
            }
        }
        for sums in &sums {
            add::<T, S, V>(simd, sums, &mut self.alone[from..from + WIDTH]);
        }
    }
}

#[inline(always)]
fn load<T: Real, S: Simd, const V: usize>(simd: S, values: &[T]) -> [T::Vector<S>; V] {
    let mut vectors = [T::splat(simd, T::zero()); V];
    for (vector, values) in vectors.iter_mut().zip(T::vectors::<S>(values)) {
        *vector = *values;
    }
    vectors
}

#[inline(always)]
fn add<T: Real, S: Simd, const V: usize>(simd: S, vectors: &[T::Vector<S>; V], to: &mut [T]) {
    for (to, vector) in T::vectors_mut::<S>(to).iter_mut().zip(vectors) {
        *to = T::plus(simd, *to, *vector);
    }
}

/// Fills `to` with the first values of the vectors.
#[inline(always)]
fn store<T: Real, S: Simd, const V: usize>(vectors: &[T::Vector<S>; V], to: &mut [T]) {
    if to.len() == WIDTH {
        for (to, vector) in T::vectors_mut::<S>(to).iter_mut().zip(vectors) {
            *to = *vector;
        }
        return;
    }
    let mut values = [T::zero(); WIDTH];
    for (to, vector) in T::vectors_mut::<S>(&mut values).iter_mut().zip(vectors) {
        *to = *vector;
    }
    to.copy_from_slice(&values[..to.len()]);
}
