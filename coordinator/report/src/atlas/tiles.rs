//! The pictures of the swarms of an atlas: one PNG per tile, so that a page loads only the tiles in view.

use super::Layout;
use crate::{
    ReportError,
    picture::{PictureError, encoded},
};
use murmuration_files::Folder;
use murmuration_swarm::{Controller, PictureShape};

/// Name of the folder of pictures inside the folder of an atlas.
pub(super) const FOLDER: &str = "pictures";

/// Draws the pictures of an atlas's controllers, which the caller adds in the order of the archive.
#[derive(Debug)]
pub struct Tiles {
    layout: Layout,
    shape: PictureShape,
    /// Column and row of the current tile, and the pixels of this tile, row by row.
    current: Option<([usize; 2], Vec<u8>)>,
}

impl Tiles {
    #[must_use]
    pub const fn new(layout: Layout, shape: PictureShape) -> Self {
        Self {
            layout,
            shape,
            current: None,
        }
    }

    /// Adds the picture of a controller: the bytes of an image of one channel. The caller adds all controllers of a tile before
    /// those of the next tile. Controllers outside the atlas's map are skipped. A full tile is written into the atlas's `folder`.
    ///
    /// # Errors
    /// If a tile cannot be written, or the size of the image differs from the specification's.
    pub fn add(
        &mut self,
        folder: &mut Folder,
        controller: &Controller,
        image: &[u8],
    ) -> Result<(), ReportError> {
        let Some([x, y]) = self.layout.pixel(controller) else {
            return Ok(());
        };
        let (values, side) = (self.layout.values(), self.shape.side());
        let tile = [x / values, y / values];
        if self.current.as_ref().is_none_or(|(current, _)| *current != tile) {
            self.flush(folder)?;
        }
        if image.len() != self.shape.bytes() {
            let (shape, bytes) = (self.shape, image.len());
            return Err(undrawn(PictureError::Shape { shape, bytes }));
        }
        let width = values * side;
        let (_, pixels) = self.current.get_or_insert_with(|| (tile, vec![0; width * width]));
        let [left, top] = [x % values * side, y % values * side];
        for row in 0..side {
            for column in 0..side {
                pixels[(top + row) * width + left + column] = image[column * side + row];
            }
        }
        Ok(())
    }

    /// Writes the last tile.
    ///
    /// # Errors
    /// If the tile cannot be written.
    pub fn finish(mut self, folder: &mut Folder) -> Result<(), ReportError> {
        self.flush(folder)
    }

    fn flush(&mut self, folder: &mut Folder) -> Result<(), ReportError> {
        let Some(([column, row], pixels)) = self.current.take() else {
            return Ok(());
        };
        let width = self.layout.values() * self.shape.side();
        let png = encoded(&pixels, [width; 2], png::ColorType::Grayscale).map_err(undrawn)?;
        Ok(folder.bytes(&format!("{FOLDER}/tile-{column}-{row}.png"), &png)?)
    }
}

const fn undrawn(source: PictureError) -> ReportError {
    ReportError::Drawing {
        file: "pictures",
        source,
    }
}
