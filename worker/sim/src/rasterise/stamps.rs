//! Small drawings as columns of bits, drawn once and stamped on the canvas many times.

use crate::lanes::{Planar, plus, splat};
use pulp::Simd;

/// Maximum number of columns, and of rows, of a stamp.
pub(super) const SIDE: usize = 16;

/// A drawing about a pixel, in its own cache line.
#[derive(Debug, Clone, Copy, Default)]
#[repr(align(64))]
pub(super) struct Stamp {
    /// Columns of the stamp; the lowest bit of a column is the first row.
    pub(super) columns: [u16; SIDE],
    /// Numbers of columns and rows before the stamp's centre: both are less than [`SIDE`].
    pub(super) before: [u8; 2],
}

/// A stamp for each offset at which a line can end.
#[derive(Debug)]
pub(super) struct Stamps {
    /// Largest component of an offset.
    reach: i32,
    /// Number of offsets along an axis; 0 if there are no stamps.
    side: u32,
    /// Stamps ordered by the offset's x, then y, from `-reach` on; `None` for a drawing that does not fit.
    stamps: Vec<Option<Stamp>>,
}

impl Stamp {
    /// A stamp of some pixels; `None` if they do not fit.
    pub(super) fn of(offsets: &[[i32; 2]]) -> Option<Self> {
        let first = |axis: usize| offsets.iter().map(|offset| offset[axis]).chain([0]).min();
        let corner = [first(0)?, first(1)?];
        let mut columns = [0; SIDE];
        for offset in offsets {
            let [x, y] = [offset[0] - corner[0], offset[1] - corner[1]];
            if y >= SIDE as i32 {
                return None;
            }
            *columns.get_mut(x as usize)? |= 1 << y;
        }
        let before = |corner: i32| u8::try_from(-corner).ok().filter(|&before| before < SIDE as u8);
        Some(Self {
            columns,
            before: [before(corner[0])?, before(corner[1])?],
        })
    }
}

impl Stamps {
    /// Stamps of the drawings with lines up to `length` long; empty if these drawings would not fit.
    pub(super) fn new(length: f64, drawing: impl Fn([i32; 2]) -> Vec<[i32; 2]>) -> Self {
        let fits = length < SIDE as f64;
        let (reach, side) = if fits {
            let reach = length.ceil() as i32;
            (reach, 2 * reach + 1)
        } else {
            (0, 0)
        };
        let along = move || (0..side).map(move |place| place - reach);
        let offsets = along().flat_map(|x| along().map(move |y| [x, y]));
        Self {
            reach,
            side: side as u32,
            stamps: offsets.map(|offset| Stamp::of(&drawing(offset))).collect(),
        }
    }

    /// For each lane, the place (for [`Stamps::at`]) of the stamp with a line to `offset`, and whether the place exists. Offsets
    /// and places are whole numbers.
    #[inline(always)]
    pub(super) fn places<S: Simd>(&self, simd: S, offset: Planar<S>) -> (S::f64s, S::m64s) {
        let (zero, side) = (simd.splat_f64s(0.0), simd.splat_f64s(f64::from(self.side)));
        let [x, y] = plus(simd, offset, splat(simd, [f64::from(self.reach); 2]));
        let column = simd.and_m64s(
            simd.greater_than_or_equal_f64s(x, zero),
            simd.less_than_f64s(x, side),
        );
        let row = simd.and_m64s(
            simd.greater_than_or_equal_f64s(y, zero),
            simd.less_than_f64s(y, side),
        );
        let place = simd.add_f64s(simd.mul_f64s(x, side), y);
        (place, simd.and_m64s(column, row))
    }

    /// The stamp at a place; `None` if its drawing does not fit in a stamp.
    #[inline(always)]
    pub(super) fn at(&self, place: usize) -> Option<&Stamp> {
        self.stamps.get(place)?.as_ref()
    }
}
