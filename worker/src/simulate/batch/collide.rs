//! Collisions of a batch: whom the agent of each lane touches, then the rule of [`Collisions`] in all lanes at once.

use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, lanes_mut, minus, plus, point, scaled, select, words},
    simulate::collide::{Collisions, GAP},
};
use pulp::Simd;

/// The agents that the agent of each lane touches: a bit for each, the first the lowest.
#[derive(Clone, Copy)]
pub(super) struct Touched<S: Simd>(S::u64s);

impl<S: Simd> Touched<S> {
    /// The agents other than `me` whose centres are nearer to `at` than the root of `touch`.
    #[inline(always)]
    pub(super) fn by(
        simd: S,
        positions: &[Aligned<Planar<S>>],
        me: usize,
        at: Planar<S>,
        touch: S::f64s,
    ) -> Self {
        let mut touched = simd.splat_u64s(0);
        let mut bit = simd.splat_u64s(1);
        for other in positions {
            let e = minus(simd, other.0, at);
            let near = simd.less_than_f64s(dot(simd, e, e), touch);
            touched = simd.or_u64s(touched, simd.select_u64s(near, bit, simd.splat_u64s(0)));
            bit = simd.add_u64s(bit, bit);
        }
        Self(simd.and_u64s(touched, simd.splat_u64s(!(1 << me))))
    }

    /// The lanes whose agent touches another.
    #[inline(always)]
    pub(super) fn lanes(self, simd: S) -> S::m64s {
        simd.greater_than_u64s(self.0, simd.splat_u64s(0))
    }

    /// Takes the first agent out of each lane: where it is. In a lane without any, the place of some agent.
    #[inline(always)]
    fn next(&mut self, simd: S, positions: &[Aligned<Planar<S>>]) -> Planar<S> {
        let mut place = positions[0].0;
        let [xs, ys] = &mut place;
        let slots = lanes_mut::<S>(xs).iter_mut().zip(lanes_mut::<S>(ys));
        for (lane, ((x, y), &bits)) in slots.zip(words::<S>(&self.0)).enumerate() {
            let first = (bits.trailing_zeros() as usize).min(positions.len() - 1);
            [*x, *y] = point::<S>(&positions[first].0, lane);
        }
        self.0 = simd.and_u64s(self.0, simd.sub_u64s(self.0, simd.splat_u64s(1)));
        place
    }
}

/// One pass: where an agent now at `at` is once it was pushed out of all that it touches there.
#[inline(always)]
pub(super) fn pass<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    positions: &[Aligned<Planar<S>>],
    mut touched: Touched<S>,
    mut at: Planar<S>,
) -> Planar<S> {
    if rules.iter().any(Collisions::jitters) {
        return pass_by_lane(simd, rules, positions, touched, at);
    }
    loop {
        let pushing = touched.lanes(simd);
        if !any(simd, pushing) {
            return at;
        }
        let other = touched.next(simd, positions);
        at = pushed(simd, rules, pushing, at, other);
    }
}

/// [`Collisions::pushed`] in the lanes that are `pushing`, without jitter.
#[inline(always)]
fn pushed<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    pushing: S::m64s,
    at: Planar<S>,
    other: Planar<S>,
) -> Planar<S> {
    let Some(diameter) = rules.first().map(Collisions::diameter) else {
        return at;
    };
    let away = minus(simd, at, other);
    let distance = simd.sqrt_f64s(dot(simd, away, away));
    let direction = [simd.div_f64s(away[0], distance), simd.div_f64s(away[1], distance)];
    let push = simd.sub_f64s(simd.splat_f64s(diameter + GAP), distance);
    let mut out = plus(simd, at, scaled(simd, direction, push));
    // At the very same place: rare, and one lane's matter.
    let apart = simd.greater_than_f64s(distance, simd.splat_f64s(0.0));
    if any(simd, simd.and_m64s(pushing, simd.not_m64s(apart))) {
        out = pushed_by_lane(simd, rules, at, other);
    }
    let within = simd.less_than_or_equal_f64s(distance, simd.splat_f64s(diameter));
    select(simd, simd.and_m64s(pushing, within), out, at)
}

#[inline(never)]
fn pushed_by_lane<S: Simd>(simd: S, rules: &mut [Collisions], at: Planar<S>, other: Planar<S>) -> Planar<S> {
    let lanes = rules.iter_mut().enumerate();
    gathered(
        simd,
        lanes.map(|(lane, rule)| rule.pushed(point::<S>(&at, lane), point::<S>(&other, lane))),
    )
}

/// As [`pass`], where each lane has its own jitter to draw.
#[inline(never)]
fn pass_by_lane<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    positions: &[Aligned<Planar<S>>],
    touched: Touched<S>,
    at: Planar<S>,
) -> Planar<S> {
    let lanes = words::<S>(&touched.0).iter().zip(rules).enumerate();
    gathered(
        simd,
        lanes.map(|(lane, (&touched, rule))| {
            let mut at = point::<S>(&at, lane);
            let mut rest = touched;
            while rest != 0 {
                at = rule.pushed(at, point::<S>(&positions[rest.trailing_zeros() as usize].0, lane));
                rest &= rest - 1;
            }
            at
        }),
    )
}
