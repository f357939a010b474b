//! Agents that touch others: they are pushed out, and then look.

use super::{
    Batch,
    collide::{self, Touched},
    cones::ConeViewer,
    look::Seen,
};
use crate::{
    lanes::{Planar, any},
    simulate::collide::PASSES,
};
use pulp::{Simd, WithSimd};

impl<S: Simd, const SENSORS: usize, const CONES: bool> Batch<S, SENSORS, CONES> {
    /// Pushes agent `i` out of all that it touches in any lane, and lets it look.
    ///
    /// It is a function of its own: what it needs registers for would otherwise leave none to agents that touch nobody.
    #[inline(never)]
    pub(super) fn settle_apart(&mut self, simd: S, i: usize) {
        simd.vectorize(Settling { batch: self, simd, i });
    }

    #[inline(always)]
    fn settle(&mut self, simd: S, i: usize) {
        let agents = self.bodies.len();
        let heading = self.bodies[i].0.heading;
        let mut at = self.positions[i].0;
        let touch = simd.splat_f64s(self.reach.touch);
        let mut passes = 0;
        let sensed = loop {
            // One pass is mostly enough. Whoever needs two is likely to need all.
            if passes == 1
                && let Some(Seen { touched, hits }) = self.glance(simd, i, at, heading)
                && !any(simd, touched)
            {
                break hits;
            }
            let touched = Touched::by(simd, &self.positions[..agents], i, at, touch);
            let crowded = any(simd, touched.lanes(simd));
            if !crowded || passes == PASSES {
                break self.look(simd, i, at, heading, crowded);
            }
            at = collide::pass(simd, &mut self.collisions, &self.positions[..agents], touched, at);
            passes += 1;
        };
        self.bodies[i].0.sensed = sensed;
        self.bodies[i].0.crowded = passes > 0;
        self.place(i, at);
    }

    /// What agent `i` sees; `crowded` says whether another touches it in any lane.
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
        let viewer = self.viewer(simd, at, heading);
        match &self.cones {
            Some(cones) if CONES => {
                cones.by_definition(simd, ConeViewer::of(viewer, heading), self.others(i))
            }
            _ => viewer.look_among(simd, self.others(i)),
        }
    }
}

/// [`Batch::settle`], as something that is compiled for the instructions at hand though it is not inlined.
struct Settling<'a, S: Simd, const SENSORS: usize, const CONES: bool> {
    batch: &'a mut Batch<S, SENSORS, CONES>,
    simd: S,
    i: usize,
}

impl<S: Simd, const SENSORS: usize, const CONES: bool> WithSimd for Settling<'_, S, SENSORS, CONES> {
    type Output = ();

    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) {
        self.batch.settle(self.simd, self.i);
    }
}
