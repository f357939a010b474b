//! What an agent has in its sensors' lines of sight, and whether anybody touches it.

use super::positions::Positions;
use pulp::Simd;

/// What one look at all others shows.
#[derive(Debug, Clone, Copy)]
pub(super) struct View {
    /// Whether the centre of another is nearer than two radii.
    pub(super) crowded: bool,
    /// The sensor state: 0 or 1; with two sensors 2 S1 + S2.
    pub(super) sensed: u8,
}

/// Distances that matter, squared.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// Square of the radius.
    pub(super) body: f64,
    /// Square of two radii.
    pub(super) touch: f64,
}

/// Looks from `at` at every agent but `me`, along `rays` (unit vectors) without limit.
///
/// With e from `at` to the other's centre, a ray u hits where e.u >= 0 and r^2 - e.e + (e.u)^2 >= 0.
#[inline(always)]
pub(super) fn look<S: Simd, const SENSORS: usize>(
    simd: S,
    positions: &Positions,
    me: usize,
    at: [f64; 2],
    rays: [[f64; 2]; SENSORS],
    reach: Reach,
) -> View {
    let zero = simd.splat_f64s(0.0);
    let at = [simd.splat_f64s(at[0]), simd.splat_f64s(at[1])];
    let rays = rays.map(|ray| [simd.splat_f64s(ray[0]), simd.splat_f64s(ray[1])]);
    let body = simd.splat_f64s(reach.body);
    let touch = simd.splat_f64s(reach.touch);
    let none = simd.less_than_f64s(zero, zero);
    let mut near = none;
    let mut hits = [none; SENSORS];
    for (b, block) in positions.blocks().iter().enumerate() {
        for ((x, y), other) in block.vectors(simd, me.wrapping_sub(b * 8)) {
            let ex = simd.sub_f64s(x, at[0]);
            let ey = simd.sub_f64s(y, at[1]);
            let squared = simd.add_f64s(simd.mul_f64s(ex, ex), simd.mul_f64s(ey, ey));
            near = simd.or_m64s(near, simd.and_m64s(other, simd.less_than_f64s(squared, touch)));
            let inside = simd.sub_f64s(body, squared);
            for sensor in 0..SENSORS {
                let along = simd.add_f64s(
                    simd.mul_f64s(ex, rays[sensor][0]),
                    simd.mul_f64s(ey, rays[sensor][1]),
                );
                let reached = simd.add_f64s(inside, simd.mul_f64s(along, along));
                let ahead = simd.greater_than_or_equal_f64s(along, zero);
                let met = simd.greater_than_or_equal_f64s(reached, zero);
                let hit = simd.and_m64s(other, simd.and_m64s(ahead, met));
                hits[sensor] = simd.or_m64s(hits[sensor], hit);
            }
        }
    }
    let any = |mask: S::m64s| simd.first_true_m64s(mask) < S::F64_LANES;
    View {
        crowded: any(near),
        sensed: hits
            .into_iter()
            .fold(0, |state, hit| 2 * state + u8::from(any(hit))),
    }
}
