//! What one agent of each swarm has in its sensors' lines of sight, and how near the nearest other is.

use crate::{
    lanes::{Aligned, Planar, dot, minus},
    simulate::sight::Reach,
};
use pulp::Simd;

/// What a look at all others shows.
pub(super) struct Seen<S: Simd, const SENSORS: usize> {
    /// Square of the distance to the nearest.
    pub(super) nearest: S::f64s,
    /// Whether each sensor hits.
    pub(super) hits: [S::m64s; SENSORS],
}

/// A look from `at` along `rays` at `others`, where nobody touches: lanes in which somebody does have `nearest`
/// right and `hits` wrong.
///
/// With e from here to another's centre, a ray u hits where e.u >= 0 and r^2 - e.e + (e.u)^2 >= 0. Where nobody touches, r^2 - e.e
/// is negative: r^2 - e.e + (e.u)|e.u| is negative too where e.u is, and the same number otherwise. So its sign alone decides, and the
/// largest of all agents decides for all.
#[inline(always)]
pub(super) fn look_apart<S: Simd, const SENSORS: usize>(
    simd: S,
    others: &[Aligned<Planar<S>>],
    at: Planar<S>,
    rays: [Planar<S>; SENSORS],
    reach: Reach,
) -> Seen<S, SENSORS> {
    let zero = simd.splat_f64s(0.0);
    let body = simd.splat_f64s(reach.body);
    let mut nearest = simd.splat_f64s(f64::INFINITY);
    let mut deepest = [simd.splat_f64s(-1.0); SENSORS];
    for other in others {
        let e = minus(simd, other.0, at);
        let squared = dot(simd, e, e);
        nearest = simd.min_f64s(nearest, squared);
        let inside = simd.sub_f64s(body, squared);
        for (ray, deepest) in rays.iter().zip(&mut deepest) {
            let along = dot(simd, e, *ray);
            let depth = simd.add_f64s(inside, simd.mul_f64s(along, simd.abs_f64s(along)));
            *deepest = simd.max_f64s(*deepest, depth);
        }
    }
    let mut hits = [simd.less_than_f64s(zero, zero); SENSORS];
    for (hit, deepest) in hits.iter_mut().zip(deepest) {
        *hit = simd.greater_than_or_equal_f64s(deepest, zero);
    }
    Seen { nearest, hits }
}

/// As [`look_apart`], right in every lane.
#[inline(always)]
pub(super) fn look<S: Simd, const SENSORS: usize>(
    simd: S,
    others: &[Aligned<Planar<S>>],
    at: Planar<S>,
    rays: [Planar<S>; SENSORS],
    reach: Reach,
) -> Seen<S, SENSORS> {
    let zero = simd.splat_f64s(0.0);
    let body = simd.splat_f64s(reach.body);
    let mut nearest = simd.splat_f64s(f64::INFINITY);
    let mut hits = [simd.less_than_f64s(zero, zero); SENSORS];
    for other in others {
        let e = minus(simd, other.0, at);
        let squared = dot(simd, e, e);
        nearest = simd.min_f64s(nearest, squared);
        let inside = simd.sub_f64s(body, squared);
        for (ray, hit) in rays.iter().zip(&mut hits) {
            let along = dot(simd, e, *ray);
            let ahead = simd.greater_than_or_equal_f64s(along, zero);
            let depth = simd.add_f64s(inside, simd.mul_f64s(along, along));
            let met = simd.greater_than_or_equal_f64s(depth, zero);
            *hit = simd.or_m64s(*hit, simd.and_m64s(ahead, met));
        }
    }
    Seen { nearest, hits }
}
