//! Compressed pictures, as workers send them and as the database holds them: most pixels of a behaviour's picture are black.
//!
//! Each picture is a zstd frame (RFC 8878) with its size and a checksum. The frames of an individual's trials follow each other.

use std::{fmt, io};
use zstd::{
    bulk,
    zstd_safe::{self, CParameter},
};

/// Higher levels save less than a tenth of the bytes and take at least twice the time (docs/performance.md).
const LEVEL: i32 = 1;

/// The byte of a frame that holds its flags, and the flag of a frame with a checksum (RFC 8878, section 3.1.1.1.1).
const FLAGS: usize = 4;
const CHECKSUM: u8 = 0b100;

/// A picture of known size that was decompressed without an error once.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CompressedImage {
    frame: Vec<u8>,
    pixels: usize,
}

impl CompressedImage {
    /// The zstd frame.
    #[must_use]
    pub fn frame(&self) -> &[u8] {
        &self.frame
    }

    /// The grey values.
    ///
    /// # Errors
    /// If there is no memory for them.
    pub fn pixels(&self) -> io::Result<Vec<u8>> {
        bulk::decompress(&self.frame, self.pixels)
    }

    /// Whether both are the same picture, whatever compressed them.
    #[must_use]
    pub fn same_pixels(&self, other: &Self) -> bool {
        let same = || Some(self.pixels().ok()? == other.pixels().ok()?);
        self.frame == other.frame || same().unwrap_or(false)
    }
}

/// Compresses pictures, one after the other.
pub struct Compressor(bulk::Compressor<'static>);

impl Compressor {
    /// A compressor for any number of pictures.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn new() -> io::Result<Self> {
        let mut compressor = bulk::Compressor::new(LEVEL)?;
        compressor.set_parameter(CParameter::ChecksumFlag(true))?;
        Ok(Self(compressor))
    }

    /// Compresses the grey values of a picture.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn compress(&mut self, image: &[u8]) -> io::Result<CompressedImage> {
        Ok(CompressedImage {
            frame: self.0.compress(image)?,
            pixels: image.len(),
        })
    }
}

/// Decompresses pictures of one size.
pub struct Decompressor {
    frames: bulk::Decompressor<'static>,
    pixels: usize,
}

/// Why decompression failed, phrased to follow "it is".
#[derive(Debug, PartialEq, Eq)]
pub enum NoImage {
    /// The frames give another size than this many pixels, or are no frames.
    Size { pixels: usize },
    /// A frame cannot be decompressed, or the result does not have its checksum.
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
    /// Decompresses values of this many pixels.
    ///
    /// # Errors
    /// If there is no memory for it.
    pub fn new(pixels: usize) -> io::Result<Self> {
        let frames = bulk::Decompressor::new()?;
        Ok(Self { frames, pixels })
    }

    /// Decompresses one or more frames that follow each other. Never takes memory for more pixels than the decompressor's,
    /// whatever sizes the frames give.
    ///
    /// # Errors
    /// See [`NoImage`].
    pub fn decompress(&mut self, frames: &[u8]) -> Result<Vec<u8>, NoImage> {
        let (size, pixels) = (NoImage::Size { pixels: self.pixels }, self.pixels as u64);
        let (mut rest, mut found) = (frames, 0);
        while found < pixels {
            found += match zstd_safe::get_frame_content_size(rest) {
                Ok(Some(content)) if content > 0 && content <= pixels - found => content,
                _ => return Err(size),
            };
            let length = zstd_safe::find_frame_compressed_size(rest).map_err(|_| NoImage::Damaged)?;
            rest = rest.get(length..).ok_or(NoImage::Damaged)?;
        }
        if !rest.is_empty() {
            return Err(NoImage::Damaged);
        }
        let image = self.frames.decompress(frames, self.pixels);
        let image = image.map_err(|_| NoImage::Damaged)?;
        match image.len() == self.pixels {
            true => Ok(image),
            false => Err(NoImage::Damaged),
        }
    }

    /// Checks the first of the frames that follow each other, and cuts it off.
    ///
    /// # Errors
    /// See [`NoImage`]. A frame without a checksum, or one much longer than its picture, counts as damaged.
    pub fn take_frame(&mut self, frames: &mut &[u8]) -> Result<CompressedImage, NoImage> {
        let length = zstd_safe::find_frame_compressed_size(frames).map_err(|_| NoImage::Damaged)?;
        let (frame, rest) = frames.split_at_checked(length).ok_or(NoImage::Damaged)?;
        self.decompress(frame)?;
        let has_checksum = frame.get(FLAGS).is_some_and(|flags| flags & CHECKSUM != 0);
        if !has_checksum || frame.len() > zstd_safe::compress_bound(self.pixels) {
            return Err(NoImage::Damaged);
        }
        *frames = rest;
        Ok(CompressedImage {
            frame: frame.to_vec(),
            pixels: self.pixels,
        })
    }
}

#[cfg(test)]
mod tests;
