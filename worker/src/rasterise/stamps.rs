//! Small drawings as columns of bits, drawn once and put on the canvas many times.

/// Most columns, and rows, of a stamp.
pub(super) const SIDE: usize = 16;

/// A drawing about a pixel.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Stamp {
    /// Where its first column and row are from that pixel: not beyond it, and less than [`SIDE`] before it.
    pub(super) corner: [i8; 2],
    /// Its columns, the first row the lowest bit.
    pub(super) columns: [u16; SIDE],
}

/// A stamp for each offset that a line may end at.
#[derive(Debug)]
pub(super) struct Stamps {
    /// Largest component of an offset.
    reach: i32,
    /// Offsets along an axis: 0 where there are no stamps.
    side: u32,
    /// By x, then y, from `-reach`; none where a drawing does not fit.
    stamps: Vec<Option<Stamp>>,
}

impl Stamp {
    /// Some pixels as a stamp, unless they do not fit in one.
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
        let within = |corner: i32| i8::try_from(corner).ok().filter(|&corner| -corner < SIDE as i8);
        Some(Self {
            corner: [within(corner[0])?, within(corner[1])?],
            columns,
        })
    }
}

impl Stamps {
    /// The drawings with lines up to `length` long; none if those would not fit.
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

    /// The stamp with a line to `offset`.
    #[inline(always)]
    pub(super) fn get(&self, [x, y]: [i32; 2]) -> Option<&Stamp> {
        let side = self.side;
        // Negative ones wrap to far outside.
        let (x, y) = (
            x.wrapping_add(self.reach) as u32,
            y.wrapping_add(self.reach) as u32,
        );
        if x < side && y < side {
            self.stamps.get((x * side + y) as usize)?.as_ref()
        } else {
            None
        }
    }
}
