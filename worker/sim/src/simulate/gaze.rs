//! The sensor of a described robot, and the rule of what it sees.
//!
//! Let e be the vector from the observer to another robot's centre, and rho the other robot's radius. Let c, l, r be unit vectors
//! along the middle and the two edges of the cone. The sensor sees the other robot if its centre is within range (`e.e <= R^2`)
//! and one of these conditions holds:
//!
//! - an edge u meets the other robot's body: `e.u >= 0` and `rho^2 - e.e + (e.u)^2 >= 0`, the rule of the paper's rays;
//! - the sensor is no ray, and the other robot's centre is inside the cone. Let A be `cross(r, e) >= 0`, and B `cross(l, e) <=
//!   0`. If the half-angle is at most a right angle, the centre is inside if A, B and `e.c >= 0` hold. Otherwise, the centre is
//!   inside if A or B holds.
//!
//! A ray is a cone whose edges coincide; its readings have the same bits as in [`sight`](super::sight).

use super::{
    drive::{direction, rotate},
    positions::{LANES, Positions},
};
use crate::lanes::{Planar, any, dot, minus, splat};
use murmuration_swarm::{Sensor, World};
use pulp::Simd;
use std::f64::consts::FRAC_PI_2;

/// The region between the edges of a cone.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    /// Empty: the edges coincide.
    Ray,
    /// At most a half plane.
    Narrow,
    /// More than a half plane.
    Wide,
}

/// A sensor on its robot.
#[derive(Debug, Clone, Copy)]
pub(super) struct Eye {
    shape: Shape,
    /// Square of the range.
    range: f64,
    /// Unit vectors along the middle and the edges of the cone, for a robot that heads along x.
    middle: [f64; 2],
    edges: [[f64; 2]; 2],
}

/// A sensor turned to its robot's current heading, in world coordinates.
#[derive(Debug, Clone, Copy)]
pub(super) struct Gaze {
    eye: Eye,
}

/// Robots with consecutive indices and the same size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Group {
    /// Index of the first robot.
    pub(super) first: usize,
    /// Index after the last robot.
    pub(super) end: usize,
    /// Radius of the robots' bodies.
    pub(super) radius: f64,
}

impl Group {
    /// All agents of a world, with bodies of one radius.
    pub(super) fn whole(world: &World, radius: f64) -> Self {
        Self {
            first: 0,
            end: world.agents() as usize,
            radius,
        }
    }

    #[inline(always)]
    pub(super) const fn has(&self, robot: usize) -> bool {
        self.first <= robot && robot < self.end
    }
}

impl Eye {
    /// A sensor that looks at `angle`.
    pub(super) fn new(sensor: &Sensor, angle: f64) -> Self {
        let half = sensor.half_angle();
        Self {
            shape: match half {
                0.0 => Shape::Ray,
                half if half <= FRAC_PI_2 => Shape::Narrow,
                _ => Shape::Wide,
            },
            range: sensor.range().map_or(f64::INFINITY, |range| range * range),
            middle: direction(angle),
            edges: [direction(angle + half), direction(angle - half)],
        }
    }

    pub(super) const fn shape(&self) -> Shape {
        self.shape
    }

    /// (cos, sin) of the angles of the cone's edges.
    pub(super) const fn edges(&self) -> [[f64; 2]; 2] {
        self.edges
    }

    /// (cos, sin) of the sensor's angle.
    pub(super) const fn direction(&self) -> [f64; 2] {
        self.middle
    }

    /// Whether the line from the origin along the unit vector `edge`, as long as the range, meets a box. `sides` are the box's
    /// low and high coordinates by axis.
    fn meets_box(&self, edge: [f64; 2], sides: [[f64; 2]; 2]) -> bool {
        let mut within = [0.0, self.range.sqrt()];
        for (along, side) in edge.into_iter().zip(sides) {
            if along == 0.0 {
                if side[0] > 0.0 || side[1] < 0.0 {
                    return false;
                }
                continue;
            }
            let [a, b] = side.map(|side| side / along);
            within = [within[0].max(a.min(b)), within[1].min(a.max(b))];
        }
        within[0] <= within[1]
    }

    /// The gaze from a robot with this heading.
    #[inline(always)]
    pub(super) fn turned(&self, heading: [f64; 2]) -> Gaze {
        let turned = |direction| rotate(heading, direction);
        Gaze {
            eye: Self {
                middle: turned(self.middle),
                edges: [turned(self.edges[0]), turned(self.edges[1])],
                ..*self
            },
        }
    }
}

impl Gaze {
    /// Largest distance at which the sensor sees a centre.
    pub(super) fn range(&self) -> f64 {
        self.eye.range.sqrt()
    }

    /// The sensor's direction, if the sensor is a ray.
    pub(super) fn ray(&self) -> Option<[f64; 2]> {
        (self.eye.shape == Shape::Ray).then_some(self.eye.middle)
    }

    /// Whether a body at `other` is seen from `at`; `body` is the square of its radius.
    pub(super) fn sees(&self, other: [f64; 2], at: [f64; 2], body: f64) -> bool {
        let e = [other[0] - at[0], other[1] - at[1]];
        let squared = e[0] * e[0] + e[1] * e[1];
        let inside = body - squared;
        let meets = |edge: &[f64; 2]| {
            let along = e[0] * edge[0] + e[1] * edge[1];
            along >= 0.0 && inside + along * along >= 0.0
        };
        squared <= self.eye.range && (self.eye.edges.iter().any(meets) || self.holds(e))
    }

    /// Whether a disc is seen from `at`. The rule is the same as for bodies, except that the disc's nearest point, not its
    /// centre, must be within range.
    pub(super) fn sees_disc(&self, centre: [f64; 2], radius: f64, at: [f64; 2]) -> bool {
        let e = [centre[0] - at[0], centre[1] - at[1]];
        let squared = e[0] * e[0] + e[1] * e[1];
        let inside = radius * radius - squared;
        let meets = |edge: &[f64; 2]| {
            let along = e[0] * edge[0] + e[1] * edge[1];
            along >= 0.0 && inside + along * along >= 0.0
        };
        squared.sqrt() - radius <= self.range() && (self.eye.edges.iter().any(meets) || self.holds(e))
    }

    /// Whether the cone at `at`, cut at the range, meets a box.
    ///
    /// The part of the box within range is connected. So if neither edge of the cone meets this part of the box, the whole part
    /// is between the edges, or nothing of it. The nearest point of the box decides.
    pub(super) fn sees_box(&self, centre: [f64; 2], half: [f64; 2], at: [f64; 2]) -> bool {
        let e = [centre[0] - at[0], centre[1] - at[1]];
        let sides = [0, 1].map(|axis| [e[axis] - half[axis], e[axis] + half[axis]]);
        let nearest = sides.map(|[low, high]| 0.0_f64.max(low).min(high));
        if nearest == [0.0; 2] {
            return true;
        }
        let [x, y] = nearest;
        let meets = |edge: &[f64; 2]| self.eye.meets_box(*edge, sides);
        x * x + y * y <= self.eye.range && (self.eye.edges.iter().any(meets) || self.holds(nearest))
    }

    /// Whether the point at `e` from the observer is between the edges.
    fn holds(&self, e: [f64; 2]) -> bool {
        let cross = |edge: [f64; 2]| edge[0] * e[1] - edge[1] * e[0];
        let [left, right] = self.eye.edges;
        let (beyond_right, before_left) = (cross(right) >= 0.0, cross(left) <= 0.0);
        let along = e[0] * self.eye.middle[0] + e[1] * self.eye.middle[1];
        match self.eye.shape {
            Shape::Ray => false,
            Shape::Narrow => beyond_right && before_left && along >= 0.0,
            Shape::Wide => beyond_right || before_left,
        }
    }

    /// Maximum extent of the cone along the unit vector `normal`, if the cone's apex is at the origin and the cone is cut at
    /// distance 1.
    pub(super) fn reach(&self, normal: [f64; 2]) -> f64 {
        if self.holds(normal) {
            return 1.0;
        }
        let [left, right] = self
            .eye
            .edges
            .map(|edge| edge[0] * normal[0] + edge[1] * normal[1]);
        left.max(right).max(0.0)
    }

    /// Whether a robot of `group` other than `me` is seen from `at`.
    #[inline(always)]
    pub(super) fn sees_any<S: Simd>(
        &self,
        simd: S,
        positions: &Positions,
        me: usize,
        at: [f64; 2],
        group: &Group,
    ) -> bool {
        // Each arm is a separate loop without a branch on the shape.
        match self.eye.shape {
            Shape::Ray => self.scan(simd, positions, me, at, group, Shape::Ray),
            Shape::Narrow => self.scan(simd, positions, me, at, group, Shape::Narrow),
            Shape::Wide => self.scan(simd, positions, me, at, group, Shape::Wide),
        }
    }

    #[inline(always)]
    fn scan<S: Simd>(
        &self,
        simd: S,
        positions: &Positions,
        me: usize,
        at: [f64; 2],
        group: &Group,
        shape: Shape,
    ) -> bool {
        let vectors = Vectors::new(simd, &self.eye);
        let at = splat(simd, at);
        let body = simd.splat_f64s(group.radius * group.radius);
        let zero = simd.splat_f64s(0.0);
        let mut seen = simd.less_than_f64s(zero, zero);
        let blocks = positions.blocks().iter().enumerate();
        for (b, block) in blocks.take(group.end.div_ceil(LANES)).skip(group.first / LANES) {
            let begin = b * LANES;
            let members = [group.first.saturating_sub(begin), group.end - begin];
            for lanes in block.members(simd, me.wrapping_sub(begin), members) {
                let e = minus(simd, [lanes.x, lanes.y], at);
                let squared = dot(simd, e, e);
                let near = vectors.within_range(simd, squared);
                let met = vectors.meet(simd, e, simd.sub_f64s(body, squared), shape);
                let met = simd.and_m64s(simd.and_m64s(lanes.other, near), met);
                seen = simd.or_m64s(seen, met);
            }
        }
        any(simd, seen)
    }
}

/// A gaze in all lanes.
pub(super) struct Vectors<S: Simd> {
    middle: Planar<S>,
    edges: [Planar<S>; 2],
    range: S::f64s,
}

impl<S: Simd> Vectors<S> {
    #[inline(always)]
    fn new(simd: S, eye: &Eye) -> Self {
        Self {
            middle: splat(simd, eye.middle),
            edges: [splat(simd, eye.edges[0]), splat(simd, eye.edges[1])],
            range: simd.splat_f64s(eye.range),
        }
    }

    /// The gaze of an eye whose direction differs by lane.
    pub(super) fn turned(simd: S, eye: &Eye, middle: Planar<S>, edges: [Planar<S>; 2]) -> Self {
        Self {
            middle,
            edges,
            range: simd.splat_f64s(eye.range),
        }
    }

    /// Whether a centre is within range, given the square of its distance.
    #[inline(always)]
    pub(super) fn within_range(&self, simd: S, squared: S::f64s) -> S::m64s {
        simd.less_than_or_equal_f64s(squared, self.range)
    }

    /// Whether bodies within range are seen; `inside` is the square of the radius minus e.e.
    #[inline(always)]
    pub(super) fn meet(&self, simd: S, e: Planar<S>, inside: S::f64s, shape: Shape) -> S::m64s {
        let [left, right] = self.edges;
        let at_left = meets(simd, e, left, inside);
        if shape == Shape::Ray {
            return at_left;
        }
        let zero = simd.splat_f64s(0.0);
        let beyond_right = simd.greater_than_or_equal_f64s(cross(simd, right, e), zero);
        let before_left = simd.less_than_or_equal_f64s(cross(simd, left, e), zero);
        let between = if shape == Shape::Wide {
            simd.or_m64s(beyond_right, before_left)
        } else {
            let ahead = simd.greater_than_or_equal_f64s(dot(simd, e, self.middle), zero);
            simd.and_m64s(ahead, simd.and_m64s(beyond_right, before_left))
        };
        let at_edge = simd.or_m64s(at_left, meets(simd, e, right, inside));
        simd.or_m64s(between, at_edge)
    }
}

/// Whether the half-line along `edge` meets a body; `inside` is the square of the body's radius minus e.e.
#[inline(always)]
fn meets<S: Simd>(simd: S, e: Planar<S>, edge: Planar<S>, inside: S::f64s) -> S::m64s {
    let zero = simd.splat_f64s(0.0);
    let along = dot(simd, e, edge);
    let reached = simd.add_f64s(inside, simd.mul_f64s(along, along));
    simd.and_m64s(
        simd.greater_than_or_equal_f64s(along, zero),
        simd.greater_than_or_equal_f64s(reached, zero),
    )
}

#[inline(always)]
fn cross<S: Simd>(simd: S, a: Planar<S>, b: Planar<S>) -> S::f64s {
    simd.sub_f64s(simd.mul_f64s(a[0], b[1]), simd.mul_f64s(a[1], b[0]))
}
