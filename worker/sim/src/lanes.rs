//! Vectors that hold one number for each of several swarms, one swarm per lane.
//!
//! No function in this module takes a closure or maps an array, because closures are not always inlined. Only inlined code is
//! compiled for this machine's CPU.

use pulp::{Simd, bytemuck};
use std::slice;

/// A point or a direction in the plane.
pub(crate) type Planar<S> = [<S as Simd>::f64s; 2];

/// A value aligned to a cache line, so that no vector in it straddles two cache lines.
#[derive(Debug, Clone, Copy)]
#[repr(align(64))]
pub(crate) struct Aligned<T>(pub(crate) T);

/// The numbers in the lanes of a vector.
#[inline(always)]
pub(crate) fn lanes<S: Simd>(vector: &S::f64s) -> &[f64] {
    bytemuck::cast_slice(slice::from_ref(vector))
}

/// Like [`lanes`], but mutable.
#[inline(always)]
pub(crate) fn lanes_mut<S: Simd>(vector: &mut S::f64s) -> &mut [f64] {
    bytemuck::cast_slice_mut(slice::from_mut(vector))
}

/// Like [`lanes`], for a vector of whole numbers.
#[inline(always)]
pub(crate) fn words<S: Simd>(vector: &S::u64s) -> &[u64] {
    bytemuck::cast_slice(slice::from_ref(vector))
}

/// The point in one lane.
#[inline(always)]
pub(crate) fn point<S: Simd>(points: &Planar<S>, lane: usize) -> [f64; 2] {
    [lanes::<S>(&points[0])[lane], lanes::<S>(&points[1])[lane]]
}

/// Gathers points into vectors, one point per lane.
pub(crate) fn gathered<S: Simd>(simd: S, points: impl Iterator<Item = [f64; 2]>) -> Planar<S> {
    let mut vectors = splat(simd, [0.0; 2]);
    let [xs, ys] = &mut vectors;
    let slots = lanes_mut::<S>(xs).iter_mut().zip(lanes_mut::<S>(ys));
    for ((to_x, to_y), [x, y]) in slots.zip(points) {
        (*to_x, *to_y) = (x, y);
    }
    vectors
}

/// The same point in every lane.
#[inline(always)]
pub(crate) fn splat<S: Simd>(simd: S, [x, y]: [f64; 2]) -> Planar<S> {
    [simd.splat_f64s(x), simd.splat_f64s(y)]
}

#[inline(always)]
pub(crate) fn dot<S: Simd>(simd: S, a: Planar<S>, b: Planar<S>) -> S::f64s {
    simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]))
}

#[inline(always)]
pub(crate) fn plus<S: Simd>(simd: S, a: Planar<S>, b: Planar<S>) -> Planar<S> {
    [simd.add_f64s(a[0], b[0]), simd.add_f64s(a[1], b[1])]
}

#[inline(always)]
pub(crate) fn minus<S: Simd>(simd: S, a: Planar<S>, b: Planar<S>) -> Planar<S> {
    [simd.sub_f64s(a[0], b[0]), simd.sub_f64s(a[1], b[1])]
}

#[inline(always)]
pub(crate) fn scaled<S: Simd>(simd: S, [x, y]: Planar<S>, factor: S::f64s) -> Planar<S> {
    [simd.mul_f64s(x, factor), simd.mul_f64s(y, factor)]
}

/// A vector rotated by an angle, which is given as (cos, sin).
#[inline(always)]
pub(crate) fn rotate<S: Simd>(simd: S, [x, y]: Planar<S>, [cos, sin]: Planar<S>) -> Planar<S> {
    [
        simd.sub_f64s(simd.mul_f64s(x, cos), simd.mul_f64s(y, sin)),
        simd.add_f64s(simd.mul_f64s(x, sin), simd.mul_f64s(y, cos)),
    ]
}

/// `a` in the lanes of `mask`, `b` in the other lanes.
#[inline(always)]
pub(crate) fn select<S: Simd>(simd: S, mask: S::m64s, a: Planar<S>, b: Planar<S>) -> Planar<S> {
    [
        simd.select_f64s(mask, a[0], b[0]),
        simd.select_f64s(mask, a[1], b[1]),
    ]
}

/// Absolute value. `pulp`'s own function is not always inlined.
#[inline(always)]
pub(crate) fn magnitude<S: Simd>(simd: S, value: S::f64s) -> S::f64s {
    let all_but_the_sign = simd.splat_f64s(f64::from_bits(i64::MAX as u64));
    simd.and_f64s(all_but_the_sign, value)
}

/// Whether the mask is set in any lane.
#[inline(always)]
pub(crate) fn any<S: Simd>(simd: S, mask: S::m64s) -> bool {
    simd.first_true_m64s(mask) < S::F64_LANES
}
