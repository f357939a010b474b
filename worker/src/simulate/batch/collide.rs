//! Collisions of a batch: whom the agent of each lane touches, then the rule of [`Collisions`], lane by lane.

use crate::{
    lanes::{Aligned, Planar, dot, lanes_mut, minus, point, words},
    simulate::collide::Collisions,
};
use pulp::Simd;

/// One pass: where agent `me`, now at `at`, is once it was pushed out of all that it touches there.
#[inline(always)]
pub(super) fn pass<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    positions: &[Aligned<Planar<S>>],
    me: usize,
    at: Planar<S>,
    touch: S::f64s,
) -> Planar<S> {
    let touched = touched(simd, positions, me, at, touch);
    let mut at = at;
    for (lane, (&touched, rule)) in words::<S>(&touched).iter().zip(rules).enumerate() {
        let mut rest = touched;
        while rest != 0 {
            let other = point::<S>(&positions[rest.trailing_zeros() as usize].0, lane);
            let [x, y] = rule.pushed(point::<S>(&at, lane), other);
            lanes_mut::<S>(&mut at[0])[lane] = x;
            lanes_mut::<S>(&mut at[1])[lane] = y;
            rest &= rest - 1;
        }
    }
    at
}

/// The agents other than `me` whose centres are nearer to `at` than the root of `touch`: a bit for each, the first the
/// lowest.
#[inline(always)]
fn touched<S: Simd>(
    simd: S,
    positions: &[Aligned<Planar<S>>],
    me: usize,
    at: Planar<S>,
    touch: S::f64s,
) -> S::u64s {
    let mut touched = simd.splat_u64s(0);
    let mut bit = simd.splat_u64s(1);
    for other in positions {
        let e = minus(simd, other.0, at);
        let near = simd.less_than_f64s(dot(simd, e, e), touch);
        touched = simd.select_u64s(near, simd.or_u64s(touched, bit), touched);
        bit = simd.add_u64s(bit, bit);
    }
    simd.and_u64s(touched, simd.splat_u64s(!(1 << me)))
}
