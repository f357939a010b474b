//! The pictures of the swarms of an atlas: one PNG a tile, so that a page loads what it shows.

use super::Layout;
use crate::{
    ReportError,
    files::Folder,
    picture::{PictureError, encoded},
};
use murmuration_proto::{Controller, PictureShape};
use std::path::Path;

/// The folder of the pictures in that of an atlas.
pub(super) const FOLDER: &str = "pictures";

/// Writes the pictures of the controllers of an atlas, which come in the order of its archive, into the folder
/// `pictures`.
#[derive(Debug)]
pub struct Tiles {
    folder: Folder,
    layout: Layout,
    shape: PictureShape,
    /// Column and row of the tile that is being filled, and its pixels, row by row.
    current: Option<([usize; 2], Vec<u8>)>,
}

impl Tiles {
    /// Into `folder`/pictures, which is made if it does not exist.
    pub fn create(folder: &Path, layout: Layout, shape: PictureShape) -> Result<Self, ReportError> {
        let folder = Folder::create(&folder.join(FOLDER))?;
        Ok(Self {
            folder,
            layout,
            shape,
            current: None,
        })
    }

    /// Adds the picture of a controller: the bytes of an image of one channel. The controllers of a tile come one after
    /// the other; those that the picture of the atlas does not show are left out.
    ///
    /// # Errors
    /// If a tile cannot be written, or the image is of another size.
    pub fn add(&mut self, controller: &Controller, image: &[u8]) -> Result<(), ReportError> {
        let Some([x, y]) = self.layout.pixel(controller) else {
            return Ok(());
        };
        let (values, side) = (self.layout.values(), self.shape.side());
        let tile = [x / values, y / values];
        if self.current.as_ref().is_none_or(|(current, _)| *current != tile) {
            self.flush()?;
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
    pub fn finish(mut self) -> Result<(), ReportError> {
        self.flush()
    }

    fn flush(&mut self) -> Result<(), ReportError> {
        let Some(([column, row], pixels)) = self.current.take() else {
            return Ok(());
        };
        let width = self.layout.values() * self.shape.side();
        let png = encoded(&pixels, [width; 2], png::ColorType::Grayscale).map_err(undrawn)?;
        self.folder.bytes(&format!("tile-{column}-{row}.png"), &png)?;
        Ok(())
    }
}

const fn undrawn(source: PictureError) -> ReportError {
    ReportError::Drawing {
        file: "pictures",
        source,
    }
}
