//! The image of a behaviour, the right way round.

use super::{PictureError, SIZES};
use murmuration_model::colours;
use murmuration_proto::PictureShape;

/// The image of a behaviour as a PNG, every pixel `scale` pixels wide, without smoothing. One channel is grey. Of several, each
/// is in the colour of its species on black, and where species were at one place their colours add up.
///
/// `image` has the bytes of a picture of this `shape`, as in an evaluation (axis 0 is x); the PNG has x to the right and y down,
/// as on the screen.
///
/// # Errors
/// [`PictureError::Shape`] where there are not as many bytes, [`PictureError::Size`] where the picture would be smaller than 1
/// pixel or wider than 4096.
pub fn image_png(image: &[u8], shape: PictureShape, scale: u32) -> Result<Vec<u8>, PictureError> {
    if image.len() != shape.bytes() {
        return Err(PictureError::Shape {
            shape,
            bytes: image.len(),
        });
    }
    let pixels = shape.side() as u64 * u64::from(scale);
    if pixels == 0 || pixels > u64::from(*SIZES.end()) {
        return Err(PictureError::Size(pixels));
    }
    let (pixels, scale) = (pixels as usize, scale as usize);
    let mut screen = Vec::with_capacity(pixels * pixels);
    for y in 0..pixels {
        let index = |x| x / scale * shape.side() + y / scale;
        match shape.channels() {
            1 => screen.extend((0..pixels).map(|x| image[index(x)])),
            _ => screen.extend((0..pixels).flat_map(|x| coloured(image, shape, index(x)))),
        }
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, pixels as u32, pixels as u32);
    encoder.set_color(match shape.channels() {
        1 => png::ColorType::Grayscale,
        _ => png::ColorType::Rgb,
    });
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&screen)?;
    writer.finish()?;
    Ok(file)
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
        // x = 0: 10 above 20; x = 1: 30 above 40.
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
        // Only the first species is at x = 0, y = 0; both are at x = 1, y = 1; none is elsewhere.
        let image = [255, 0, 0, 255, 0, 0, 0, 255];
        let (width, _, pixels) = decode_png(&image_png(&image, shape(2), 1).unwrap());
        let [first, second] = [colours::AGENTS[0], colours::AGENTS[1]];
        let both: [u8; 3] = std::array::from_fn(|i| first[i].saturating_add(second[i]));
        assert_eq!(width, 2);
        assert_eq!(pixels, [first, [0; 3], [0; 3], both].concat());
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
