//! Pictures of a swarm: the image that the search sees, the paths in colour, and the motion as an animation.
//!
//! The functions turn plain data into the bytes of a PNG, GIF or SVG file, or into the pictures of a film, without reading or
//! writing files. The pictures are for people, and no result depends on a picture. The same input always gives the same bytes.

mod animation;
pub mod columns;
mod image;
mod indexed;
mod robot;
mod sketch;
mod trajectory;
mod vector;

pub(crate) use animation::thinned;
pub use animation::{Animation, Film, animation_film, animation_gif};
pub(crate) use image::{encoded, encoded_at};
pub use image::{image_png, image_row_png, rgb};
pub use robot::{robot_svg, sensor_in_words, sensor_reach};
pub use sketch::{Bodies, Colouring};
pub use trajectory::{Paper, trajectory_png};
pub use vector::trajectory_svg;
pub(crate) use vector::{Line, Mark, marks, path_width, tip};

use murmuration_swarm::PictureShape;

/// Allowed sides of a drawing in pixels; an image can be smaller.
pub(crate) const SIZES: std::ops::RangeInclusive<u32> = 16..=4096;

/// Why a picture cannot be made.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    #[error("a picture of {shape} pixels cannot be made of {bytes} bytes")]
    Shape {
        /// The expected shape.
        shape: PictureShape,
        /// Number of bytes of the image.
        bytes: usize,
    },
    #[error("a picture cannot be {0} pixels wide: {min} to {max} is possible", min = SIZES.start(), max = SIZES.end())]
    Size(u64),
    #[error("cannot encode the picture as PNG: {0}")]
    Png(#[from] png::EncodingError),
    #[error("cannot encode the animation as GIF: {0}")]
    Gif(#[from] gif::EncodingError),
}

/// Checks that `pixels` is one of [`SIZES`].
fn side(pixels: u64) -> Result<u32, PictureError> {
    u32::try_from(pixels)
        .ok()
        .filter(|side| SIZES.contains(side))
        .ok_or(PictureError::Size(pixels))
}

#[cfg(test)]
pub(crate) mod sample;
