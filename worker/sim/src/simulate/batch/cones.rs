//! Sensor readings of one agent of each swarm, whose sensors are cones, and whether another agent touches this agent.
//!
//! The rule and its results are those of [`gaze`](crate::simulate::gaze), but the computation is shorter. Let h be the half-angle
//! and rho the radius of bodies. A sensor sees another agent if the agent's centre is in the cone or less than rho beside the
//! cone. In other words, the centre is in a moved cone of the same opening, whose apex is k = rho / sin(h) further back. Let e be
//! the vector from the viewer to that centre, and |e'| the centre's distance from the moved apex. Let a' = e.c + k be the
//! centre's distance from the moved apex along the middle c. The centre is inside the moved cone if
//!
//! ```text
//! C |e'|^2 - a' |a'| <= 0,   C = cos(h) |cos(h)|,   |e'|^2 = e.e + 2 k a' - k^2
//! ```
//!
//! The formula also holds for wide cones, whose cosine is negative, and for rays if k is 0 and |e'|^2 - rho^2 replaces |e'|^2.
//! Behind the robot, the moved cone has a tip that the rule does not have. If k is at most 2 rho, agents in the tip touch the
//! robot. If k is larger, agents in the tip touch the robot or are more than 1.5 rho behind it. By the rule, a sensor sees no
//! agent that is more than rho / 2 behind. If rounding could change the result, the definition decides.

use super::look::{Seen, Viewer};
use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, magnitude, minus, rotate},
    simulate::{
        gaze::{Eye, Vectors},
        sight::Reach,
    },
};
use murmuration_swarm::{Robot, Sensor};
use pulp::Simd;
use std::f64::consts::{FRAC_PI_2, PI};

/// Upper bound of relative errors of lengths, from rounding and from headings. The length of a heading differs from 1 by at most
/// 10^-12, and its square by at most twice as much.
const ROUNDING: f64 = 1e-10;
/// Upper bound of relative errors of squares of lengths that do not depend on headings.
const SQUARE_ROUNDING: f64 = 1e-13;
/// The smallest sine of a half-angle for which the apex is moved back; for narrower cones the definition decides.
const SMALLEST_SINE: f64 = 0.01;

/// The sensors of all agents of a batch, if some of these sensors are cones or have a range.
#[derive(Debug, Clone)]
pub(super) struct Cones<S: Simd, const SENSORS: usize> {
    cones: [Cone<S>; SENSORS],
    radius: f64,
    /// The moved cones; `None` if only the definition decides.
    moved: Option<Moved<SENSORS>>,
}

/// Cones whose apexes are moved back.
#[derive(Debug, Clone)]
struct Moved<const SENSORS: usize> {
    openings: [Opening; SENSORS],
    /// Largest distance that an apex is moved back.
    furthest: f64,
}

/// One sensor. The shape of a sensor is the same in all lanes; its direction differs between lanes.
#[derive(Debug, Clone, Copy)]
struct Cone<S: Simd> {
    /// The sensor of one lane, for its shape and range, which all lanes share.
    eye: Eye,
    edges: [Planar<S>; 2],
    /// Number whose sum with e.e - rho^2 is negative within range.
    range: Option<f64>,
}

/// A moved cone as the terms of `C |e'|^2`: the coefficients of e.e - rho^2 and of a', and the constant.
#[derive(Debug, Clone, Copy)]
struct Opening {
    /// Distance that the apex is moved back: k.
    back: f64,
    outside: f64,
    along: f64,
    constant: f64,
    /// Coefficient of a' and constant of a number that is positive in the tip; `None` if all agents in the tip touch the robot.
    tip: Option<[f64; 2]>,
}

impl Opening {
    /// The moved cone for this half-angle and bodies of this radius; `None` if the apex would be too far back.
    fn new(half_angle: f64, radius: f64) -> Option<Self> {
        let square = radius * radius;
        let without_apex = |outside, constant| Self {
            back: 0.0,
            outside,
            along: 0.0,
            constant,
            tip: None,
        };
        if half_angle == 0.0 {
            return Some(without_apex(1.0, 0.0));
        }
        // For a cone all around, -e.e - rho^2 - a |a| is negative everywhere.
        if half_angle >= PI {
            return Some(without_apex(-1.0, -2.0 * square));
        }
        let (sin, cos) = libm::sincos(half_angle);
        let (back, opening) = (radius / sin, cos * cos.abs());
        let has_tip = half_angle < FRAC_PI_2 && back > 2.0 * radius;
        (sin >= SMALLEST_SINE).then(|| Self {
            back,
            outside: opening,
            along: 2.0 * back * opening,
            constant: opening * (square - back * back),
            tip: has_tip.then(|| [-radius, radius * back - square]),
        })
    }
}

impl<const SENSORS: usize> Moved<SENSORS> {
    /// The moved cones of these sensors, for bodies of this radius; `None` if an apex would be too far back.
    fn new(sensors: &[Sensor; SENSORS], radius: f64) -> Option<Self> {
        let openings: Option<Vec<_>> = sensors
            .iter()
            .map(|sensor| Opening::new(sensor.half_angle(), radius))
            .collect();
        let openings: [Opening; SENSORS] = openings?.try_into().ok()?;
        let furthest = openings.iter().map(|opening| opening.back).fold(0.0, f64::max);
        Some(Self { openings, furthest })
    }
}

/// An agent of each swarm, with the directions of its cones.
#[derive(Clone, Copy)]
pub(super) struct ConeViewer<S: Simd, const SENSORS: usize> {
    pub(super) at: Planar<S>,
    pub(super) heading: Planar<S>,
    /// Unit vectors along the middles of the agent's cones.
    pub(super) middles: [Planar<S>; SENSORS],
    pub(super) reach: Reach,
}

impl<S: Simd, const SENSORS: usize> ConeViewer<S, SENSORS> {
    /// An agent with this heading, and with cones about the viewer's rays.
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
    /// The cones of a robot whose sensors have these angles, by lane and sensor.
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
                range: sensor.range().map(|range| radius * radius - range * range),
            }
        };
        Some(Self {
            cones: std::array::from_fn(cone),
            radius,
            moved: Moved::new(sensors, radius),
        })
    }

    /// Reads the sensors by this module's formulas; `None` if rounding can change the result. See
    /// [`Viewer::glance`](super::look::Viewer::glance).
    #[inline(always)]
    pub(super) fn glance(
        &self,
        simd: S,
        viewer: ConeViewer<S, SENSORS>,
        others: &[Aligned<Planar<S>>],
        far: S::f64s,
    ) -> Option<Seen<S, SENSORS>> {
        let moved = self.moved.as_ref()?;
        let margin = self.margin(simd, far, moved.furthest);
        let zero = simd.splat_f64s(0.0);
        let body = simd.splat_f64s(-viewer.reach.body);
        let mut nearest = simd.splat_f64s(f64::INFINITY);
        let mut deepest = [nearest; SENSORS];
        for other in others {
            // This vector is -e, which has the same length as e.
            let e = minus(simd, viewer.at, other.0);
            let outside = simd.mul_add_e_f64s(e[0], e[0], simd.mul_add_e_f64s(e[1], e[1], body));
            nearest = simd.min_f64s(nearest, outside);
            for (s, deepest) in deepest.iter_mut().enumerate() {
                let (cone, opening) = (&self.cones[s], &moved.openings[s]);
                let beyond = cone.beyond(simd, opening, e, viewer.middles[s], outside);
                *deepest = simd.min_f64s(*deepest, beyond);
            }
        }
        // Contact is a comparison of squares, as for rays.
        let touches = simd.sub_f64s(nearest, simd.splat_f64s(viewer.reach.touch - viewer.reach.body));
        let touch_margin = simd.mul_add_e_f64s(
            simd.mul_f64s(far, far),
            simd.splat_f64s(SQUARE_ROUNDING),
            simd.splat_f64s(SQUARE_ROUNDING * viewer.reach.body),
        );
        let mut sure = simd.greater_than_f64s(magnitude(simd, touches), touch_margin);
        let mut hits = [sure; SENSORS];
        for (hit, deepest) in hits.iter_mut().zip(deepest) {
            sure = simd.and_m64s(sure, simd.greater_than_f64s(magnitude(simd, deepest), margin));
            *hit = simd.less_than_f64s(deepest, zero);
        }
        let touched = simd.less_than_f64s(touches, zero);
        (!any(simd, simd.not_m64s(sure))).then_some(Seen { touched, hits })
    }

    /// A result of [`Cone::beyond`] is not certain below this margin. Requires that no coordinate exceeds `far`, and that no apex
    /// is moved back by more than `back`.
    ///
    /// Rounding and headings change the distance from an edge of the cone by at most `ROUNDING (rho + far + far^2 / rho)`,
    /// because the definition squares the distance. The result is this distance times the distance from the other edge. The
    /// distance from the other edge is at most |e'|, so at most 3 far + k; this function uses 4 times this bound. Rounding of the
    /// result itself is relative to the square of far + k.
    #[inline(always)]
    fn margin(&self, simd: S, far: S::f64s, back: f64) -> S::f64s {
        let constant = simd.splat_f64s(ROUNDING * self.radius);
        let linear = simd.splat_f64s(ROUNDING);
        let square = simd.splat_f64s(ROUNDING / self.radius);
        let beside = simd.mul_add_e_f64s(far, simd.mul_add_e_f64s(far, square, linear), constant);
        let across = simd.mul_add_e_f64s(far, simd.splat_f64s(12.0), simd.splat_f64s(4.0 * back));
        let reach = simd.add_f64s(far, simd.splat_f64s(back));
        let own = simd.mul_f64s(simd.mul_f64s(reach, reach), linear);
        simd.mul_add_e_f64s(beside, across, own)
    }

    /// Whether each sensor hits an agent, by the operations of the definition.
    #[inline(always)]
    pub(super) fn by_definition(
        &self,
        simd: S,
        viewer: ConeViewer<S, SENSORS>,
        others: &[Aligned<Planar<S>>],
    ) -> [S::m64s; SENSORS] {
        let zero = simd.splat_f64s(0.0);
        let none = simd.less_than_f64s(zero, zero);
        let body = simd.splat_f64s(viewer.reach.body);
        let mut hits = [none; SENSORS];
        for ((cone, &middle), hit) in self.cones.iter().zip(&viewer.middles).zip(&mut hits) {
            let edges = [
                rotate(simd, viewer.heading, cone.edges[0]),
                rotate(simd, viewer.heading, cone.edges[1]),
            ];
            let vectors = Vectors::turned(simd, &cone.eye, middle, edges);
            for other in others {
                let e = minus(simd, other.0, viewer.at);
                let squared = dot(simd, e, e);
                let met = vectors.meet(simd, e, simd.sub_f64s(body, squared), cone.eye.shape());
                let near = vectors.within_range(simd, squared);
                *hit = simd.or_m64s(*hit, simd.and_m64s(near, met));
            }
        }
        hits
    }
}

impl<S: Simd> Cone<S> {
    /// Negative if the sensor sees another agent that does not touch the viewer; positive if the sensor does not see this agent.
    /// `e` is the vector from the other agent's centre to the viewer; `outside` is e.e - rho^2.
    #[inline(always)]
    fn beyond(
        &self,
        simd: S,
        opening: &Opening,
        e: Planar<S>,
        middle: Planar<S>,
        outside: S::f64s,
    ) -> S::f64s {
        let apex = simd.splat_f64s(-opening.back);
        // The variable is -a', so that one operation subtracts the square of a'.
        let behind = simd.mul_add_e_f64s(e[0], middle[0], simd.mul_add_e_f64s(e[1], middle[1], apex));
        let by_outside = simd.mul_add_e_f64s(
            outside,
            simd.splat_f64s(opening.outside),
            simd.splat_f64s(opening.constant),
        );
        let length = simd.mul_add_e_f64s(behind, simd.splat_f64s(-opening.along), by_outside);
        let mut beyond = simd.mul_add_e_f64s(behind, magnitude(simd, behind), length);
        if let Some([by_along, constant]) = opening.tip {
            let tip = simd.mul_add_e_f64s(behind, simd.splat_f64s(-by_along), simd.splat_f64s(constant));
            beyond = simd.max_f64s(beyond, tip);
        }
        if let Some(range) = self.range {
            beyond = simd.max_f64s(beyond, simd.add_f64s(outside, simd.splat_f64s(range)));
        }
        beyond
    }
}
