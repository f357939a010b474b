//! The image of a behaviour, with x to the right and y down, as on a screen.

use super::{PictureError, SIZES};
use murmuration_model::colours;
use murmuration_swarm::PictureShape;

/// Grey value of the gap between two pictures.
const GAP: u8 = 255;

/// The image of a behaviour as PNG: every pixel of the image is `scale` pixels wide, without smoothing. An image of one channel
/// is grey. In an image of several channels, each species has its colour on black, and the colours of overlapping species add up.
///
/// `image` has the bytes of a picture of this `shape`, as in an evaluation (axis 0 is x). The PNG has x to the right and y down,
/// as on a screen.
///
/// # Errors
/// [`PictureError::Shape`] if the number of bytes differs from the shape's, [`PictureError::Size`] if the picture would have no
/// pixels or be wider than 4096 pixels.
pub fn image_png(image: &[u8], shape: PictureShape, scale: u32) -> Result<Vec<u8>, PictureError> {
    image_row_png(&[image], shape, scale)
}

/// Several images side by side, drawn as [`image_png`] draws an image, with a white line of `scale` pixels between neighbours.
pub fn image_row_png(images: &[&[u8]], shape: PictureShape, scale: u32) -> Result<Vec<u8>, PictureError> {
    images.iter().try_for_each(|image| check(image, shape))?;
    let columns = (shape.side() as u64 + 1) * images.len() as u64;
    let width = columns.saturating_sub(1) * u64::from(scale);
    if width == 0 || width > u64::from(*SIZES.end()) {
        return Err(PictureError::Size(width));
    }
    let (side, scale) = (shape.side(), scale as usize);
    let (width, height) = (width as usize, side * scale);
    let place = |x: usize, y: usize| (images[x / scale / (side + 1)], x / scale % (side + 1), y / scale);
    let pixels = (0..height).flat_map(|y| (0..width).map(move |x| place(x, y)));
    let is_grey = shape.channels() == 1;
    let screen: Vec<u8> = match is_grey {
        true => pixels
            .map(|(image, x, y)| if x == side { GAP } else { image[x * side + y] })
            .collect(),
        false => pixels
            .flat_map(|(image, x, y)| {
                if x == side {
                    [GAP; 3]
                } else {
                    coloured(image, shape, x * side + y)
                }
            })
            .collect(),
    };
    let colours = if is_grey {
        png::ColorType::Grayscale
    } else {
        png::ColorType::Rgb
    };
    encoded(&screen, [width, height], colours)
}

/// Encodes pixels, row by row, as a PNG of this width and height.
pub(crate) fn encoded(
    pixels: &[u8],
    size: [usize; 2],
    colours: png::ColorType,
) -> Result<Vec<u8>, PictureError> {
    encoded_at(pixels, size, colours, None)
}

/// Encodes pixels as [`encoded`] does, with the number of pixels per metre on paper, if it is known.
pub(crate) fn encoded_at(
    pixels: &[u8],
    [width, height]: [usize; 2],
    colours: png::ColorType,
    per_metre: Option<u32>,
) -> Result<Vec<u8>, PictureError> {
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(colours);
    encoder.set_pixel_dims(per_metre.map(|per_metre| png::PixelDimensions {
        xppu: per_metre,
        yppu: per_metre,
        unit: png::Unit::Meter,
    }));
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()?;
    Ok(file)
}

/// The pixels of an image as [`image_png`] shows the image: red, green and blue of each pixel, row by row.
///
/// # Errors
/// [`PictureError::Shape`] if the number of bytes differs from the shape's.
pub fn rgb(image: &[u8], shape: PictureShape) -> Result<Vec<u8>, PictureError> {
    check(image, shape)?;
    let side = shape.side();
    let indices = (0..side).flat_map(|y| (0..side).map(move |x| x * side + y));
    Ok(indices
        .flat_map(|index| match shape.channels() {
            1 => [image[index]; 3],
            _ => coloured(image, shape, index),
        })
        .collect())
}

fn check(image: &[u8], shape: PictureShape) -> Result<(), PictureError> {
    match image.len() == shape.bytes() {
        true => Ok(()),
        false => Err(PictureError::Shape {
            shape,
            bytes: image.len(),
        }),
    }
}

/// The sum of the species' colours at a pixel.
fn coloured(image: &[u8], shape: PictureShape, pixel: usize) -> colours::Rgb {
    let mut sum = [0_u8; 3];
    for (channel, colour) in image.chunks_exact(shape.pixels()).zip(colours::AGENTS) {
        let light = colours::over(colour, channel[pixel], [0; 3]);
        for (sum, light) in sum.iter_mut().zip(light) {
            *sum = sum.saturating_add(light);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::decode_png;

    fn shape(channels: usize) -> PictureShape {
        PictureShape::new(channels, 2).unwrap()
    }

    #[test]
    fn x_goes_right_and_y_goes_down() {
        // The image has 10 above 20 in the left column (x = 0), and 30 above 40 in the right column (x = 1).
        let (width, height, pixels) = decode_png(&image_png(&[10, 20, 30, 40], shape(1), 1).unwrap());
        assert_eq!((width, height), (2, 2));
        assert_eq!(pixels, [10, 30, 20, 40]);
    }

    #[test]
    fn every_pixel_becomes_a_square() {
        let (width, _, pixels) = decode_png(&image_png(&[10, 20, 30, 40], shape(1), 2).unwrap());
        assert_eq!(width, 4);
        assert_eq!(
            pixels,
            [10, 10, 30, 30, 10, 10, 30, 30, 20, 20, 40, 40, 20, 20, 40, 40]
        );
    }

    #[test]
    fn every_species_has_its_colour_and_colours_add_up() {
        // The first species alone is at x = 0, y = 0. Both species are at x = 1, y = 1. The other two pixels are empty.
        let image = [255, 0, 0, 255, 0, 0, 0, 255];
        let (width, _, pixels) = decode_png(&image_png(&image, shape(2), 1).unwrap());
        let [first, second] = [colours::AGENTS[0], colours::AGENTS[1]];
        let both: [u8; 3] = std::array::from_fn(|i| first[i].saturating_add(second[i]));
        assert_eq!(width, 2);
        assert_eq!(pixels, [first, [0; 3], [0; 3], both].concat());
    }

    #[test]
    fn pictures_of_a_row_have_a_white_line_between_them() {
        let row = image_row_png(&[&[10, 20, 30, 40], &[1, 2, 3, 4]], shape(1), 1).unwrap();
        let (width, height, pixels) = decode_png(&row);
        assert_eq!((width, height), (5, 2));
        assert_eq!(pixels, [10, 30, 255, 1, 3, 20, 40, 255, 2, 4]);
        assert!(matches!(
            image_row_png(&[], shape(1), 1),
            Err(PictureError::Size(0))
        ));
        assert!(image_row_png(&[&[0; 4], &[0; 3]], shape(1), 1).is_err());
    }

    #[test]
    fn the_pixels_of_a_screen_are_those_of_the_png() {
        let image = [255, 0, 0, 255, 0, 0, 0, 255];
        let (_, _, pixels) = decode_png(&image_png(&image, shape(2), 1).unwrap());
        assert_eq!(rgb(&image, shape(2)).unwrap(), pixels);
        assert_eq!(
            rgb(&[1, 2, 3, 4], shape(1)).unwrap(),
            [1, 1, 1, 3, 3, 3, 2, 2, 2, 4, 4, 4]
        );
        assert!(rgb(&[1], shape(1)).is_err());
    }

    #[test]
    fn what_has_not_the_shape_is_refused() {
        for (bytes, channels) in [(3, 1), (5, 1), (0, 1), (4, 2)] {
            let error = image_png(&vec![0; bytes], shape(channels), 1).unwrap_err();
            assert!(matches!(error, PictureError::Shape { .. }), "{error}");
        }
        for scale in [0, 5000, u32::MAX] {
            let error = image_png(&[0; 4], shape(1), scale).unwrap_err();
            assert!(matches!(error, PictureError::Size(_)), "{error}");
        }
    }
}
