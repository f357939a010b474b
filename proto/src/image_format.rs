//! How a trajectory becomes a picture.

use crate::{Invalid, World, invalid, record::record, v1};

record! {
    /// The format of the grey picture of a behaviour: its side, and the number of last steps that it shows.
    #[derive(Debug, Clone, Copy, PartialEq, Eq)]
    pub struct ImageFormat {
        /// Side in pixels, 1 to 1,000, and at most the world's smaller side (one canvas pixel per unit).
        resolution: u32,
        /// Steps at the end that are drawn, 2 to 10,000,000; the first of them clears the canvas.
        window: u32,
    }
}

impl ImageFormat {
    /// Number of pixels, `resolution` squared.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.resolution as usize * self.resolution as usize
    }

    /// Validates a format for simulations in `world`.
    ///
    /// # Errors
    /// Names the field that is out of range or too large for the world.
    pub fn for_world(message: v1::ImageFormat, world: &World) -> Result<Self, Invalid> {
        let default = Self::default();
        let resolution = message.resolution.unwrap_or(default.resolution);
        let smaller_side = world.width().min(world.height()) as u32;
        Ok(Self {
            resolution: invalid::whole("resolution", resolution, 1..=smaller_side.min(1000))?,
            window: invalid::whole("window", message.window.unwrap_or(default.window), 2..=10_000_000)?,
        })
    }
}

impl Default for ImageFormat {
    fn default() -> Self {
        Self {
            resolution: 50,
            window: 160,
        }
    }
}

impl From<ImageFormat> for v1::ImageFormat {
    fn from(format: ImageFormat) -> Self {
        Self {
            resolution: Some(format.resolution),
            window: Some(format.window),
        }
    }
}
