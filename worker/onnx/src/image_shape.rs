//! The shape of the images that a model takes.

use murmuration_swarm::PictureShape;
use std::fmt;

/// The shape of the images that a model takes. Campaigns have square pictures, but a model's images need not be square.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageShape {
    /// Number of channels, 1 to 4.
    pub channels: usize,
    /// Pixels along axis 0 (x), 1 to 1,000.
    pub height: usize,
    /// Pixels along axis 1 (y), 1 to 1,000.
    pub width: usize,
}

impl ImageShape {
    /// Bytes of an image: the pixels of all channels.
    #[must_use]
    pub const fn bytes(self) -> usize {
        self.channels * self.height * self.width
    }
}

impl From<PictureShape> for ImageShape {
    fn from(pictures: PictureShape) -> Self {
        Self {
            channels: pictures.channels(),
            height: pictures.side(),
            width: pictures.side(),
        }
    }
}

impl fmt::Display for ImageShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            channels,
            height,
            width,
        } = self;
        match channels {
            1 => write!(f, "{height} x {width}"),
            _ => write!(f, "{channels} channels of {height} x {width}"),
        }
    }
}
