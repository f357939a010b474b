//! Sensor readings of an agent with rays, and whether another agent touches it.

use super::positions::{Block, LANES, Positions};
use pulp::Simd;

/// Number of blocks to scan before checking whether to stop, because the check is a branch that is often mispredicted. The
/// paper's 24 agents have far fewer blocks.
const BLOCKS_BETWEEN_EXITS: usize = 32;

/// Squares of the distances within which agents are seen and touch.
#[derive(Debug, Clone, Copy)]
pub(super) struct Reach {
    /// Square of the radius.
    pub(super) body: f64,
    /// Square of two radii.
    pub(super) touch: f64,
}

impl Reach {
    /// The reach of robots of this radius.
    pub(super) fn of(radius: f64) -> Self {
        let diameter = 2.0 * radius;
        Self {
            body: radius * radius,
            touch: diameter * diameter,
        }
    }

    /// The reach for collisions alone: agents touch if their centres are nearer than `touch`.
    pub(super) const fn touching(touch: f64) -> Self {
        Self {
            body: 0.0,
            touch: touch * touch,
        }
    }

    /// Whether agents at these places touch.
    #[inline(always)]
    pub(super) fn touches(&self, other: [f64; 2], at: [f64; 2]) -> bool {
        let (ex, ey) = (other[0] - at[0], other[1] - at[1]);
        ex * ex + ey * ey < self.touch
    }

    /// Whether the ray from `at` along the unit vector `ray` meets an agent at `other`. The rule is the same as in
    /// [`Observer::look`].
    #[inline(always)]
    pub(super) fn meets(&self, other: [f64; 2], at: [f64; 2], ray: [f64; 2]) -> bool {
        let (ex, ey) = (other[0] - at[0], other[1] - at[1]);
        let inside = self.body - (ex * ex + ey * ey);
        let along = ex * ray[0] + ey * ray[1];
        along >= 0.0 && inside + along * along >= 0.0
    }
}

/// An agent that looks at all other agents.
#[derive(Debug, Clone, Copy)]
pub(super) struct Observer<const SENSORS: usize> {
    pub(super) index: usize,
    pub(super) at: [f64; 2],
    /// Unit vectors along the rays of the agent's sensors, which have no limit.
    pub(super) rays: [[f64; 2]; SENSORS],
}

impl<const SENSORS: usize> Observer<SENSORS> {
    const ALL_HIT: u8 = (1 << SENSORS) - 1;

    /// The sensor state, or `None` if another agent touches this agent.
    ///
    /// The state has a bit for each sensor, S1 the highest.
    #[inline(always)]
    pub(super) fn sense_unless_touched<S: Simd>(
        self,
        simd: S,
        positions: &Positions,
        reach: Reach,
    ) -> Option<u8> {
        let mut sensed = 0;
        for (observer, blocks) in self.groups(positions) {
            let seen = if sensed == Self::ALL_HIT {
                observer.blind().look(simd, blocks, reach)
            } else {
                observer.look(simd, blocks, reach)
            };
            if seen.touched {
                return None;
            }
            sensed |= seen.hits;
        }
        Some(sensed)
    }

    /// The sensor state.
    #[inline(always)]
    pub(super) fn sense<S: Simd>(self, simd: S, positions: &Positions, reach: Reach) -> u8 {
        let mut sensed = 0;
        for (observer, blocks) in self.groups(positions) {
            sensed |= observer.look(simd, blocks, reach).hits;
            if sensed == Self::ALL_HIT {
                break;
            }
        }
        sensed
    }

    /// The blocks in groups, each with the observer's index relative to the group's start. The index is no lane of the group if
    /// the observer is in another group.
    #[inline(always)]
    fn groups(self, positions: &Positions) -> impl Iterator<Item = (Self, &[Block])> {
        let groups = positions.blocks().chunks(BLOCKS_BETWEEN_EXITS).enumerate();
        groups.map(
            #[inline(always)]
            move |(g, blocks)| {
                let index = self.index.wrapping_sub(g * BLOCKS_BETWEEN_EXITS * LANES);
                (Self { index, ..self }, blocks)
            },
        )
    }

    /// The same agent without its sensors.
    #[inline(always)]
    const fn blind(self) -> Observer<0> {
        Observer {
            index: self.index,
            at: self.at,
            rays: [],
        }
    }

    /// Looks at the agents of some blocks. Let e be the vector from the observer to another agent's centre. A ray u hits this
    /// agent if both e.u and r^2 - e.e + (e.u)^2 are at least 0.
    #[inline(always)]
    fn look<S: Simd>(self, simd: S, blocks: &[Block], reach: Reach) -> Seen {
        let splat = |[x, y]: [f64; 2]| [simd.splat_f64s(x), simd.splat_f64s(y)];
        let dot = |a: [S::f64s; 2], b: [S::f64s; 2]| {
            simd.add_f64s(simd.mul_f64s(a[0], b[0]), simd.mul_f64s(a[1], b[1]))
        };
        let at = splat(self.at);
        let rays = self.rays.map(splat);
        let zero = simd.splat_f64s(0.0);
        let [body, touch] = [reach.body, reach.touch].map(|value| simd.splat_f64s(value));

        let none = simd.less_than_f64s(zero, zero);
        let mut near = none;
        let mut hits = [none; SENSORS];
        for (b, block) in blocks.iter().enumerate() {
            for lanes in block.vectors(simd, self.index.wrapping_sub(b * LANES)) {
                let e = [simd.sub_f64s(lanes.x, at[0]), simd.sub_f64s(lanes.y, at[1])];
                let squared = dot(e, e);
                let close = simd.and_m64s(lanes.other, simd.less_than_f64s(squared, touch));
                near = simd.or_m64s(near, close);
                let inside = simd.sub_f64s(body, squared);
                for (ray, hit) in rays.iter().zip(&mut hits) {
                    let along = dot(e, *ray);
                    let ahead = simd.greater_than_or_equal_f64s(along, zero);
                    let reached = simd.add_f64s(inside, simd.mul_f64s(along, along));
                    let met = simd.greater_than_or_equal_f64s(reached, zero);
                    let met = simd.and_m64s(lanes.other, simd.and_m64s(ahead, met));
                    *hit = simd.or_m64s(*hit, met);
                }
            }
        }
        let any = |mask: S::m64s| simd.first_true_m64s(mask) < S::F64_LANES;
        Seen {
            touched: any(near),
            hits: hits
                .into_iter()
                .fold(0, |state, hit| 2 * state + u8::from(any(hit))),
        }
    }
}

/// Result of one look.
#[derive(Debug, Clone, Copy)]
struct Seen {
    /// Whether the centre of another agent is nearer than two radii.
    touched: bool,
    /// The sensors that hit an agent, as bits; S1 is the highest bit.
    hits: u8,
}
