//! Blocks of eight points, and of eight boxes, transposed so that vector instructions measure eight distances at once.

use crate::lanes::LANES;

/// Blocks of up to eight points with their indices. Missing points are infinitely far away.
#[derive(Debug, Clone)]
pub(super) struct Points {
    dims: usize,
    /// Block after block, each with one row per dimension.
    rows: Vec<[f64; LANES]>,
    indices: Vec<[u32; LANES]>,
}

/// Blocks of up to eight boxes. Missing boxes are infinitely far away.
#[derive(Debug, Clone)]
pub(super) struct Boxes {
    dims: usize,
    /// Block after block: the least values, one row per dimension, then the largest.
    rows: Vec<[f64; LANES]>,
}

impl Points {
    /// No points of `dims` dimensions.
    pub(super) const fn new(dims: usize) -> Self {
        Self {
            dims,
            rows: Vec::new(),
            indices: Vec::new(),
        }
    }

    /// Adds blocks without points, and returns the number of the first.
    pub(super) fn add_blocks(&mut self, count: usize) -> usize {
        let first = self.indices.len();
        self.indices.resize(first + count, [0; LANES]);
        self.rows
            .resize((first + count) * self.dims, [f64::INFINITY; LANES]);
        first
    }

    /// Puts a point in a lane of a block.
    pub(super) fn write(&mut self, block: usize, lane: usize, point: &[f64], index: u32) {
        let rows = &mut self.rows[block * self.dims..][..self.dims];
        for (row, &value) in rows.iter_mut().zip(point) {
            row[lane] = value;
        }
        self.indices[block][lane] = index;
    }

    #[inline(always)]
    pub(super) fn indices(&self, block: usize) -> &[u32; LANES] {
        &self.indices[block]
    }

    /// Squared distances of a block's points from `origin`, in `D` dimensions, or in any number if `D` is 0.
    #[inline(always)]
    pub(super) fn squared_distances<const D: usize>(&self, block: usize, origin: &[f64]) -> [f64; LANES] {
        let dims = if D == 0 { self.dims } else { D };
        let (rows, origin) = (&self.rows[block * dims..][..dims], &origin[..dims]);
        let mut sums = [0.0; LANES];
        for d in 0..dims {
            for lane in 0..LANES {
                let difference = rows[d][lane] - origin[d];
                sums[lane] += difference * difference;
            }
        }
        sums
    }
}

impl Boxes {
    /// Room for this many boxes, all of them still missing.
    pub(super) fn new(dims: usize, boxes: usize) -> Self {
        let block = |row| {
            if row < dims {
                f64::INFINITY
            } else {
                f64::NEG_INFINITY
            }
        };
        let rows = (0..boxes.div_ceil(LANES)).flat_map(|_| (0..2 * dims).map(block));
        Self {
            dims,
            rows: rows.map(|value| [value; LANES]).collect(),
        }
    }

    /// The rows of least values, and those of largest values.
    #[inline(always)]
    fn rows(&self, block: usize, dims: usize) -> (&[[f64; LANES]], &[[f64; LANES]]) {
        self.rows[block * 2 * dims..][..2 * dims].split_at(dims)
    }

    /// Makes a box contain the space from `low` to `high`.
    pub(super) fn widen(&mut self, number: usize, low: &[f64], high: &[f64]) {
        let rows = &mut self.rows[number / LANES * 2 * self.dims..][..2 * self.dims];
        let (lows, highs) = rows.split_at_mut(self.dims);
        for d in 0..self.dims {
            let (least, most) = (&mut lows[d][number % LANES], &mut highs[d][number % LANES]);
            *least = if low[d] < *least { low[d] } else { *least };
            *most = if high[d] > *most { high[d] } else { *most };
        }
    }

    /// The box around a block's boxes: the least values, then the largest.
    pub(super) fn around(&self, block: usize) -> (Vec<f64>, Vec<f64>) {
        let (low, high) = self.rows(block, self.dims);
        let least = |row: &[f64; LANES]| row.iter().copied().fold(f64::INFINITY, f64::min);
        let most = |row: &[f64; LANES]| row.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (low.iter().map(least).collect(), high.iter().map(most).collect())
    }

    /// Squared distances of `origin` from a block's boxes, each at most that from any point in the box.
    #[inline(always)]
    pub(super) fn squared_distances<const D: usize>(&self, block: usize, origin: &[f64]) -> [f64; LANES] {
        let dims = if D == 0 { self.dims } else { D };
        let ((low, high), origin) = (self.rows(block, dims), &origin[..dims]);
        let mut sums = [0.0; LANES];
        for d in 0..dims {
            for lane in 0..LANES {
                // To the place of the box that is nearest to `origin`. Comparisons are cheaper than `f64::min` and `f64::max`.
                let near = if origin[d] > low[d][lane] {
                    origin[d]
                } else {
                    low[d][lane]
                };
                let near = if near < high[d][lane] { near } else { high[d][lane] };
                let gap = near - origin[d];
                sums[lane] += gap * gap;
            }
        }
        sums
    }

    /// Four times the squared distances of `origin` from the centres of a block's boxes; NaN for missing boxes.
    #[inline(always)]
    pub(super) fn centre_distances<const D: usize>(&self, block: usize, origin: &[f64]) -> [f64; LANES] {
        let dims = if D == 0 { self.dims } else { D };
        let ((low, high), origin) = (self.rows(block, dims), &origin[..dims]);
        let mut sums = [0.0; LANES];
        for d in 0..dims {
            for lane in 0..LANES {
                let twice = (low[d][lane] - origin[d]) + (high[d][lane] - origin[d]);
                sums[lane] += twice * twice;
            }
        }
        sums
    }
}
