//! The choice of the box that a new point joins.

use super::blocks::Boxes;
use crate::lanes::{LANES, with_dimensions};
use pulp::{Arch, Simd, WithSimd};

/// The lane of the box that a new point joins: the nearest, and of several in which the point lies, that with the nearest centre.
///
/// By centres alone, points join wide boxes that they lie outside of, and the boxes of large archives come to overlap.
pub(super) fn choose(boxes: &Boxes, block: usize, point: &[f64]) -> usize {
    with_dimensions!(point.len(), choice, (boxes, block, point))
}

fn choice<const D: usize>((boxes, block, point): (&Boxes, usize, &[f64])) -> usize {
    Arch::new().dispatch(Choice::<D>(boxes, block, point))
}

/// A choice in `D` dimensions, or in any number if `D` is 0.
struct Choice<'a, const D: usize>(&'a Boxes, usize, &'a [f64]);

impl<const D: usize> WithSimd for Choice<'_, D> {
    type Output = usize;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> usize {
        let Self(boxes, block, point) = self;
        let to_box = boxes.squared_distances::<D>(block, point);
        let to_centre = boxes.centre_distances::<D>(block, point);
        let mut best = 0;
        for lane in 1..LANES {
            let nearer = to_box[lane] < to_box[best];
            if nearer || to_box[lane] == to_box[best] && to_centre[lane] < to_centre[best] {
                best = lane;
            }
        }
        best
    }
}
