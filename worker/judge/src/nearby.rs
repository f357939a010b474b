//! The pieces of all agents' paths by where they are, so that only near ones are compared.

use super::{
    geometry::{length, minus},
    window::{Point, mean},
};

/// Cells per piece, at most: an empty cell costs less than a piece that is looked at in vain.
const CELLS: f64 = 4.0;
/// Largest error of a piece by rounding, relative to the reach.
const SLACK: f64 = 1e-9;

/// The part of an agent's path between two neighbouring times.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) agent: usize,
    /// Where it begins and ends.
    pub(super) ends: [Point; 2],
    /// Its place among the pieces of all agents: agent by agent, in the order of time.
    pub(super) place: usize,
}

/// Pieces in the cells of a square grid, each in that of its middle.
#[derive(Debug)]
pub(super) struct Pieces {
    /// Cell by cell.
    sorted: Vec<Piece>,
    /// Where the pieces of each cell begin in `sorted`, and the end of the last.
    begins: Vec<usize>,
    /// The corner of the first cell.
    corner: Point,
    /// Cells along x and y.
    cells: [usize; 2],
    side: f64,
    /// Half the length of the longest piece.
    half: f64,
}

impl Pieces {
    /// The pieces of these paths; looks that reach about as far as `reach` are fast.
    pub(super) fn of(paths: &[Vec<Point>], reach: f64) -> Self {
        let pieces: Vec<Piece> = paths
            .iter()
            .enumerate()
            .flat_map(|(agent, path)| path.windows(2).map(move |ends| (agent, [ends[0], ends[1]])))
            .enumerate()
            .map(|(place, (agent, ends))| Piece { agent, ends, place })
            .collect();
        let longest = pieces
            .iter()
            .map(|piece| length(minus(piece.ends[1], piece.ends[0])));
        let half = longest.fold(0.0, f64::max) / 2.0;
        let middles: Vec<Point> = pieces.iter().map(|piece| mean(&piece.ends)).collect();
        let bound = |start: f64, pick: fn(f64, f64) -> f64| {
            [0, 1].map(|axis| middles.iter().map(|middle| middle[axis]).fold(start, pick))
        };
        let (low, high) = (bound(f64::INFINITY, f64::min), bound(f64::NEG_INFINITY, f64::max));
        let extent = minus(high, low).map(|extent| extent.max(0.0));
        let most = (CELLS * pieces.len() as f64).sqrt().max(1.0);
        let side = (reach + half)
            .max(extent[0].max(extent[1]) / most)
            .max(f64::MIN_POSITIVE);
        let mut grid = Self {
            sorted: Vec::with_capacity(pieces.len()),
            begins: Vec::new(),
            corner: low,
            cells: extent.map(|extent| (extent / side) as usize + 1),
            side,
            half,
        };
        let cell = |middle: &Point| grid.column(0, middle[0]) * grid.cells[1] + grid.column(1, middle[1]);
        let mut order: Vec<(usize, Piece)> = middles.iter().map(cell).zip(pieces).collect();
        order.sort_by_key(|&(cell, piece)| (cell, piece.place));
        let cells = grid.cells[0] * grid.cells[1];
        grid.begins = (0..=cells)
            .map(|cell| order.partition_point(|&(of, _)| of < cell))
            .collect();
        grid.sorted = order.into_iter().map(|(_, piece)| piece).collect();
        grid
    }

    /// Every piece with a point within `reach` of `point`, and others; in no particular order.
    pub(super) fn near(&self, point: Point, reach: f64) -> impl Iterator<Item = &Piece> {
        let reach = (reach + self.half) * (1.0 + SLACK);
        let [columns, rows] = [0, 1]
            .map(|axis| self.column(axis, point[axis] - reach)..=self.column(axis, point[axis] + reach));
        columns.flat_map(move |column| {
            let first = column * self.cells[1];
            let (begin, end) = (
                self.begins[first + rows.start()],
                self.begins[first + rows.end() + 1],
            );
            &self.sorted[begin..end]
        })
    }

    /// Every piece that may cross one between these ends, and others.
    pub(super) fn across(&self, ends: [Point; 2]) -> impl Iterator<Item = &Piece> {
        self.near(mean(&ends), length(minus(ends[1], ends[0])) / 2.0)
    }

    /// The column or row of a coordinate; beyond the grid, the nearest.
    fn column(&self, axis: usize, value: f64) -> usize {
        // A number under 0 becomes 0.
        let column = ((value - self.corner[axis]) / self.side) as usize;
        column.min(self.cells[axis] - 1)
    }
}
