//! A spatial index of the pieces of all agents' paths, so that only nearby pieces are compared.

use super::{
    geometry::{length, minus},
    window::{Point, mean},
};

/// Maximum number of cells per piece: an empty cell costs less than a needless comparison.
const CELLS: f64 = 4.0;
/// Largest rounding error of a piece's position, relative to the reach of a query.
const SLACK: f64 = 1e-9;

/// The part of an agent's path between two neighbouring times.
#[derive(Debug, Clone, Copy)]
pub(super) struct Piece {
    pub(super) agent: usize,
    /// Start and end points of the piece.
    pub(super) ends: [Point; 2],
    /// Index among the pieces of all agents, ordered by agent, then by time.
    pub(super) place: usize,
}

/// Pieces in a square grid, each in the cell of its midpoint.
#[derive(Debug)]
pub(super) struct Pieces {
    /// Pieces ordered by cell.
    sorted: Vec<Piece>,
    /// Index in `sorted` of each cell's first piece, and the length of `sorted` at the end.
    begins: Vec<usize>,
    /// The corner of the first cell.
    corner: Point,
    /// Numbers of cells along x and y.
    cells: [usize; 2],
    side: f64,
    /// Half the length of the longest piece.
    half: f64,
}

impl Pieces {
    /// Indexes the pieces of these paths. Queries with a reach of about `reach` are fast.
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

    /// All pieces with a point within `reach` of `point`, and some other pieces, in no particular order.
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

    /// All pieces that can cross the piece with these ends, and some other pieces.
    pub(super) fn across(&self, ends: [Point; 2]) -> impl Iterator<Item = &Piece> {
        self.near(mean(&ends), length(minus(ends[1], ends[0])) / 2.0)
    }

    /// The column or row of a coordinate; the nearest column or row if the coordinate is beyond the grid.
    fn column(&self, axis: usize, value: f64) -> usize {
        // The cast turns negative numbers into 0.
        let column = ((value - self.corner[axis]) / self.side) as usize;
        column.min(self.cells[axis] - 1)
    }
}
