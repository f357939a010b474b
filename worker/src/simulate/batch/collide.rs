//! Collisions of a batch: whom the agent of each lane touches, then the rule of [`Collisions`] in all lanes at once.

use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, lanes_mut, minus, plus, point, scaled, select, words},
    simulate::collide::{Collisions, GAP},
};
use pulp::Simd;

/// The agents that the agent of each lane touches.
#[derive(Clone, Copy)]
pub(super) struct Touched<S: Simd> {
    /// A bit for each, the first the lowest.
    agents: S::u64s,
    /// Where the first is; anywhere in a lane without any.
    first: Planar<S>,
}

impl<S: Simd> Touched<S> {
    /// The agents whose centres are nearer to `at` than the root of `touch`.
    #[inline(always)]
    pub(super) fn by(simd: S, positions: &[Aligned<Planar<S>>], at: Planar<S>, touch: S::f64s) -> Self {
        let one = simd.splat_u64s(1);
        let mut agents = simd.splat_u64s(0);
        let mut first = at;
        // From the last on, so that the first is what stays.
        for &Aligned(other) in positions.iter().rev() {
            let e = minus(simd, at, other);
            let near = simd.less_than_f64s(dot(simd, e, e), touch);
            agents = simd.add_u64s(agents, agents);
            agents = simd.select_u64s(near, simd.or_u64s(agents, one), agents);
            first = select(simd, near, other, first);
        }
        Self { agents, first }
    }

    /// The lanes whose agent touches another.
    #[inline(always)]
    pub(super) fn lanes(self, simd: S) -> S::m64s {
        simd.greater_than_u64s(self.agents, simd.splat_u64s(0))
    }

    /// Those after the first of each lane, if any lane has them.
    #[inline(always)]
    fn rest(mut self, simd: S, positions: &[Aligned<Planar<S>>]) -> Option<Self> {
        self.agents = simd.and_u64s(self.agents, simd.sub_u64s(self.agents, simd.splat_u64s(1)));
        if !any(simd, self.lanes(simd)) {
            return None;
        }
        let [xs, ys] = &mut self.first;
        let slots = lanes_mut::<S>(xs).iter_mut().zip(lanes_mut::<S>(ys));
        for (lane, ((x, y), &bits)) in slots.zip(words::<S>(&self.agents)).enumerate() {
            let first = (bits.trailing_zeros() as usize).min(positions.len() - 1);
            [*x, *y] = point::<S>(&positions[first].0, lane);
        }
        Some(self)
    }
}

/// One pass: where an agent now at `at` is once it was pushed out of all that it touches there. `None` where it is at the very
/// place of one of them, which is rare and for [`pass_by_lane`].
///
/// It is [`Collisions::pushed`] in all lanes at once, without jitter.
#[inline(always)]
pub(super) fn pass<S: Simd>(
    simd: S,
    diameter: f64,
    positions: &[Aligned<Planar<S>>],
    mut touched: Touched<S>,
    mut at: Planar<S>,
) -> Option<Planar<S>> {
    let zero = simd.splat_f64s(0.0);
    let (reach, gap) = (simd.splat_f64s(diameter), simd.splat_f64s(diameter + GAP));
    loop {
        let away = minus(simd, at, touched.first);
        let distance = simd.sqrt_f64s(dot(simd, away, away));
        let direction = [simd.div_f64s(away[0], distance), simd.div_f64s(away[1], distance)];
        let out = plus(simd, at, scaled(simd, direction, simd.sub_f64s(gap, distance)));
        let touching = touched.lanes(simd);
        let within = simd.and_m64s(touching, simd.less_than_or_equal_f64s(distance, reach));
        if any(
            simd,
            simd.and_m64s(touching, simd.less_than_or_equal_f64s(distance, zero)),
        ) {
            return None;
        }
        at = select(simd, within, out, at);
        match touched.rest(simd, positions) {
            Some(rest) => touched = rest,
            None => return Some(at),
        }
    }
}

/// As [`pass`], lane by lane: each has its own jitter to draw.
pub(super) fn pass_by_lane<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    positions: &[Aligned<Planar<S>>],
    touched: Touched<S>,
    at: Planar<S>,
) -> Planar<S> {
    let lanes = words::<S>(&touched.agents).iter().zip(rules).enumerate();
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
