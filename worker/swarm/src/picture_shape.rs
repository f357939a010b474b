//! The shape of pictures: how many channels, and how many pixels along a side.

use crate::{Invalid, invalid};
use std::fmt;

/// The shape of pictures: square channels of one side, a byte for each pixel of each channel.
///
/// A picture's bytes are in order of channels. Within a channel, pixel (x, y) has index `x * side + y`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct PictureShape {
    channels: usize,
    side: usize,
}

impl PictureShape {
    pub const MAX_CHANNELS: usize = 4;
    /// Maximum number of pixels along a side.
    pub const MAX_SIDE: usize = 1000;
    /// The paper's shape: one channel of 50 x 50 pixels.
    pub const PAPER: Self = Self {
        channels: 1,
        side: 50,
    };

    /// Pictures of `channels` (1 to 4) with `side` x `side` pixels each (1 to 1,000 along a side).
    ///
    /// # Errors
    /// The error names the number that is out of range.
    pub fn new(channels: usize, side: usize) -> Result<Self, Invalid> {
        Ok(Self {
            channels: invalid::whole("channels", channels, 1..=Self::MAX_CHANNELS)?,
            side: invalid::whole("side", side, 1..=Self::MAX_SIDE)?,
        })
    }

    #[must_use]
    pub const fn channels(self) -> usize {
        self.channels
    }

    /// Number of pixels along a side of a channel.
    #[must_use]
    pub const fn side(self) -> usize {
        self.side
    }

    /// Number of pixels of one channel.
    #[must_use]
    pub const fn pixels(self) -> usize {
        self.side * self.side
    }

    /// Number of bytes of a picture: the pixels of all channels.
    #[must_use]
    pub const fn bytes(self) -> usize {
        self.channels * self.pixels()
    }
}

impl fmt::Display for PictureShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { channels, side } = self;
        match channels {
            1 => write!(f, "{side} x {side}"),
            _ => write!(f, "{channels} channels of {side} x {side}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_has_a_byte_for_each_pixel_of_each_channel() {
        let shape = PictureShape::new(3, 50).unwrap();
        assert_eq!((shape.pixels(), shape.bytes()), (2500, 7500));
        assert_eq!(shape.to_string(), "3 channels of 50 x 50");
        assert_eq!(PictureShape::PAPER.to_string(), "50 x 50");
    }

    #[test]
    fn what_no_network_takes_is_refused() {
        let message = |channels, side| PictureShape::new(channels, side).unwrap_err().to_string();
        assert_eq!(message(0, 50), "channels = 0: must be a whole number from 1 to 4");
        assert_eq!(message(5, 50), "channels = 5: must be a whole number from 1 to 4");
        assert_eq!(message(1, 0), "side = 0: must be a whole number from 1 to 1000");
        assert_eq!(
            message(1, 1001),
            "side = 1001: must be a whole number from 1 to 1000"
        );
    }
}
