//! The pictures of an archive's individuals, as tiles on a few sheets. A page cuts the picture of a point from a sheet.

use crate::picture::{PictureError, rgb, thinned};
use murmuration_swarm::PictureShape;

/// Maximum number of individuals on the map of a page, besides medoids.
pub(crate) const MOST_POINTS: usize = 100_000;
/// Maximum number of individuals that have a picture, and of the pixels of all pictures together.
const MOST_PICTURES: usize = 10_000;
const MOST_PIXELS: usize = 25_000_000;
/// Number of tiles in a row of a sheet, and in a whole sheet.
pub(crate) const COLUMNS: usize = 20;
pub(crate) const TILES: usize = COLUMNS * COLUMNS;

/// The pictures of some individuals, in the order of the archive; empty if a report has no pictures.
#[derive(Debug, Clone, Default)]
pub struct Pictured {
    /// The index of the individual of each tile, ascending.
    pub(crate) indices: Vec<u64>,
    /// The sheets as PNG; every sheet except the last has [`TILES`] tiles.
    pub(crate) sheets: Vec<Vec<u8>>,
}

impl Pictured {
    /// The number of an individual's tile, if the individual has a picture.
    pub(crate) fn tile(&self, index: u64) -> Option<usize> {
        self.indices.binary_search(&index).ok()
    }
}

/// Chooses the pictures of the sheets while an archive is read. Pictures that are not chosen are not kept.
#[derive(Debug)]
pub struct PictureSheets {
    shape: PictureShape,
    /// Individuals whose pictures have not been added yet, the next individual last.
    wanted: Vec<u64>,
    /// The indices of the individuals whose pictures were added, ascending.
    indices: Vec<u64>,
    /// The added pictures, row by row: grey values, or red, green and blue of each pixel if there are several channels.
    tiles: Vec<Vec<u8>>,
}

impl PictureSheets {
    /// Chooses individuals of an archive of `individuals` individuals with pictures of this shape. At most 10,000 evenly spaced
    /// individuals are chosen, fewer if a side of a picture is longer than 50 pixels.
    pub fn of(individuals: usize, shape: PictureShape) -> Self {
        let most = MOST_PICTURES.min(MOST_PIXELS / shape.pixels().max(1));
        let shown = thinned(individuals, MOST_POINTS);
        let chosen = thinned(shown.len(), most).into_iter();
        let mut wanted: Vec<u64> = chosen.map(|place| shown[place] as u64).collect();
        wanted.reverse();
        Self {
            shape,
            wanted,
            indices: Vec::new(),
            tiles: Vec::new(),
        }
    }

    /// Adds the picture of an individual, if the individual was chosen. The caller adds individuals in the order of the archive
    /// and skips individuals without a picture.
    ///
    /// # Errors
    /// [`PictureError`] if the shape of the image differs.
    pub fn add(&mut self, index: u64, image: &[u8]) -> Result<(), PictureError> {
        while self.wanted.last().is_some_and(|&wanted| wanted < index) {
            self.wanted.pop();
        }
        if self.wanted.last() == Some(&index) {
            self.tiles.push(screen(image, self.shape)?);
            self.indices.push(index);
        }
        Ok(())
    }

    /// Encodes the sheets. Encoding blocks the thread for up to two seconds.
    pub fn finish(self) -> Result<Pictured, PictureError> {
        let sheets = self.tiles.chunks(TILES).map(|tiles| sheet(tiles, self.shape));
        Ok(Pictured {
            sheets: sheets.collect::<Result<_, _>>()?,
            indices: self.indices,
        })
    }
}

/// The pixels of an image row by row, as on a screen.
fn screen(image: &[u8], shape: PictureShape) -> Result<Vec<u8>, PictureError> {
    if shape.channels() > 1 || image.len() != shape.bytes() {
        return rgb(image, shape);
    }
    let side = shape.side();
    let mut rows = Vec::with_capacity(image.len());
    for y in 0..side {
        rows.extend((0..side).map(|x| image[x * side + y]));
    }
    Ok(rows)
}

/// Encodes tiles as one PNG with the upper four bits of each value. At the size of a tile the difference is invisible, and the
/// file is half as large.
fn sheet(tiles: &[Vec<u8>], shape: PictureShape) -> Result<Vec<u8>, PictureError> {
    let side = shape.side();
    let (width, height) = (COLUMNS * side, tiles.len().div_ceil(COLUMNS) * side);
    let is_grey = shape.channels() == 1;
    let bytes = if is_grey { side } else { 3 * side };
    let nothing = vec![0; bytes];
    let mut pixels = Vec::with_capacity(height * COLUMNS * bytes);
    for (y, column) in (0..height).flat_map(|y| (0..COLUMNS).map(move |column| (y, column))) {
        let tile = tiles.get(y / side * COLUMNS + column);
        let row = tile.map_or(nothing.as_slice(), |tile| &tile[y % side * bytes..][..bytes]);
        pixels.extend_from_slice(row);
    }
    if is_grey {
        // The width is even, so that no byte has pixels of two rows.
        let pairs = pixels.chunks_exact(2);
        pixels = pairs.map(|pair| pair[0] & 0xf0 | pair[1] >> 4).collect();
    } else {
        pixels.iter_mut().for_each(|value| *value = (*value >> 4) * 17);
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    if is_grey {
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Four);
    } else {
        encoder.set_color(png::ColorType::Rgb);
    }
    encoder.set_filter(png::Filter::NoFilter);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&pixels)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shape(channels: usize, side: usize) -> PictureShape {
        PictureShape::new(channels, side).unwrap()
    }

    /// Width of a sheet, and its pixels as bytes.
    fn decoded(sheet: &[u8]) -> (usize, Vec<u8>) {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(sheet));
        decoder.set_transformations(png::Transformations::EXPAND);
        let mut reader = decoder.read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut pixels).unwrap();
        (info.width as usize, pixels)
    }

    #[test]
    fn every_individual_of_a_small_archive_has_its_tile() {
        let mut sheets = PictureSheets::of(410, shape(1, 2));
        for index in 0..410_u64 {
            let grey = (index % 16 * 17) as u8;
            sheets.add(index, &[grey, 0, 255, grey]).unwrap();
        }
        let pictured = sheets.finish().unwrap();
        assert_eq!(pictured.sheets.len(), 2);
        for index in [0, 21, 399, 405] {
            let tile = pictured.tile(index).unwrap();
            let (width, pixels) = decoded(&pictured.sheets[tile / TILES]);
            let place = tile % TILES;
            let corner = place / COLUMNS * 2 * width + place % COLUMNS * 2;
            let grey = (index % 16 * 17) as u8;
            // Axis 0 of an image is x, which points to the right on a sheet.
            let rows = [corner, corner + 1, corner + width, corner + width + 1].map(|at| pixels[at]);
            assert_eq!(rows, [grey, 255, 0, grey], "{index}");
        }
    }

    #[test]
    fn pictures_are_bounded_and_evenly_chosen() {
        let wanted = |individuals: usize, side: usize| {
            let mut wanted = PictureSheets::of(individuals, shape(1, side)).wanted;
            wanted.reverse();
            wanted
        };
        assert_eq!(wanted(9000, 50).len(), 9000);
        let many = wanted(250_000, 50);
        assert_eq!((many.len(), many[0], many[9999]), (10_000, 0, 249_999));
        assert!(
            many.windows(2)
                .all(|pair| (20..=30).contains(&(pair[1] - pair[0])))
        );
        assert_eq!(wanted(250_000, 100).len(), 2500);
    }

    #[test]
    fn who_has_no_picture_has_no_tile_and_species_have_their_colours() {
        let mut sheets = PictureSheets::of(4, shape(2, 1));
        sheets.add(0, &[255, 0]).unwrap();
        sheets.add(2, &[0, 0]).unwrap();
        assert!(sheets.add(3, &[0]).is_err());
        let pictured = sheets.finish().unwrap();
        assert_eq!(
            [0, 1, 2, 3].map(|index| pictured.tile(index)),
            [Some(0), None, Some(1), None]
        );
        let (_, pixels) = decoded(&pictured.sheets[0]);
        let first = murmuration_model::colours::AGENTS[0].map(|value| value >> 4);
        assert_eq!([0, 1, 2].map(|at| pixels[at] >> 4), first);
        assert_eq!(pixels[3..6], [0; 3]);
    }
}
