//! Access to the other agents for the agent that moves: by all positions, or by a grid. The two ways give the same results.

use super::{
    gaze::{Gaze, Group},
    grid::Grid,
    positions::{LANES, Positions},
    sight::{Observer, Reach},
};
use pulp::Simd;

/// Positions of all agents.
pub(super) trait Everyone: Others {
    /// Number of agents.
    fn count(&self) -> usize;

    /// Position of agent `i`.
    fn get(&self, i: usize) -> [f64; 2];

    /// Moves agent `i`.
    fn set<S: Simd>(&mut self, simd: S, i: usize, at: [f64; 2]);
}

/// The other agents, as one agent perceives them.
pub(super) trait Others {
    /// Position of agent `i`, as seen from `at`.
    fn near(&self, i: usize, at: [f64; 2]) -> [f64; 2];

    /// The sensor state of `observer`.
    fn sense<S: Simd, const SENSORS: usize>(&self, simd: S, observer: Observer<SENSORS>, reach: Reach) -> u8;

    /// The sensor state of `observer`; `None` if another agent touches it.
    fn sense_unless_touched<S: Simd, const SENSORS: usize>(
        &self,
        simd: S,
        observer: Observer<SENSORS>,
        reach: Reach,
    ) -> Option<u8>;

    /// Adds to `list` the agents of `group` other than `me` whose centres are nearer than `touch` to `at`, in index order.
    fn list_touched<S: Simd>(
        &self,
        simd: S,
        list: &mut Vec<usize>,
        group: &Group,
        me: usize,
        at: [f64; 2],
        touch: f64,
    );

    /// Whether an agent of `group` other than `me` is seen from `at`.
    fn sees<S: Simd>(&self, simd: S, gaze: &Gaze, group: &Group, me: usize, at: [f64; 2]) -> bool;
}

impl Everyone for Positions {
    fn count(&self) -> usize {
        self.count()
    }

    #[inline(always)]
    fn get(&self, i: usize) -> [f64; 2] {
        self.get(i)
    }

    #[inline(always)]
    fn set<S: Simd>(&mut self, simd: S, i: usize, at: [f64; 2]) {
        self.set(simd, i, at);
    }
}

impl Others for Positions {
    #[inline(always)]
    fn near(&self, i: usize, _: [f64; 2]) -> [f64; 2] {
        self.get(i)
    }

    #[inline(always)]
    fn sense<S: Simd, const SENSORS: usize>(&self, simd: S, observer: Observer<SENSORS>, reach: Reach) -> u8 {
        observer.sense(simd, self, reach)
    }

    #[inline(always)]
    fn sense_unless_touched<S: Simd, const SENSORS: usize>(
        &self,
        simd: S,
        observer: Observer<SENSORS>,
        reach: Reach,
    ) -> Option<u8> {
        observer.sense_unless_touched(simd, self, reach)
    }

    #[inline(always)]
    fn list_touched<S: Simd>(
        &self,
        simd: S,
        list: &mut Vec<usize>,
        group: &Group,
        me: usize,
        at: [f64; 2],
        touch: f64,
    ) {
        let [x, y] = at.map(|value| simd.splat_f64s(value));
        let reach = Reach::touching(touch);
        let touches = simd.splat_f64s(reach.touch);
        let blocks = self.blocks().iter().enumerate();
        for (b, block) in blocks.take(group.end.div_ceil(LANES)).skip(group.first / LANES) {
            for (v, lanes) in block.vectors(simd, me.wrapping_sub(b * LANES)).enumerate() {
                let [ex, ey] = [simd.sub_f64s(lanes.x, x), simd.sub_f64s(lanes.y, y)];
                let squared = simd.add_f64s(simd.mul_f64s(ex, ex), simd.mul_f64s(ey, ey));
                let near = simd.and_m64s(lanes.other, simd.less_than_f64s(squared, touches));
                if simd.first_true_m64s(near) < S::F64_LANES {
                    let first = b * LANES + v * S::F64_LANES;
                    let near = |&i: &usize| i != me && group.has(i) && reach.touches(self.get(i), at);
                    list.extend((first..first + S::F64_LANES).filter(near));
                }
            }
        }
    }

    #[inline(always)]
    fn sees<S: Simd>(&self, simd: S, gaze: &Gaze, group: &Group, me: usize, at: [f64; 2]) -> bool {
        gaze.sees_any(simd, self, me, at, group)
    }
}

impl Everyone for Grid {
    fn count(&self) -> usize {
        self.count()
    }

    fn get(&self, i: usize) -> [f64; 2] {
        self.get(i)
    }

    fn set<S: Simd>(&mut self, _: S, i: usize, at: [f64; 2]) {
        self.set(i, at);
    }
}

impl Others for Grid {
    fn near(&self, i: usize, _: [f64; 2]) -> [f64; 2] {
        self.get(i)
    }

    fn sense<S: Simd, const SENSORS: usize>(&self, _: S, observer: Observer<SENSORS>, reach: Reach) -> u8 {
        self.sense(&observer, reach)
    }

    fn sense_unless_touched<S: Simd, const SENSORS: usize>(
        &self,
        _: S,
        observer: Observer<SENSORS>,
        reach: Reach,
    ) -> Option<u8> {
        let touched = self.touches_any(observer.index, observer.at, reach);
        (!touched).then(|| self.sense(&observer, reach))
    }

    fn list_touched<S: Simd>(
        &self,
        _: S,
        list: &mut Vec<usize>,
        group: &Group,
        me: usize,
        at: [f64; 2],
        touch: f64,
    ) {
        let before = list.len();
        let reach = Reach::touching(touch);
        list.extend(self.touching(me, at, reach).filter(|&i| group.has(i)));
        list[before..].sort_unstable();
    }

    fn sees<S: Simd>(&self, _: S, gaze: &Gaze, group: &Group, me: usize, at: [f64; 2]) -> bool {
        self.sees(gaze, group, me, at)
    }
}
