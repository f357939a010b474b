//! Sensor readings of one agent of each swarm, whose sensors are rays, and whether another agent touches this agent.

use crate::{
    lanes::{Aligned, Planar, any, dot, magnitude, minus},
    simulate::sight::Reach,
};
use pulp::Simd;

/// Largest sum of the rounding errors of [`Viewer::glance`] and of the definition, relative to the squares of the lengths. Glance
/// and definition both compute a sum of a few products, and each product rounds by 2^-53. The bound is 64 times 2^-53.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Result of a look at all other agents.
#[derive(Clone, Copy)]
pub(super) struct Seen<S: Simd, const SENSORS: usize> {
    /// Whether another agent touches the viewer.
    pub(super) touched: S::m64s,
    /// Whether each sensor hits an agent; unspecified in lanes where another agent touches the viewer, unless documented
    /// otherwise.
    pub(super) hits: [S::m64s; SENSORS],
}

/// An agent of each swarm, which looks at the other agents.
#[derive(Clone, Copy)]
pub(super) struct Viewer<S: Simd, const SENSORS: usize> {
    pub(super) at: Planar<S>,
    /// Unit vectors along the rays of the agent's sensors.
    pub(super) rays: [Planar<S>; SENSORS],
    pub(super) reach: Reach,
}

impl<S: Simd, const SENSORS: usize> Viewer<S, SENSORS> {
    /// Looks at `others` with fused multiply-add; `None` if rounding can change the result. No coordinate of the others or the
    /// viewer may exceed `far` in magnitude. `hits` are correct only in lanes where no agent touches the viewer.
    ///
    /// Let e be the vector from the viewer to another agent's centre. A ray u hits this agent if both e.u and r^2 - e.e + (e.u)^2
    /// are at least 0. If no agent touches the viewer, r^2 - e.e is negative. In this case, the number r^2 - e.e + (e.u)|e.u| is
    /// negative if e.u is negative, and equals r^2 - e.e + (e.u)^2 otherwise. So the sign of this number shows whether the ray
    /// hits an agent, and the sign of its maximum over all other agents whether the ray hits any. The code negates the number and
    /// takes the minimum.
    ///
    /// The result depends on whether e.e - r^2 is below 3 r^2, and e.e - r^2 - (e.u)|e.u| below 0. Two ways to compute these
    /// numbers differ by at most [`ROUNDING`] times the largest possible e.e.
    #[inline(always)]
    pub(super) fn glance(
        self,
        simd: S,
        others: &[Aligned<Planar<S>>],
        far: S::f64s,
    ) -> Option<Seen<S, SENSORS>> {
        let zero = simd.splat_f64s(0.0);
        let body = simd.splat_f64s(-self.reach.body);
        let mut nearest = simd.splat_f64s(f64::INFINITY);
        let mut deepest = [nearest; SENSORS];
        for other in others {
            // This vector is -e, which has the same length as e. The subtraction for -e can take the other agent's position from
            // memory.
            let e = minus(simd, self.at, other.0);
            let outside = simd.mul_add_e_f64s(e[0], e[0], simd.mul_add_e_f64s(e[1], e[1], body));
            nearest = simd.min_f64s(nearest, outside);
            for (ray, deepest) in self.rays.iter().zip(&mut deepest) {
                let along = simd.mul_add_e_f64s(e[0], ray[0], simd.mul_f64s(e[1], ray[1]));
                let depth = simd.mul_add_e_f64s(along, magnitude(simd, along), outside);
                *deepest = simd.min_f64s(*deepest, depth);
            }
        }
        // e is at most 2 far along each axis, so e.e is at most 8 far^2.
        let margin = simd.mul_add_e_f64s(
            simd.mul_f64s(far, far),
            simd.splat_f64s(8.0 * ROUNDING),
            simd.splat_f64s(4.0 * ROUNDING * self.reach.body),
        );
        let nearest = simd.sub_f64s(nearest, simd.splat_f64s(self.reach.touch - self.reach.body));
        let mut sure = simd.greater_than_f64s(magnitude(simd, nearest), margin);
        let mut hits = [sure; SENSORS];
        for (hit, deepest) in hits.iter_mut().zip(deepest) {
            sure = simd.and_m64s(sure, simd.greater_than_f64s(magnitude(simd, deepest), margin));
            *hit = simd.less_than_f64s(deepest, zero);
        }
        let touched = simd.less_than_f64s(nearest, zero);
        (!any(simd, simd.not_m64s(sure))).then_some(Seen { touched, hits })
    }

    /// Whether each sensor hits an agent, by the operations of the definition. The result is also correct where other agents
    /// touch the viewer.
    #[inline(always)]
    pub(super) fn look_among(self, simd: S, others: &[Aligned<Planar<S>>]) -> [S::m64s; SENSORS] {
        let zero = simd.splat_f64s(0.0);
        let body = simd.splat_f64s(self.reach.body);
        let mut hits = [simd.less_than_f64s(zero, zero); SENSORS];
        for other in others {
            let e = minus(simd, other.0, self.at);
            let inside = simd.sub_f64s(body, dot(simd, e, e));
            for (ray, hit) in self.rays.iter().zip(&mut hits) {
                let along = dot(simd, e, *ray);
                let ahead = simd.greater_than_or_equal_f64s(along, zero);
                let depth = simd.add_f64s(inside, simd.mul_f64s(along, along));
                let met = simd.greater_than_or_equal_f64s(depth, zero);
                *hit = simd.or_m64s(*hit, simd.and_m64s(ahead, met));
            }
        }
        hits
    }
}
