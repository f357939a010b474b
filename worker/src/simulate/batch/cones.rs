//! What one agent of each swarm has in its cones, and whether another touches it.
//!
//! The rule is that of [`gaze`](crate::simulate::gaze), and so are the answers. In the frame of a cone, with a the distance of
//! another's centre along the middle and b its distance from the middle, the two edges are one: the other is seen where
//! `s = b cos(h) - a sin(h)` is at most its radius and, if the half-angle h is at most a right angle, `a cos(h) + b sin(h)` is not
//! negative. Two multiplications a number instead of a dozen comparisons; where rounding could decide, the definition does.

use super::look::{Seen, Viewer};
use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, minus, rotate},
    simulate::{
        gaze::{Eye, Vectors},
        sight::Reach,
    },
};
use murmuration_proto::{Robot, Sensor};
use pulp::Simd;

/// Headings are unit vectors up to 10^-12, twice that in their squares: what that and rounding put into a length, relative to
/// the lengths at hand, is below this.
const ROUNDING: f64 = 1e-10;
/// The same of a square of a length, which headings are no part of.
const SQUARE_ROUNDING: f64 = 1e-13;

/// The sensors of all agents of a batch, some of which are cones or have a range.
#[derive(Debug, Clone)]
pub(super) struct Cones<S: Simd, const SENSORS: usize> {
    cones: [Cone<S>; SENSORS],
    radius: f64,
    /// Parts of the margin: whatever the coordinates, and for each unit of the largest one and of its square.
    margin: [f64; 3],
}

/// One sensor: all lanes have its shape, and each its direction.
#[derive(Debug, Clone, Copy)]
struct Cone<S: Simd> {
    /// One of the lanes, for what they have in common.
    eye: Eye,
    edges: [Planar<S>; 2],
    cos: f64,
    sin: f64,
    /// Half the inverse of the range, 0 without a limit, and what is added to as much of a square beyond the body.
    range: [f64; 2],
}

/// An agent of each swarm, about to look into its cones.
#[derive(Clone, Copy)]
pub(super) struct ConeViewer<S: Simd, const SENSORS: usize> {
    pub(super) at: Planar<S>,
    pub(super) heading: Planar<S>,
    /// Unit vectors along the middles of its cones.
    pub(super) middles: [Planar<S>; SENSORS],
    pub(super) reach: Reach,
}

impl<S: Simd, const SENSORS: usize> ConeViewer<S, SENSORS> {
    /// An agent with this heading, with cones about its rays.
    #[inline(always)]
    pub(super) fn of(viewer: Viewer<S, SENSORS>, heading: Planar<S>) -> Self {
        Self {
            at: viewer.at,
            heading,
            middles: viewer.rays,
            reach: viewer.reach,
        }
    }
}

impl<S: Simd, const SENSORS: usize> Cones<S, SENSORS> {
    /// The cones of a robot whose sensors look at these angles, by lane and sensor.
    pub(super) fn new(simd: S, robot: &Robot, angles: &[Vec<f64>]) -> Option<Self> {
        let sensors: &[Sensor; SENSORS] = robot.sensors().try_into().ok()?;
        let radius = robot.radius();
        let cone = |s: usize| {
            let sensor = &sensors[s];
            let eyes = angles.iter().map(|angles| Eye::new(sensor, angles[s]));
            let edge = |side: usize| gathered(simd, eyes.clone().map(|eye| eye.edges()[side]));
            Cone {
                eye: Eye::new(sensor, 0.0),
                edges: [edge(0), edge(1)],
                cos: libm::cos(sensor.half_angle()),
                sin: libm::sin(sensor.half_angle()),
                range: match sensor.range() {
                    None => [0.0, f64::NEG_INFINITY],
                    Some(range) => [0.5 / range, (radius * radius - range * range) * (0.5 / range)],
                },
            }
        };
        let ranges = sensors.iter().filter_map(Sensor::range);
        let shortest = ranges.clone().fold(f64::INFINITY, f64::min);
        let longest = ranges.fold(0.0, f64::max);
        Some(Self {
            cones: std::array::from_fn(cone),
            radius,
            margin: [
                ROUNDING * radius + SQUARE_ROUNDING * longest,
                ROUNDING,
                ROUNDING / radius + SQUARE_ROUNDING / shortest,
            ],
        })
    }

    /// As [`Viewer::look`](super::look::Viewer::look).
    #[inline(always)]
    pub(super) fn look(
        &self,
        simd: S,
        viewer: ConeViewer<S, SENSORS>,
        others: &[Aligned<Planar<S>>],
        far: S::f64s,
    ) -> Seen<S, SENSORS> {
        match self.glance(simd, viewer, others, far) {
            Some(seen) => seen,
            None => self.look_apart(simd, viewer, others),
        }
    }

    /// The look by the formulas above, unless rounding may decide.
    #[inline(always)]
    fn glance(
        &self,
        simd: S,
        viewer: ConeViewer<S, SENSORS>,
        others: &[Aligned<Planar<S>>],
        far: S::f64s,
    ) -> Option<Seen<S, SENSORS>> {
        let zero = simd.splat_f64s(0.0);
        let body = simd.splat_f64s(-viewer.reach.body);
        let radius = simd.splat_f64s(-self.radius);
        let mut nearest = simd.splat_f64s(f64::INFINITY);
        let mut deepest = [nearest; SENSORS];
        for other in others {
            let e = minus(simd, other.0, viewer.at);
            let outside = simd.mul_add_e_f64s(e[0], e[0], simd.mul_add_e_f64s(e[1], e[1], body));
            nearest = simd.min_f64s(nearest, outside);
            for ((cone, middle), deepest) in self.cones.iter().zip(&viewer.middles).zip(&mut deepest) {
                let [cos, sin] = [simd.splat_f64s(cone.cos), simd.splat_f64s(-cone.sin)];
                let along = simd.mul_add_e_f64s(e[0], middle[0], simd.mul_f64s(e[1], middle[1]));
                let beside =
                    simd.mul_add_e_f64s(e[1], middle[0], simd.neg_f64s(simd.mul_f64s(e[0], middle[1])));
                let beside = simd.abs_f64s(beside);
                let mut beyond = simd.mul_add_e_f64s(beside, cos, simd.mul_add_e_f64s(along, sin, radius));
                if !cone.eye.is_wide() {
                    let backwards = simd.splat_f64s(-cone.cos);
                    let aside = simd.mul_f64s(beside, sin);
                    let behind = simd.mul_add_e_f64s(along, backwards, aside);
                    beyond = simd.max_f64s(beyond, behind);
                }
                let [scale, offset] = cone.range;
                let farther = simd.mul_add_e_f64s(outside, simd.splat_f64s(scale), simd.splat_f64s(offset));
                *deepest = simd.min_f64s(*deepest, simd.max_f64s(beyond, farther));
            }
        }
        let [constant, linear, square] = self.margin;
        let [constant, linear, square] = [
            simd.splat_f64s(constant),
            simd.splat_f64s(linear),
            simd.splat_f64s(square),
        ];
        let margin = simd.mul_add_e_f64s(far, simd.mul_add_e_f64s(far, square, linear), constant);
        // Whether another touches is of squares, as for rays.
        let touches = simd.sub_f64s(nearest, simd.splat_f64s(viewer.reach.touch - viewer.reach.body));
        let touch_margin = simd.mul_add_e_f64s(
            simd.mul_f64s(far, far),
            simd.splat_f64s(SQUARE_ROUNDING),
            simd.splat_f64s(SQUARE_ROUNDING * viewer.reach.body),
        );
        let mut sure = simd.greater_than_f64s(simd.abs_f64s(touches), touch_margin);
        let mut hits = [sure; SENSORS];
        for (hit, deepest) in hits.iter_mut().zip(deepest) {
            sure = simd.and_m64s(sure, simd.greater_than_f64s(simd.abs_f64s(deepest), margin));
            *hit = simd.less_than_f64s(deepest, zero);
        }
        let touched = simd.less_than_f64s(touches, zero);
        (!any(simd, simd.not_m64s(sure))).then_some(Seen { touched, hits })
    }

    /// The look by the operations that the definition has.
    #[inline(never)]
    pub(super) fn look_apart(
        &self,
        simd: S,
        viewer: ConeViewer<S, SENSORS>,
        others: &[Aligned<Planar<S>>],
    ) -> Seen<S, SENSORS> {
        let zero = simd.splat_f64s(0.0);
        let none = simd.less_than_f64s(zero, zero);
        let body = simd.splat_f64s(viewer.reach.body);
        let touch = simd.splat_f64s(viewer.reach.touch);
        let (mut touched, mut hits) = (none, [none; SENSORS]);
        for ((cone, &middle), hit) in self.cones.iter().zip(&viewer.middles).zip(&mut hits) {
            let edges = cone.edges.map(|edge| rotate(simd, viewer.heading, edge));
            let vectors = Vectors::turned(simd, &cone.eye, middle, edges);
            for other in others {
                let e = minus(simd, other.0, viewer.at);
                let squared = dot(simd, e, e);
                touched = simd.or_m64s(touched, simd.less_than_f64s(squared, touch));
                let met = vectors.meet(simd, e, simd.sub_f64s(body, squared), cone.eye.shape());
                let near = vectors.within_range(simd, squared);
                *hit = simd.or_m64s(*hit, simd.and_m64s(near, met));
            }
        }
        Seen { touched, hits }
    }
}
