//! How an agent looks: rays that erase, an outline and a heading.

use super::{canvas::Canvas, shapes, stamps::Stamps};
use crate::lanes::{Planar, plus, scaled, words};
use pulp::Simd;

/// Length of a drawn sensor ray, in radii.
const RAY_RADII: f64 = 3.0;
/// Length of a drawn heading, in radii.
const HEADING_RADII: f64 = 2.0;
/// Added to a number below 2^51 in magnitude, it leaves no bits for a fraction, and the whole number in the low ones.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// What draws agents of one radius.
#[derive(Debug)]
pub(super) struct Brush {
    radius: f64,
    outline: Vec<[i32; 2]>,
    rays: Stamps,
    /// Outline and heading together.
    bodies: Stamps,
}

/// Pixels that the lines of an agent run between.
#[derive(Debug, Clone, Copy)]
pub(super) struct Lines<const SENSORS: usize> {
    pub(super) centre: [i32; 2],
    pub(super) heading: [i32; 2],
    pub(super) rays: [[i32; 2]; SENSORS],
}

/// The same of several swarms' agents, in the low halves of words.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ends<S: Simd, const SENSORS: usize> {
    centre: [S::u64s; 2],
    heading: [S::u64s; 2],
    rays: [[S::u64s; 2]; SENSORS],
}

impl Brush {
    pub(super) fn new(radius: f64) -> Self {
        let outline = shapes::circle((radius as i32).max(1));
        Self {
            radius,
            rays: Stamps::new(RAY_RADII * radius, |end| shapes::line([0; 2], end).collect()),
            bodies: Stamps::new(HEADING_RADII * radius, |end| {
                outline.iter().copied().chain(shapes::line([0; 2], end)).collect()
            }),
            outline,
        }
    }

    /// The radius of the bodies that it draws.
    pub(super) const fn radius(&self) -> f64 {
        self.radius
    }

    /// Draws an agent over what is there; pixels outside the canvas are dropped.
    #[inline(always)]
    pub(super) fn draw<const SENSORS: usize>(&self, canvas: &mut Canvas, lines: &Lines<SENSORS>) {
        self.erase_rays(canvas, lines);
        self.paint_body(canvas, lines);
    }

    /// The first half of [`Brush::draw`].
    #[inline(always)]
    pub(super) fn erase_rays<const SENSORS: usize>(&self, canvas: &mut Canvas, lines: &Lines<SENSORS>) {
        for &end in &lines.rays {
            match self.rays.get(offset(end, lines.centre)) {
                Some(stamp) if canvas.contains(lines.centre) => canvas.stamp_black(stamp, lines.centre),
                _ => erase_pixels(canvas, lines.centre, end),
            }
        }
    }

    /// The second half of [`Brush::draw`].
    #[inline(always)]
    pub(super) fn paint_body<const SENSORS: usize>(&self, canvas: &mut Canvas, lines: &Lines<SENSORS>) {
        match self.bodies.get(offset(lines.heading, lines.centre)) {
            Some(stamp) if canvas.contains(lines.centre) => canvas.stamp_white(stamp, lines.centre),
            _ => self.paint_pixels(canvas, lines.centre, lines.heading),
        }
    }

    #[inline(never)]
    fn paint_pixels(&self, canvas: &mut Canvas, centre: [i32; 2], heading: [i32; 2]) {
        let [cx, cy] = centre;
        let outline = self.outline.iter();
        canvas.paint(outline.map(|&[x, y]| [cx.wrapping_add(x), cy.wrapping_add(y)]));
        canvas.paint(shapes::line(centre, heading));
    }
}

#[inline(never)]
fn erase_pixels(canvas: &mut Canvas, centre: [i32; 2], end: [i32; 2]) {
    canvas.erase(shapes::line(centre, end));
}

#[inline(always)]
const fn offset(end: [i32; 2], from: [i32; 2]) -> [i32; 2] {
    [end[0].wrapping_sub(from[0]), end[1].wrapping_sub(from[1])]
}

impl<S: Simd, const SENSORS: usize> Ends<S, SENSORS> {
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        brush: &Brush,
        position: Planar<S>,
        heading: Planar<S>,
        directions: [Planar<S>; SENSORS],
    ) -> Self {
        let length = |radii: f64| simd.splat_f64s(radii * brush.radius);
        let (to_heading, to_ray) = (length(HEADING_RADII), length(RAY_RADII));
        let mut rays = [[simd.splat_u64s(0); 2]; SENSORS];
        for (ray, direction) in rays.iter_mut().zip(directions) {
            *ray = pixel(simd, plus(simd, position, scaled(simd, direction, to_ray)));
        }
        Self {
            centre: pixel(simd, position),
            heading: pixel(simd, plus(simd, position, scaled(simd, heading, to_heading))),
            rays,
        }
    }

    /// Those of one swarm.
    #[inline(always)]
    pub(super) fn lane(&self, lane: usize) -> Lines<SENSORS> {
        let mut rays = [[0; 2]; SENSORS];
        for (to, ray) in rays.iter_mut().zip(&self.rays) {
            *to = whole::<S>(ray, lane);
        }
        Lines {
            centre: whole::<S>(&self.centre, lane),
            heading: whole::<S>(&self.heading, lane),
            rays,
        }
    }
}

#[inline(always)]
fn whole<S: Simd>(pixels: &[S::u64s; 2], lane: usize) -> [i32; 2] {
    [
        words::<S>(&pixels[0])[lane] as i32,
        words::<S>(&pixels[1])[lane] as i32,
    ]
}

#[inline(always)]
fn pixel<S: Simd>(simd: S, [x, y]: Planar<S>) -> [S::u64s; 2] {
    [truncated(simd, x), truncated(simd, y)]
}

/// Numbers without their fractions, as whole numbers in the low 32 bits.
#[inline(always)]
fn truncated<S: Simd>(simd: S, value: S::f64s) -> S::u64s {
    let (whole, zero, one) = (simd.splat_f64s(WHOLE), simd.splat_f64s(0.0), simd.splat_f64s(1.0));
    let nearest = simd.sub_f64s(simd.add_f64s(value, whole), whole);
    // To the nearest, it may have been rounded away from zero.
    let above = simd.select_f64s(simd.greater_than_f64s(nearest, value), one, zero);
    let below = simd.select_f64s(simd.less_than_f64s(nearest, value), one, zero);
    let positive = simd.greater_than_or_equal_f64s(value, zero);
    let nearest = simd.select_f64s(
        positive,
        simd.sub_f64s(nearest, above),
        simd.add_f64s(nearest, below),
    );
    simd.transmute_u64s_f64s(simd.add_f64s(nearest, whole))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use pulp::Scalar;

    proptest! {
        #[test]
        fn truncation_is_that_of_a_cast(value in prop_oneof![-1e6..1e6_f64, -3.0..3.0_f64, (-20i32..20).prop_map(f64::from)]) {
            prop_assert_eq!(truncated(Scalar::new(), value) as i32, value as i32);
        }
    }

    proptest! {
        #[test]
        fn stamps_and_pixels_draw_the_same(
            radius in prop_oneof![Just(5.0), 0.5..8.0_f64],
            agents in prop::collection::vec(
                (prop::array::uniform2(-20.0..160.0_f64), prop::array::uniform2(0.0..6.3_f64)),
                1..20,
            ),
        ) {
            let brush = Brush::new(radius);
            let (mut stamped, mut by_pixel) = (Canvas::new([140, 128]), Canvas::new([140, 128]));
            for (position, angles) in agents {
                let rays = angles.map(|angle| [angle.cos(), angle.sin()]);
                let lines = Ends::new(Scalar::new(), &brush, position, rays[0], rays).lane(0);
                brush.draw(&mut stamped, &lines);
                lines.rays.iter().for_each(|&end| erase_pixels(&mut by_pixel, lines.centre, end));
                brush.paint_pixels(&mut by_pixel, lines.centre, lines.heading);
            }
            for band in 0..8 {
                prop_assert_eq!(stamped.band(band), by_pixel.band(band));
            }
        }
    }
}
