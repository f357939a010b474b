//! Pushes agents out of the agents that they touch, and then reads their sensors.

use super::{
    Batch,
    collide::{self, Touched},
    cones::ConeViewer,
    look::Seen,
};
use crate::{
    lanes::{Planar, any, splat},
    simulate::collide::PASSES,
};
use pulp::{Simd, WithSimd};

impl<S: Simd, const SENSORS: usize, const CONES: bool> Batch<S, SENSORS, CONES> {
    /// Pushes agent `i` out of all agents that it touches in any lane, and then reads its sensors.
    ///
    /// This code is a separate function, because its need for registers would slow down steps of agents that touch no other
    /// agent.
    #[inline(never)]
    pub(super) fn settle_apart(&mut self, simd: S, i: usize) {
        simd.vectorize(Settling::<_, SENSORS, CONES, false> { batch: self, simd, i });
    }

    /// Like [`Batch::settle_apart`], but pushes lane by lane.
    #[inline(never)]
    fn settle_by_lane(&mut self, simd: S, i: usize) {
        simd.vectorize(Settling::<_, SENSORS, CONES, true> { batch: self, simd, i });
    }

    /// Pushes agent `i` lane by lane if `BY_LANE`, or in all lanes at once if not. If a push in all lanes at once is impossible,
    /// returns `false`, and the agent stays where it was.
    #[inline(always)]
    fn settle<const BY_LANE: bool>(&mut self, simd: S, i: usize) -> bool {
        let agents = self.bodies.len();
        let heading = self.bodies[i].0.heading;
        let mut at = self.positions[agents + i].0;
        // Keeps the agent from touching itself.
        self.positions[i].0 = splat(simd, [f64::INFINITY; 2]);
        let touch = simd.splat_f64s(self.reach.touch);
        let mut passes = 0;
        let sensed = loop {
            // One pass is usually enough. An agent that needs two passes probably needs all passes.
            if passes == 1
                && let Some(Seen { touched, hits }) = self.glance(simd, i, at, heading)
                && !any(simd, touched)
            {
                break hits;
            }
            let positions = &self.positions[..agents];
            let touched = Touched::by(simd, positions, at, touch);
            let crowded = any(simd, touched.lanes(simd));
            if !crowded || passes == PASSES {
                break self.look(simd, i, at, heading, crowded);
            }
            if BY_LANE {
                at = collide::pass_by_lane(simd, &mut self.collisions, positions, at, touch);
            } else {
                match collide::pass(simd, self.diameter, touch, positions, touched, at) {
                    Some(pushed) => at = pushed,
                    None => return false,
                }
            }
            passes += 1;
        };
        self.bodies[i].0.sensed = sensed;
        self.bodies[i].0.crowded = passes > 0;
        self.place(i, at);
        true
    }

    /// Sensor reading of agent `i`; `crowded` is whether another agent touches it in any lane.
    #[inline(always)]
    fn look(
        &mut self,
        simd: S,
        i: usize,
        at: Planar<S>,
        heading: Planar<S>,
        crowded: bool,
    ) -> [S::m64s; SENSORS] {
        if !crowded && let Some(seen) = self.glance(simd, i, at, heading) {
            return seen.hits;
        }
        self.reach_to(simd, at);
        let viewer = self.viewer(simd, at, heading);
        match &self.cones {
            Some(cones) if CONES => {
                cones.by_definition(simd, ConeViewer::of(viewer, heading), self.others(i))
            }
            _ => viewer.look_among(simd, self.others(i)),
        }
    }
}

/// [`Batch::settle`] as a type, so that the code is compiled for this CPU's instructions without being inlined.
struct Settling<'a, S: Simd, const SENSORS: usize, const CONES: bool, const BY_LANE: bool> {
    batch: &'a mut Batch<S, SENSORS, CONES>,
    simd: S,
    i: usize,
}

impl<S: Simd, const SENSORS: usize, const CONES: bool, const BY_LANE: bool> WithSimd
    for Settling<'_, S, SENSORS, CONES, BY_LANE>
{
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        if BY_LANE {
            self.batch.settle::<true>(self.simd, self.i);
        } else if self.batch.jitters || !self.batch.settle::<false>(self.simd, self.i) {
            self.batch.settle_by_lane(self.simd, self.i);
        }
    }
}
