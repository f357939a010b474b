//! Draws an agent: rays that erase, an outline and a heading.

use super::{canvas::Canvas, shapes, stamps::Stamps};
use crate::lanes::{Planar, any, minus, plus, scaled, words};
use pulp::Simd;

/// Length of a drawn sensor ray, in radii.
const RAY_RADII: f64 = 3.0;
/// Length of a drawn heading, in radii.
const HEADING_RADII: f64 = 2.0;
/// 1.5 * 2^52. Adding this constant to a number below 2^51 in magnitude rounds the number, and leaves the whole number in the low
/// bits.
const WHOLE: f64 = 6_755_399_441_055_744.0;

/// Draws agents of one radius.
#[derive(Debug)]
pub(super) struct Brush {
    radius: f64,
    outline: Vec<[i32; 2]>,
    rays: Stamps,
    /// Stamps of an outline and a heading together.
    bodies: Stamps,
}

/// End pixels of the lines of an agent of each swarm, in the low halves of words.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ends<S: Simd, const SENSORS: usize> {
    centre: [S::u64s; 2],
    heading: [S::u64s; 2],
    rays: [[S::u64s; 2]; SENSORS],
    /// Whether all centres are on the canvas, and all stamps exist.
    stamped: bool,
    /// Places in [`Stamps`] of the body's stamp and of each ray's stamp.
    body_stamp: S::u64s,
    ray_stamps: [S::u64s; SENSORS],
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

    /// Radius of the bodies that the brush draws.
    pub(super) const fn radius(&self) -> f64 {
        self.radius
    }

    /// Draws an agent over the existing pixels; pixels outside the canvas are dropped.
    #[inline(always)]
    pub(super) fn draw<S: Simd, const SENSORS: usize>(
        &self,
        canvas: &mut Canvas,
        ends: &Ends<S, SENSORS>,
        lane: usize,
    ) {
        for sensor in 0..SENSORS {
            self.erase_ray(canvas, ends, lane, sensor);
        }
        self.paint_body(canvas, ends, lane);
    }

    /// Erases the ray of one sensor, as a part of [`Brush::draw`]. Call [`Brush::paint_body`] after all sensors.
    #[inline(always)]
    pub(super) fn erase_ray<S: Simd, const SENSORS: usize>(
        &self,
        canvas: &mut Canvas,
        ends: &Ends<S, SENSORS>,
        lane: usize,
        sensor: usize,
    ) {
        let centre = whole::<S>(&ends.centre, lane);
        match self
            .rays
            .at(words::<S>(&ends.ray_stamps[sensor])[lane] as u32 as usize)
        {
            Some(stamp) if ends.stamped => canvas.stamp_black(stamp, centre),
            _ => erase_pixels(canvas, centre, whole::<S>(&ends.rays[sensor], lane)),
        }
    }

    /// Paints outline and heading, the last part of [`Brush::draw`].
    #[inline(always)]
    pub(super) fn paint_body<S: Simd, const SENSORS: usize>(
        &self,
        canvas: &mut Canvas,
        ends: &Ends<S, SENSORS>,
        lane: usize,
    ) {
        let centre = whole::<S>(&ends.centre, lane);
        match self.bodies.at(words::<S>(&ends.body_stamp)[lane] as u32 as usize) {
            Some(stamp) if ends.stamped => canvas.stamp_white(stamp, centre),
            _ => self.paint_pixels(canvas, centre, whole::<S>(&ends.heading, lane)),
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

impl<S: Simd, const SENSORS: usize> Ends<S, SENSORS> {
    /// The end pixels of agents on canvases of `size` pixels.
    #[inline(always)]
    pub(super) fn new(
        simd: S,
        brush: &Brush,
        size: [u32; 2],
        position: Planar<S>,
        heading: Planar<S>,
        directions: [Planar<S>; SENSORS],
    ) -> Self {
        let length = |radii: f64| simd.splat_f64s(radii * brush.radius);
        let (to_heading, to_ray) = (length(HEADING_RADII), length(RAY_RADII));
        let centre = truncated(simd, position);
        let mut stamped = within(simd, centre, size.map(f64::from));
        let heading = truncated(simd, plus(simd, position, scaled(simd, heading, to_heading)));
        let (body_stamp, has_place) = brush.bodies.places(simd, minus(simd, heading, centre));
        stamped = simd.and_m64s(stamped, has_place);
        let mut rays = [[simd.splat_u64s(0); 2]; SENSORS];
        let mut ray_stamps = [simd.splat_u64s(0); SENSORS];
        for ((ray, stamp), direction) in rays.iter_mut().zip(&mut ray_stamps).zip(directions) {
            let end = truncated(simd, plus(simd, position, scaled(simd, direction, to_ray)));
            let (place, has_place) = brush.rays.places(simd, minus(simd, end, centre));
            stamped = simd.and_m64s(stamped, has_place);
            *stamp = in_low_bits(simd, place);
            *ray = pixel(simd, end);
        }
        Self {
            centre: pixel(simd, centre),
            heading: pixel(simd, heading),
            rays,
            stamped: !any(simd, simd.not_m64s(stamped)),
            body_stamp: in_low_bits(simd, body_stamp),
            ray_stamps,
        }
    }
}

/// The lanes whose point has coordinates of at least 0 and below the size.
#[inline(always)]
fn within<S: Simd>(simd: S, [x, y]: Planar<S>, [width, height]: [f64; 2]) -> S::m64s {
    let zero = simd.splat_f64s(0.0);
    let after = simd.and_m64s(
        simd.greater_than_or_equal_f64s(x, zero),
        simd.greater_than_or_equal_f64s(y, zero),
    );
    let before = simd.and_m64s(
        simd.less_than_f64s(x, simd.splat_f64s(width)),
        simd.less_than_f64s(y, simd.splat_f64s(height)),
    );
    simd.and_m64s(after, before)
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
    [in_low_bits(simd, x), in_low_bits(simd, y)]
}

/// Moves whole numbers into the low 32 bits of words.
#[inline(always)]
fn in_low_bits<S: Simd>(simd: S, whole: S::f64s) -> S::u64s {
    simd.transmute_u64s_f64s(simd.add_f64s(whole, simd.splat_f64s(WHOLE)))
}

#[inline(always)]
fn truncated<S: Simd>(simd: S, [x, y]: Planar<S>) -> Planar<S> {
    [without_fraction(simd, x), without_fraction(simd, y)]
}

/// Truncates numbers towards zero.
#[inline(always)]
fn without_fraction<S: Simd>(simd: S, value: S::f64s) -> S::f64s {
    let (whole, zero, one) = (simd.splat_f64s(WHOLE), simd.splat_f64s(0.0), simd.splat_f64s(1.0));
    let nearest = simd.sub_f64s(simd.add_f64s(value, whole), whole);
    // Rounding to the nearest whole number may have rounded away from zero.
    let above = simd.select_f64s(simd.greater_than_f64s(nearest, value), one, zero);
    let below = simd.select_f64s(simd.less_than_f64s(nearest, value), one, zero);
    let positive = simd.greater_than_or_equal_f64s(value, zero);
    simd.select_f64s(
        positive,
        simd.sub_f64s(nearest, above),
        simd.add_f64s(nearest, below),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use pulp::Scalar;

    proptest! {
        #[test]
        fn truncation_is_that_of_a_cast(value in prop_oneof![-1e6..1e6_f64, -3.0..3.0_f64, (-20i32..20).prop_map(f64::from)]) {
            let simd = Scalar::new();
            prop_assert_eq!(in_low_bits(simd, without_fraction(simd, value)) as i32, value as i32);
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
                let ends = Ends::new(Scalar::new(), &brush, stamped.size(), position, rays[0], rays);
                brush.draw(&mut stamped, &ends, 0);
                let [centre, heading] = [ends.centre, ends.heading].map(|point| whole::<Scalar>(&point, 0));
                ends.rays.iter().for_each(|end| erase_pixels(&mut by_pixel, centre, whole::<Scalar>(end, 0)));
                brush.paint_pixels(&mut by_pixel, centre, heading);
            }
            for band in 0..8 {
                prop_assert_eq!(stamped.band(band), by_pixel.band(band));
            }
        }
    }
}
