//! Contour lines of values on a grid (marching squares).

/// A point of a grid: columns from the left, rows from the first, in units of cells; the middle of the first cell is (0, 0).
pub(crate) type Point = [f64; 2];

/// Values at the middles of the cells of a grid, row after row; cells without a value interrupt the lines.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Grid {
    columns: usize,
    values: Vec<Option<f64>>,
}

impl Grid {
    /// A grid with these values; `None` if the values do not fill rows of `columns` values.
    pub(crate) fn new(columns: usize, values: Vec<Option<f64>>) -> Option<Self> {
        let whole = columns > 0 && values.len().is_multiple_of(columns);
        whole.then_some(Self { columns, values })
    }

    /// The segments of the contour line at `level`. Values are interpolated along the edges between cell middles.
    pub(crate) fn contour(&self, level: f64) -> Vec<[Point; 2]> {
        let rows = self.values.len() / self.columns;
        let squares = (1..rows).flat_map(|row| (1..self.columns).map(move |column| (column, row)));
        squares
            .flat_map(|(column, row)| self.in_square([column - 1, row - 1], level))
            .collect()
    }

    /// The segments in the square between the middles of four neighbouring cells.
    fn in_square(&self, [column, row]: [usize; 2], level: f64) -> Vec<[Point; 2]> {
        const CORNERS: [[usize; 2]; 4] = [[0, 0], [1, 0], [1, 1], [0, 1]];
        let value = |[right, down]: [usize; 2]| self.values[(row + down) * self.columns + column + right];
        let [Some(a), Some(b), Some(c), Some(d)] = CORNERS.map(value) else {
            return Vec::new();
        };
        let values = [a, b, c, d];
        let crossing = |from: usize| {
            let to = (from + 1) % 4;
            if (values[from] >= level) == (values[to] >= level) {
                return None;
            }
            let part = (level - values[from]) / (values[to] - values[from]);
            let along = |axis: usize| {
                let [start, end] = [from, to].map(|corner| CORNERS[corner][axis] as f64);
                [column, row][axis] as f64 + start + part * (end - start)
            };
            Some([along(0), along(1)])
        };
        let crossings: Vec<Point> = (0..4).filter_map(crossing).collect();
        match crossings[..] {
            [first, second] => vec![[first, second]],
            // Two opposite corners are above the level: the value at the middle decides whether they are connected.
            [first, second, third, fourth] => {
                let middle = (a + b + c + d) / 4.0;
                match (middle >= level) == (a >= level) {
                    true => vec![[first, second], [third, fourth]],
                    false => vec![[fourth, first], [second, third]],
                }
            }
            _ => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(columns: usize, values: &[f64]) -> Grid {
        Grid::new(columns, values.iter().copied().map(Some).collect()).unwrap()
    }

    #[test]
    fn a_line_is_where_the_interpolated_values_are_the_level() {
        // Values rise from left to right.
        let lines = grid(2, &[0.0, 100.0, 0.0, 100.0]).contour(25.0);
        assert_eq!(lines, [[[0.25, 0.0], [0.25, 1.0]]]);
        assert!(grid(2, &[0.0, 100.0, 0.0, 100.0]).contour(101.0).is_empty());
    }

    #[test]
    fn a_peak_has_a_ring_around_it() {
        let mut values = [0.0; 9];
        values[4] = 100.0;
        let lines = grid(3, &values).contour(50.0);
        assert_eq!(lines.len(), 4);
        for point in lines.iter().flatten() {
            let distance = (point[0] - 1.0).abs() + (point[1] - 1.0).abs();
            assert!((distance - 0.5).abs() < 1e-12, "{point:?}");
        }
    }

    #[test]
    fn a_saddle_is_one_region_or_two_by_its_middle() {
        // The corners at (0, 0) and (1, 1) have the value 100, and the middle has the value 50.
        let saddle = grid(2, &[100.0, 0.0, 0.0, 100.0]);
        let parted = |lines: Vec<[Point; 2]>, corner: Point| {
            let near = |point: &Point| (point[0] - corner[0]).abs() + (point[1] - corner[1]).abs() <= 1.0;
            lines.iter().any(|line| line.iter().all(near))
        };
        // At a level under the middle's value, the lines cut off the corners that are below the level.
        assert!(parted(saddle.contour(25.0), [1.0, 0.0]) && parted(saddle.contour(25.0), [0.0, 1.0]));
        assert!(parted(saddle.contour(75.0), [0.0, 0.0]) && parted(saddle.contour(75.0), [1.0, 1.0]));
    }

    #[test]
    fn cells_without_a_value_interrupt_lines_and_ragged_grids_are_none() {
        let values = vec![Some(0.0), None, Some(0.0), Some(100.0)];
        assert!(Grid::new(2, values).unwrap().contour(50.0).is_empty());
        assert_eq!(Grid::new(2, vec![None; 3]), None);
    }
}
