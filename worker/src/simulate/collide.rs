//! Collisions: the agent that has just moved is pushed out of those it touches; the others stay.

use super::{
    Start,
    positions::{LANES, Positions},
    sight::Reach,
};
use murmuration_proto::{Purpose, RandomStream, World};
use pulp::Simd;

/// Times that an agent is pushed out of all that it touches, at most.
pub(crate) const PASSES: usize = 10;
/// What is left between two agents after a push.
pub(crate) const GAP: f64 = 0.001;
/// Largest component of the authors' jitter.
pub(crate) const JITTER: f64 = 0.001;
/// Where both components of the offset are below this, the authors' simulator jitters.
const JITTER_BELOW: f64 = 1e-4;

/// The rule of collisions in one world, and what it has to remember.
#[derive(Debug, Clone)]
pub(super) struct Collisions {
    /// Two radii.
    diameter: f64,
    reach: Reach,
    centre: [f64; 2],
    jitter: Option<RandomStream>,
    jitter_events: u64,
    /// The agents touched, kept for its memory.
    touched: Vec<usize>,
}

impl Collisions {
    pub(super) fn new(world: &World, start: &Start) -> Self {
        Self {
            diameter: 2.0 * world.radius(),
            reach: Reach::of(world),
            centre: [world.width() / 2.0, world.height() / 2.0],
            jitter: world
                .jitter()
                .then(|| RandomStream::derive(start.seed(), Purpose::Jitter, 0)),
            jitter_events: 0,
            touched: Vec::new(),
        }
    }

    pub(super) const fn reach(&self) -> Reach {
        self.reach
    }

    /// Two radii.
    pub(super) const fn diameter(&self) -> f64 {
        self.diameter
    }

    /// Whether a push may draw random numbers.
    pub(super) const fn jitters(&self) -> bool {
        self.jitter.is_some()
    }

    pub(super) const fn jitter_events(&self) -> u64 {
        self.jitter_events
    }

    /// Where agent `me`, now at `at`, ends once it is pushed out of all others.
    #[inline(always)]
    pub(super) fn push_out<S: Simd>(
        &mut self,
        simd: S,
        positions: &Positions,
        me: usize,
        mut at: [f64; 2],
    ) -> [f64; 2] {
        let mut touched = std::mem::take(&mut self.touched);
        for _ in 0..PASSES {
            self.list_touched(simd, &mut touched, positions, me, at);
            if touched.is_empty() {
                break;
            }
            for &other in &touched {
                at = self.pushed(at, positions.get(other));
            }
        }
        self.touched = touched;
        at
    }

    /// Lists the agents that touch one at `at`, in index order.
    #[inline(always)]
    fn list_touched<S: Simd>(
        &self,
        simd: S,
        list: &mut Vec<usize>,
        positions: &Positions,
        me: usize,
        at: [f64; 2],
    ) {
        list.clear();
        let [x, y] = at.map(|value| simd.splat_f64s(value));
        let touch = simd.splat_f64s(self.reach.touch);
        for (b, block) in positions.blocks().iter().enumerate() {
            for (v, lanes) in block.vectors(simd, me.wrapping_sub(b * LANES)).enumerate() {
                let [ex, ey] = [simd.sub_f64s(lanes.x, x), simd.sub_f64s(lanes.y, y)];
                let squared = simd.add_f64s(simd.mul_f64s(ex, ex), simd.mul_f64s(ey, ey));
                let near = simd.and_m64s(lanes.other, simd.less_than_f64s(squared, touch));
                if simd.first_true_m64s(near) < S::F64_LANES {
                    let first = b * LANES + v * S::F64_LANES;
                    let near = |&i: &usize| i != me && self.touches(positions.get(i), at);
                    list.extend((first..first + S::F64_LANES).filter(near));
                }
            }
        }
    }

    #[inline(always)]
    fn touches(&self, other: [f64; 2], at: [f64; 2]) -> bool {
        let (ex, ey) = (other[0] - at[0], other[1] - at[1]);
        ex * ex + ey * ey < self.reach.touch
    }

    /// Where an agent at `at` ends that is pushed out of one at `other`, if they touch.
    #[inline(always)]
    pub(super) fn pushed(&mut self, at: [f64; 2], other: [f64; 2]) -> [f64; 2] {
        let away = [at[0] - other[0], at[1] - other[1]];
        let distance = length(away);
        if distance > self.diameter {
            return at;
        }
        let direction = if distance > 0.0 {
            [away[0] / distance, away[1] / distance]
        } else {
            self.towards_centre(at)
        };
        let push = self.diameter + GAP - distance;
        let mut at = [at[0] + direction[0] * push, at[1] + direction[1] * push];
        if away[0] < JITTER_BELOW && away[1] < JITTER_BELOW {
            self.jitter_events += 1;
            if let Some(stream) = &mut self.jitter {
                at = at.map(|value| value + stream.between(0.0, JITTER));
            }
        }
        at
    }

    /// The way out of an agent at the very same place, which the authors' simulator does not find.
    fn towards_centre(&self, at: [f64; 2]) -> [f64; 2] {
        let inward = [self.centre[0] - at[0], self.centre[1] - at[1]];
        let distance = length(inward);
        if distance > 0.0 {
            [inward[0] / distance, inward[1] / distance]
        } else {
            [1.0, 0.0]
        }
    }
}

#[inline(always)]
fn length([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}
