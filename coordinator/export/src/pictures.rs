//! `pictures.npz`: NumPy's archive of one array of grey values, written picture by picture.
//!
//! An archive stores a picture column by column (`x * side + y`). The array has the picture row by row, from the top down, as
//! plots show pictures.

use crate::ExportError;
use murmuration_swarm::{CampaignSpec, PictureShape};
use std::{
    fs::File,
    io::Write as _,
    path::{Path, PathBuf},
};
use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// The name of the array's file in the ZIP archive; NumPy calls this array `pictures`.
const ARRAY: &str = "pictures.npy";

/// The shape of the array: individuals, starts if there are several, channels if there are several, rows, columns.
pub(crate) fn shape(spec: &CampaignSpec, individuals: u64) -> Vec<u64> {
    let picture = spec.image().shape();
    let side = picture.side() as u64;
    let several = [spec.starts().get() as u64, picture.channels() as u64];
    let several = several.into_iter().filter(|&count| count > 1);
    [individuals]
        .into_iter()
        .chain(several)
        .chain([side, side])
        .collect()
}

/// The beginning of the array's file, version 1.0 of the format.
fn header(shape: &[u64]) -> Vec<u8> {
    let sizes = shape.iter().map(u64::to_string).collect::<Vec<_>>().join(", ");
    let text = format!("{{'descr': '|u1', 'fortran_order': False, 'shape': ({sizes}), }}");
    // The length of the header before the numbers is a multiple of 64 bytes, and the header ends with a line break.
    let unpadded = 10 + text.len() + 1;
    let padding = unpadded.next_multiple_of(64) - unpadded;
    let text = format!("{text}{}\n", " ".repeat(padding));
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend((text.len() as u16).to_le_bytes());
    header.extend(text.bytes());
    header
}

/// A picture row by row, from a picture column by column.
fn transposed(picture: &[u8], shape: PictureShape) -> Vec<u8> {
    let side = shape.side();
    let mut rows = Vec::with_capacity(picture.len());
    for channel in picture.chunks(shape.pixels()) {
        for y in 0..side {
            rows.extend((0..side).filter_map(|x| channel.get(x * side + y)));
        }
    }
    rows
}

/// A ZIP archive of pictures that is being written.
pub(crate) struct PictureWriter {
    path: PathBuf,
    shape: PictureShape,
    archive: ZipWriter<File>,
}

impl PictureWriter {
    /// A new ZIP archive for the pictures of this number of individuals of a campaign.
    pub(crate) fn create(path: &Path, spec: &CampaignSpec, individuals: u64) -> Result<Self, ExportError> {
        let file = File::create_new(path).map_err(ExportError::file("write", path))?;
        let mut archive = ZipWriter::new(file);
        let options = SimpleFileOptions::default()
            .compression_method(CompressionMethod::Deflated)
            .compression_level(Some(1))
            .large_file(true);
        archive
            .start_file(ARRAY, options)
            .map_err(ExportError::unzipped(path))?;
        archive
            .write_all(&header(&shape(spec, individuals)))
            .map_err(ExportError::file("write", path))?;
        Ok(Self {
            path: path.to_path_buf(),
            shape: spec.image().shape(),
            archive,
        })
    }

    /// Adds the next picture.
    pub(crate) fn add(&mut self, picture: &[u8]) -> Result<(), ExportError> {
        self.archive
            .write_all(&transposed(picture, self.shape))
            .map_err(ExportError::file("write", &self.path))
    }

    /// Writes the end of the ZIP archive. The archive is on disk when this function returns.
    pub(crate) fn finish(self) -> Result<(), ExportError> {
        let path = self.path;
        let file = self.archive.finish().map_err(ExportError::unzipped(&path))?;
        file.sync_all().map_err(ExportError::file("write", &path))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_header_is_numpys() {
        let header = header(&[3, 50, 50]);
        assert_eq!(header.len() % 64, 0);
        assert_eq!(&header[..10], b"\x93NUMPY\x01\x00\x76\x00");
        let message = std::str::from_utf8(&header[10..]).unwrap();
        assert!(message.starts_with("{'descr': '|u1', 'fortran_order': False, 'shape': (3, 50, 50), }"));
        assert!(message.ends_with('\n'));
    }

    #[test]
    fn rows_and_columns_change_places_in_each_channel() {
        let shape = PictureShape::new(2, 2).unwrap();
        let columns = [1, 2, 3, 4, 5, 6, 7, 8];
        assert_eq!(transposed(&columns, shape), [1, 3, 2, 4, 5, 7, 6, 8]);
    }
}
