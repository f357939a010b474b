//! Points transposed in blocks of eight, so that vector instructions measure eight distances at once.
//!
//! A distance is summed from the first dimension to the last, and so has the same bits on every CPU. Callers use `pulp` to run
//! the code with wide vectors.

/// Number of points in a block.
pub(crate) const LANES: usize = 8;

/// Points of the same number of dimensions, in blocks of [`LANES`]. Missing points of the last block are infinitely far away.
#[derive(Debug, Clone, Default)]
pub(crate) struct Lanes {
    dims: usize,
    /// The rows of one block after another; each block has one row per dimension.
    rows: Vec<[f64; LANES]>,
    blocks: usize,
}

impl Lanes {
    /// Transposes `points`, each of `dims` values.
    pub(crate) fn new<'a>(dims: usize, points: impl ExactSizeIterator<Item = &'a [f64]>) -> Self {
        let blocks = points.len().div_ceil(LANES);
        let mut rows = vec![[f64::INFINITY; LANES]; blocks * dims];
        for (index, point) in points.enumerate() {
            let block = &mut rows[index / LANES * dims..][..dims];
            for (row, &value) in block.iter_mut().zip(point) {
                row[index % LANES] = value;
            }
        }
        Self { dims, rows, blocks }
    }

    /// Number of blocks.
    pub(crate) const fn blocks(&self) -> usize {
        self.blocks
    }

    /// The rows of a block, one per dimension.
    #[inline(always)]
    pub(crate) fn rows(&self, block: usize) -> &[[f64; LANES]] {
        &self.rows[block * self.dims..][..self.dims]
    }

    /// Squared distances of a block's points from `origin`. `D` is the number of dimensions as a constant, so that sums stay in
    /// registers, or 0 for any number.
    #[inline(always)]
    pub(crate) fn squared_distances<const D: usize>(&self, block: usize, origin: &[f64]) -> [f64; LANES] {
        let mut sums = [0.0; LANES];
        let mut add = |row: &[f64; LANES], from: f64| {
            for (sum, value) in sums.iter_mut().zip(row) {
                let difference = value - from;
                *sum += difference * difference;
            }
        };
        if D == 0 {
            for (row, &from) in self.rows(block).iter().zip(origin) {
                add(row, from);
            }
        } else {
            let (rows, origin) = (&self.rows[block * D..][..D], &origin[..D]);
            for d in 0..D {
                add(&rows[d], origin[d]);
            }
        }
        sums
    }
}

/// Calls a function that is generic over the number of dimensions. The generic constant is the number of dimensions if the match
/// has an arm for it, and else 0.
macro_rules! with_dimensions {
    ($dims:expr, $dispatch:ident, $task:expr) => {
        match $dims {
            2 => $dispatch::<2>($task),
            3 => $dispatch::<3>($task),
            4 => $dispatch::<4>($task),
            5 => $dispatch::<5>($task),
            6 => $dispatch::<6>($task),
            8 => $dispatch::<8>($task),
            10 => $dispatch::<10>($task),
            15 => $dispatch::<15>($task),
            _ => $dispatch::<0>($task),
        }
    };
}
pub(crate) use with_dimensions;
