//! Turns white pixels into grey values: averages cells, and stretches the values to the full range.

use super::canvas::{BAND, Canvas};
use pulp::{Arch, Simd, WithSimd};

/// Number of columns that one machine word holds.
const ABREAST: usize = 4;
/// Bits of the first row of all columns in a machine word.
const FIRST_ROWS: u64 = 0x0001_0001_0001_0001;

/// The cells of a picture: pixel p of a side of `size` pixels belongs to cell floor(p * resolution / size).
#[derive(Debug, Clone)]
pub(super) struct Cells {
    resolution: usize,
    /// First x of each column of cells, and the x after the last column.
    columns: Vec<usize>,
    /// For each band, the parts of rows of cells that the band contains.
    bands: Vec<Vec<Part>>,
    /// Number of pixels across each cell, by axis.
    extent: [Vec<u32>; 2],
}

/// The pixels of one row of cells in a band.
#[derive(Debug, Clone, Copy)]
struct Part {
    row: usize,
    /// Mask of the part's rows of pixels, in each column of a machine word.
    mask: u64,
}

impl Cells {
    /// Cells for a canvas of `size` pixels, which must be at least `resolution` on each side.
    pub(super) fn new(size: [usize; 2], resolution: usize) -> Self {
        let [column, row] = size.map(|size| {
            (0..size)
                .map(|p| (p * resolution / size) as u32)
                .collect::<Vec<_>>()
        });
        let extent = [&column, &row].map(|cells| {
            let mut extent = vec![0; resolution];
            for &index in cells {
                extent[index as usize] += 1;
            }
            extent
        });
        let columns = (0..=resolution).map(|cell| column.partition_point(|&of| (of as usize) < cell));
        Self {
            resolution,
            columns: columns.collect(),
            bands: row.chunks(BAND).map(parts).collect(),
            extent,
        }
    }

    /// 255 times the share of white in each cell, rounded half to even; index `x * resolution + y`.
    pub(super) fn average(&self, arch: Arch, canvas: &Canvas) -> Vec<u8> {
        let white = arch.dispatch(Count { cells: self, canvas });
        let columns = white.chunks_exact(self.resolution).zip(&self.extent[0]);
        let mut grey = Vec::with_capacity(white.len());
        for (column, &width) in columns {
            let cells = column.iter().zip(&self.extent[1]);
            grey.extend(cells.map(|(&white, &height)| share(white, width * height)));
        }
        grey
    }
}

/// The parts of a band. `rows` lists, for each row of pixels, its row of cells.
fn parts(rows: &[u32]) -> Vec<Part> {
    let mut parts: Vec<Part> = Vec::new();
    for (bit, &row) in rows.iter().enumerate() {
        let row = row as usize;
        match parts.last_mut() {
            Some(part) if part.row == row => part.mask |= FIRST_ROWS << bit,
            _ => parts.push(Part {
                row,
                mask: FIRST_ROWS << bit,
            }),
        }
    }
    parts
}

/// Counts the white pixels in each cell. As a type, this code is compiled for several kinds of CPU: not every CPU counts the bits
/// of a word in one instruction.
struct Count<'a> {
    cells: &'a Cells,
    canvas: &'a Canvas,
}

impl WithSimd for Count<'_> {
    type Output = Vec<u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Vec<u32> {
        let resolution = self.cells.resolution;
        let mut white = vec![0u32; resolution * resolution];
        for (band, parts) in self.cells.bands.iter().enumerate() {
            let band = self.canvas.band(band);
            let ends = self.cells.columns.iter().zip(self.cells.columns.iter().skip(1));
            for (column, (&first, &end)) in white.chunks_exact_mut(resolution).zip(ends) {
                let words = band.get(first..end).unwrap_or_default();
                let (fours, rest) = words.as_chunks::<ABREAST>();
                let mut last = [0; ABREAST];
                last[..rest.len()].copy_from_slice(rest);
                for &four in fours.iter().chain([&last]) {
                    let four = four
                        .iter()
                        .rev()
                        .fold(0, |word, &rows| word << BAND | u64::from(rows));
                    for part in parts {
                        column[part.row] += (four & part.mask).count_ones();
                    }
                }
            }
        }
        white
    }
}

/// round-half-to-even(255 * `white` / `area`). Requires `white <= area` and `area > 0`.
fn share(white: u32, area: u32) -> u8 {
    // Most cells are black, and division is slow.
    if white == 0 {
        return 0;
    }
    let (white, area) = (255 * u64::from(white), u64::from(area));
    let (whole, rest) = (white / area, white % area);
    let up = 2 * rest > area || (2 * rest == area && whole % 2 == 1);
    (whole + u64::from(up)) as u8
}

/// Stretches the values to the range from 0 to (nearly) 255. If all values are equal, all results are 0.
///
/// Stretches and rounds in the same way as the authors' code when it writes a picture to a file.
pub(super) fn stretched(values: &[u8]) -> Vec<u8> {
    let low = values.iter().copied().min().unwrap_or(0);
    let high = values.iter().copied().max().unwrap_or(0);
    let mut table = [0; 256];
    for value in low..=high {
        table[usize::from(value)] = stretch(value, low, high);
    }
    values.iter().map(|&value| table[usize::from(value)]).collect()
}

fn stretch(value: u8, low: u8, high: u8) -> u8 {
    if low == high {
        return 0;
    }
    let t = f64::from(value - low) / f64::from(high - low);
    // Truncate as the authors' code does: multiplying by 1/255 and then by 255 lowers some levels by one.
    let level = f64::from(((t * 256.0) as u32).min(255));
    (level * (1.0 / 255.0) * 255.0) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_hundred_pixels_are_the_authors() {
        for white in 0..=100u32 {
            let theirs = (255.0 * f64::from(white) / 100.0).round_ties_even();
            assert_eq!(f64::from(share(white, 100)), theirs, "{white} of 100");
        }
        // Ties are rounded as in the authors' pictures. (2.55 * 50 in f64 would give 127.)
        assert_eq!(
            [10, 30, 50, 70, 90].map(|white| share(white, 100)),
            [26, 76, 128, 178, 230]
        );
    }

    #[test]
    fn ties_go_to_the_even_value() {
        assert_eq!(
            [share(1, 2), share(1, 510), share(3, 510), share(5, 510)],
            [128, 0, 2, 2]
        );
    }

    #[test]
    fn stretching_uses_the_whole_range() {
        assert_eq!(stretched(&[3, 5, 4]), [0, 255, 128]);
        assert_eq!(stretched(&[0, 255]), [0, 255]);
        assert_eq!(stretched(&[7, 7]), [0, 0]);
    }

    #[test]
    fn cells_of_unequal_size_are_shares_too() {
        let mut canvas = Canvas::new([5, 3]);
        canvas.paint((0..3).flat_map(|x| [[x, 0], [x, 2]]));
        // Cells are 3 and 2 pixels wide, and 2 and 1 pixels high.
        assert_eq!(
            Cells::new([5, 3], 2).average(Arch::Scalar, &canvas),
            [128, 255, 0, 0]
        );
    }
}
