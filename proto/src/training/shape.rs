//! The shape of what is between two layers of a network.

use crate::PictureShape;

/// The values of one image between two layers: channels of square pictures (side 1 where flattened).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Number of channels.
    pub channels: usize,
    /// Pixels along a side of each.
    pub side: usize,
}

impl Shape {
    /// Number of values.
    #[must_use]
    pub const fn len(self) -> usize {
        self.channels * self.pixels()
    }

    /// Whether there are no values (never, in a checked architecture).
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// Pixels of one channel.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.side * self.side
    }
}

impl From<PictureShape> for Shape {
    fn from(pictures: PictureShape) -> Self {
        Self {
            channels: pictures.channels(),
            side: pictures.side(),
        }
    }
}
