//! Sensor readings of one agent of each swarm by its cones, and whether another touches it.
//!
//! The rule is that of [`gaze`](crate::simulate::gaze), and so are the answers; the way there is shorter. With h the half-angle and
//! rho the radius of bodies, another is seen where its centre is in the cone, or less than rho beside it: in a cone of the same
//! opening whose apex is k = rho / sin(h) further back. With e from here to the centre, |e'| its distance from that apex and
//! a' = e.c + k how far along the middle c it is from there, it is inside that cone where
//!
//! ```text
//! C |e'|^2 - a' |a'| <= 0,   C = cos(h) |cos(h)|,   |e'|^2 = e.e + 2 k a' - k^2
//! ```
//!
//! which holds for wide cones too, whose cosine is negative, and with k = 0 in |e'|^2 - rho^2 for rays. Around the apex of a cone
//! the other one has a tip behind the robot that the rule does not have. Nobody is in the tip who does not touch the robot where k
//! is at most 2 rho; where it is more, nobody but who is more than 1.5 rho behind, and nobody is seen who is more than rho / 2
//! behind. Where rounding could decide, the definition does.

use super::look::{Seen, Viewer};
use crate::{
    lanes::{Aligned, Planar, any, dot, gathered, magnitude, minus, rotate},
    simulate::{
        gaze::{Eye, Vectors},
        sight::Reach,
    },
};
use murmuration_proto::{Robot, Sensor};
use pulp::Simd;
use std::f64::consts::{FRAC_PI_2, PI};

/// Headings are unit vectors up to 10^-12, twice that in their squares: what that and rounding put into a length, relative to
/// the lengths at hand, is below this.
const ROUNDING: f64 = 1e-10;
/// The same of a square of a length, which headings are no part of.
const SQUARE_ROUNDING: f64 = 1e-13;
/// The smallest sine of a half-angle for which the apex is moved back; the definition alone decides for other cones.
const SMALLEST_SINE: f64 = 0.01;

/// The sensors of all agents of a batch, some of which are cones or have a range.
#[derive(Debug, Clone)]
pub(super) struct Cones<S: Simd, const SENSORS: usize> {
    cones: [Cone<S>; SENSORS],
    radius: f64,
    /// The same cones with their apexes further back; `None` where only the definition decides.
    moved: Option<Moved<SENSORS>>,
}

/// Cones whose apexes are moved back.
#[derive(Debug, Clone)]
struct Moved<const SENSORS: usize> {
    openings: [Opening; SENSORS],
    /// How far the apexes are moved back at most.
    furthest: f64,
}

/// One sensor: all lanes have its shape, and each its direction.
#[derive(Debug, Clone, Copy)]
struct Cone<S: Simd> {
    /// One of the lanes, for what they have in common.
    eye: Eye,
    edges: [Planar<S>; 2],
    /// Offset to e.e - rho^2 that makes it negative within range.
    range: Option<f64>,
}

/// The cone with the apex further back, as coefficients: of `C |e'|^2` by e.e - rho^2, by a', and whatever they are.
#[derive(Debug, Clone, Copy)]
struct Opening {
    /// How far the apex is moved back: k.
    back: f64,
    outside: f64,
    along: f64,
    constant: f64,
    /// Coefficient by a' and constant of what is positive in the tip, if somebody may be in the tip who does not touch.
    tip: Option<[f64; 2]>,
}

impl Opening {
    /// That of cones of this half-angle, for bodies of this radius; `None` where the apex would be too far back.
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
        // All around: -e.e - rho^2 - a |a| is negative wherever the other is.
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
    /// The cones of these sensors, for bodies of this radius; `None` where an apex would be too far back.
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
                range: sensor.range().map(|range| radius * radius - range * range),
            }
        };
        Some(Self {
            cones: std::array::from_fn(cone),
            radius,
            moved: Moved::new(sensors, radius),
        })
    }

    /// The look by the formulas above, unless rounding may decide. As [`Viewer::glance`](super::look::Viewer::glance).
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
            // The way back, which is as long.
            let e = minus(simd, viewer.at, other.0);
            let outside = simd.mul_add_e_f64s(e[0], e[0], simd.mul_add_e_f64s(e[1], e[1], body));
            nearest = simd.min_f64s(nearest, outside);
            for (s, deepest) in deepest.iter_mut().enumerate() {
                let (cone, opening) = (&self.cones[s], &moved.openings[s]);
                let beyond = cone.beyond(simd, opening, e, viewer.middles[s], outside);
                *deepest = simd.min_f64s(*deepest, beyond);
            }
        }
        // Whether another touches is of squares, as for rays.
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

    /// A number of [`Cone::beyond`] below this decides nothing, where no coordinate is over `far` and no apex is moved back
    /// by more than `back`.
    ///
    /// Rounding and headings change the distance from an edge of the cone by at most `ROUNDING (rho + far + far^2 / rho)`:
    /// the definition squares it. The number is that distance times the distance from the other edge, which is at most |e'|,
    /// 3 far + k; 4 times that leaves room. The number itself is rounded in squares of far + k.
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

    /// Whether each sensor hits, by the operations that the definition has.
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
    /// Negative where another that does not touch is seen; positive where it is not. `e` is the way from its centre to here;
    /// `outside` is e.e - rho^2.
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
        // -a', so that one operation subtracts its square.
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
