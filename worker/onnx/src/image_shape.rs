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

    /// Whether a model that takes images of this shape embeds pictures of the shape `pictures`: pictures of the same shape, or
    /// pictures that are no larger. A grey picture stands for three equal channels.
    ///
    /// A larger picture is refused, because a smaller image would lose some of its pixels, and so whole robots.
    #[must_use]
    pub const fn takes(self, pictures: Self) -> bool {
        let has_channels =
            pictures.channels == self.channels || (pictures.channels == 1 && self.channels == 3);
        has_channels && pictures.height <= self.height && pictures.width <= self.width
    }

    /// The shape of pictures of `bytes` bytes that a model embeds: this shape, or that of the square pictures that it
    /// [takes](Self::takes); `None` if there are no such pictures.
    #[must_use]
    pub fn of_pictures(self, bytes: usize) -> Option<Self> {
        if bytes == self.bytes() {
            return Some(self);
        }
        let square = |channels: usize| {
            let side = (bytes / channels).isqrt();
            let pictures = Self {
                channels,
                height: side,
                width: side,
            };
            (side > 0 && pictures.bytes() == bytes && self.takes(pictures)).then_some(pictures)
        };
        // No number of bytes fits both: a grey picture of that many bytes would be larger than the image.
        square(self.channels).or_else(|| square(1))
    }

    /// For each pixel of an image, in order, the index of the nearest pixel of a picture that the model [takes](Self::takes).
    #[must_use]
    pub fn nearest_pixels(self, pictures: Self) -> Vec<usize> {
        // The pixel of `of` whose square contains the centre of pixel `at` of `all`.
        let nearest = |at: usize, all: usize, of: usize| (2 * at + 1) * of / (2 * all);
        let channel = |channel: usize| channel.min(pictures.channels - 1) * pictures.height * pictures.width;
        let mut pixels = Vec::with_capacity(self.bytes());
        for first in (0..self.channels).map(channel) {
            for row in (0..self.height).map(|x| nearest(x, self.height, pictures.height)) {
                let columns = (0..self.width).map(|y| nearest(y, self.width, pictures.width));
                pixels.extend(columns.map(|column| first + row * pictures.width + column));
            }
        }
        pixels
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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const fn shape(channels: usize, height: usize, width: usize) -> ImageShape {
        ImageShape {
            channels,
            height,
            width,
        }
    }

    #[test]
    fn smaller_pictures_are_enlarged_and_grey_ones_coloured() {
        let colour = shape(3, 84, 84);
        assert!(colour.takes(shape(1, 50, 50)) && colour.takes(shape(3, 84, 84)));
        assert!(!colour.takes(shape(1, 85, 85)) && !colour.takes(shape(2, 50, 50)));
        assert!(!shape(4, 50, 50).takes(shape(1, 50, 50)));
        assert_eq!(colour.of_pictures(2500), Some(shape(1, 50, 50)));
        assert_eq!(colour.of_pictures(7500), Some(shape(3, 50, 50)));
        assert_eq!(shape(1, 12, 8).of_pictures(96), Some(shape(1, 12, 8)));
        for refused in [0, 2501, 85 * 85] {
            assert_eq!(colour.of_pictures(refused), None, "{refused}");
        }
    }

    #[test]
    fn each_pixel_is_the_nearest() {
        assert_eq!(
            shape(1, 2, 5).nearest_pixels(shape(1, 2, 2)),
            [0, 0, 1, 1, 1, 2, 2, 3, 3, 3]
        );
        assert_eq!(shape(3, 1, 2).nearest_pixels(shape(1, 1, 1)), [0; 6]);
        assert_eq!(shape(2, 1, 2).nearest_pixels(shape(2, 1, 1)), [0, 0, 1, 1]);
    }

    proptest! {
        #[test]
        fn the_bytes_of_a_picture_tell_its_shape(
            channels in 1..=4_usize, height in 1..200_usize, width in 1..200_usize, side in 1..200_usize, grey: bool,
        ) {
            let images = shape(channels, height, width);
            let pictures = shape(if grey { 1 } else { channels }, side, side);
            if images.takes(pictures) {
                prop_assert_eq!(images.of_pictures(pictures.bytes()), Some(pictures));
                let pixels = images.nearest_pixels(pictures);
                prop_assert_eq!(pixels.len(), images.bytes());
                // Every pixel of the picture is somewhere in the image.
                let used: std::collections::BTreeSet<usize> = pixels.into_iter().collect();
                prop_assert_eq!(used.into_iter().collect::<Vec<_>>(), (0..pictures.bytes()).collect::<Vec<_>>());
            }
        }
    }
}
