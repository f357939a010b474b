//! Collisions of a batch: finds the agents that the agent of each lane touches, then applies the rule of [`Collisions`] in all
//! lanes at once.

use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, lanes_mut, minus, plus, point, scaled, select, words},
    simulate::collide::{Collisions, GAP},
};
use pulp::Simd;

/// The agents that the agent of each lane touches.
#[derive(Clone, Copy)]
pub(super) struct Touched<S: Simd> {
    /// Number of agents touched.
    count: S::u64s,
    /// Position of the first touched agent; unspecified in a lane whose agent touches no other.
    first: Planar<S>,
}

impl<S: Simd> Touched<S> {
    /// The agents whose centres are nearer to `at` than the root of `touch`.
    #[inline(always)]
    pub(super) fn by(simd: S, positions: &[Aligned<Planar<S>>], at: Planar<S>, touch: S::f64s) -> Self {
        let one = simd.splat_u64s(1);
        let mut count = simd.splat_u64s(0);
        let mut first = at;
        // The loop runs from the last agent to the first, so that the first touched agent remains.
        for &Aligned(other) in positions.iter().rev() {
            let near = touches(simd, other, at, touch);
            count = simd.select_u64s(near, simd.add_u64s(count, one), count);
            first = select(simd, near, other, first);
        }
        Self { count, first }
    }

    /// The lanes whose agent touches another agent.
    #[inline(always)]
    pub(super) fn lanes(self, simd: S) -> S::m64s {
        simd.greater_than_u64s(self.count, simd.splat_u64s(0))
    }

    /// Whether the agent of any lane touches more than one other agent.
    #[inline(always)]
    fn several(self, simd: S) -> bool {
        any(simd, simd.greater_than_u64s(self.count, simd.splat_u64s(1)))
    }
}

#[inline(always)]
fn touches<S: Simd>(simd: S, other: Planar<S>, at: Planar<S>, touch: S::f64s) -> S::m64s {
    let e = minus(simd, at, other);
    simd.less_than_f64s(dot(simd, e, e), touch)
}

/// The agents of [`Touched`] as bits; the lowest bit is the first agent.
#[inline(always)]
fn touched_bits<S: Simd>(
    simd: S,
    positions: &[Aligned<Planar<S>>],
    at: Planar<S>,
    touch: S::f64s,
) -> S::u64s {
    let one = simd.splat_u64s(1);
    let mut bits = simd.splat_u64s(0);
    for &Aligned(other) in positions.iter().rev() {
        let near = touches(simd, other, at, touch);
        bits = simd.add_u64s(bits, bits);
        bits = simd.select_u64s(near, simd.or_u64s(bits, one), bits);
    }
    bits
}

/// Position of the first agent in the `bits` of each lane; of any agent in a lane without bits.
#[inline(always)]
fn first_of<S: Simd>(positions: &[Aligned<Planar<S>>], bits: S::u64s) -> Planar<S> {
    let mut place = positions[0].0;
    let [xs, ys] = &mut place;
    let slots = lanes_mut::<S>(xs).iter_mut().zip(lanes_mut::<S>(ys));
    for (lane, ((x, y), &bits)) in slots.zip(words::<S>(&bits)).enumerate() {
        let first = (bits.trailing_zeros() as usize).min(positions.len() - 1);
        [*x, *y] = point::<S>(&positions[first].0, lane);
    }
    place
}

/// One pass: pushes an agent at `at` out of all agents that it touches there, and returns its new position. `None` if the agent
/// coincides with an agent that it touches, a rare case for [`pass_by_lane`].
///
/// Computes [`Collisions::pushed`] in all lanes at once, without jitter.
#[inline(always)]
pub(super) fn pass<S: Simd>(
    simd: S,
    diameter: f64,
    touch: S::f64s,
    positions: &[Aligned<Planar<S>>],
    touched: Touched<S>,
    at: Planar<S>,
) -> Option<Planar<S>> {
    let mut out = pushed(simd, diameter, touched.lanes(simd), at, touched.first)?;
    if touched.several(simd) {
        let mut bits = touched_bits(simd, positions, at, touch);
        loop {
            bits = simd.and_u64s(bits, simd.sub_u64s(bits, simd.splat_u64s(1)));
            let rest = simd.greater_than_u64s(bits, simd.splat_u64s(0));
            if !any(simd, rest) {
                break;
            }
            out = pushed(simd, diameter, rest, out, first_of::<S>(positions, bits))?;
        }
    }
    Some(out)
}

/// Pushes the agent at `at` out of the agent at `other` in the `touching` lanes, and returns its new position. `None` if two such
/// agents coincide.
#[inline(always)]
fn pushed<S: Simd>(
    simd: S,
    diameter: f64,
    touching: S::m64s,
    at: Planar<S>,
    other: Planar<S>,
) -> Option<Planar<S>> {
    let away = minus(simd, at, other);
    let distance = simd.sqrt_f64s(dot(simd, away, away));
    let together = simd.less_than_or_equal_f64s(distance, simd.splat_f64s(0.0));
    if any(simd, simd.and_m64s(touching, together)) {
        return None;
    }
    let direction = [simd.div_f64s(away[0], distance), simd.div_f64s(away[1], distance)];
    let push = simd.sub_f64s(simd.splat_f64s(diameter + GAP), distance);
    let out = plus(simd, at, scaled(simd, direction, push));
    let within = simd.less_than_or_equal_f64s(distance, simd.splat_f64s(diameter));
    Some(select(simd, simd.and_m64s(touching, within), out, at))
}

/// Like [`pass`], but pushes lane by lane, because each lane draws its own jitter.
pub(super) fn pass_by_lane<S: Simd>(
    simd: S,
    rules: &mut [Collisions],
    positions: &[Aligned<Planar<S>>],
    at: Planar<S>,
    touch: S::f64s,
) -> Planar<S> {
    let bits = touched_bits(simd, positions, at, touch);
    let lanes = words::<S>(&bits).iter().zip(rules).enumerate();
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
