//! Compression of images in columns: most pixels of a behaviour's picture are black.
//!
//! Each image is a zstd frame of its own, so that it can be read without other images. The frame has the size of the image, and
//! ends with the checksum of the image.

use super::StoreError;
use murmuration_swarm::CampaignSpec;
use rusqlite::Connection;
use std::fmt;
use zstd::{
    bulk,
    zstd_safe::{self, CParameter},
};

/// Level of zstd. Higher levels save less than a tenth of the bytes and take at least twice the time (docs/performance.md).
const LEVEL: i32 = 1;

/// Compresses images, one after the other.
pub(super) struct Compressor(bulk::Compressor<'static>);

impl Compressor {
    /// A compressor for any number of images.
    ///
    /// # Errors
    /// [`StoreError::Compression`] if there is no memory for the compressor.
    pub(super) fn new() -> Result<Self, StoreError> {
        let mut compressor = bulk::Compressor::new(LEVEL).map_err(StoreError::Compression)?;
        compressor
            .set_parameter(CParameter::ChecksumFlag(true))
            .map_err(StoreError::Compression)?;
        Ok(Self(compressor))
    }

    /// Compresses an image to the value of a column.
    ///
    /// # Errors
    /// [`StoreError::Compression`] if there is no memory for the compression.
    pub(super) fn compress(&mut self, image: &[u8]) -> Result<Vec<u8>, StoreError> {
        self.0.compress(image).map_err(StoreError::Compression)
    }
}

/// Decompresses the images of one campaign, which all have the same size.
pub(super) struct Decompressor {
    frames: bulk::Decompressor<'static>,
    pixels: usize,
}

/// Why decoding failed, phrased to follow "it is".
#[derive(Debug, PartialEq, Eq)]
pub(super) enum NoImage {
    /// The value is not a frame of an image with this number of pixels.
    Size {
        /// Pixels of each image of the campaign.
        pixels: usize,
    },
    /// The frame cannot be decompressed, or the image does not match the frame's checksum.
    Damaged,
}

impl fmt::Display for NoImage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Size { pixels } => write!(formatter, "not of {pixels} pixels"),
            Self::Damaged => write!(formatter, "damaged"),
        }
    }
}

impl Decompressor {
    /// A decompressor for the pictures of a campaign's dataset, where each value has one picture.
    ///
    /// # Errors
    /// If the campaign's specification cannot be read, and [`StoreError::Compression`] if there is no memory.
    pub(super) fn of_dataset(connection: &Connection, campaign: i64) -> Result<Self, StoreError> {
        Self::new(spec(connection, campaign)?.image().bytes())
    }

    /// A decompressor for the pictures of a campaign's individuals, where each value has the pictures of all trials.
    ///
    /// # Errors
    /// The errors of [`Decompressor::of_dataset`].
    pub(super) fn of_individuals(connection: &Connection, campaign: i64) -> Result<Self, StoreError> {
        Self::new(spec(connection, campaign)?.individual_bytes())
    }

    fn new(pixels: usize) -> Result<Self, StoreError> {
        let frames = bulk::Decompressor::new().map_err(StoreError::Compression)?;
        Ok(Self { frames, pixels })
    }

    /// Decompresses the image in the value of a column. Never takes memory for more pixels than an image of the campaign has,
    /// whatever size the value gives.
    ///
    /// # Errors
    /// See [`NoImage`].
    pub(super) fn decompress(&mut self, column: &[u8]) -> Result<Vec<u8>, NoImage> {
        let pixels = self.pixels;
        match zstd_safe::get_frame_content_size(column) {
            Ok(Some(message)) if message == pixels as u64 => {}
            _ => return Err(NoImage::Size { pixels }),
        }
        let image = self.frames.decompress(column, pixels);
        let image = image.map_err(|_| NoImage::Damaged)?;
        match image.len() == pixels {
            true => Ok(image),
            false => Err(NoImage::Damaged),
        }
    }
}

fn spec(connection: &Connection, campaign: i64) -> Result<CampaignSpec, StoreError> {
    let mut statement = connection.prepare_cached("SELECT spec FROM campaigns WHERE number = ?1")?;
    let spec: String = statement.query_row([campaign], |row| row.get(0))?;
    CampaignSpec::from_toml(&spec).map_err(|error| StoreError::damaged(error.to_string()))
}

#[cfg(test)]
mod tests;
