//! The grey image of a behaviour, the right way round.

use super::{PictureError, SIZES};

/// The grey image of a behaviour as a PNG, every pixel `scale` pixels wide, without smoothing.
///
/// `image` holds `resolution` squared grey values with index `x * resolution + y` (axis 0 is x), as in an evaluation;
/// the picture has x to the right and y down, as on the screen.
///
/// # Errors
/// [`PictureError::NotSquare`] where the bytes are not such a square, [`PictureError::Size`] where the picture would be
/// smaller than 1 pixel or wider than 4096.
pub fn grey_png(image: &[u8], resolution: u32, scale: u32) -> Result<Vec<u8>, PictureError> {
    let cells = resolution as usize;
    if image.is_empty() || image.len() != cells * cells {
        return Err(PictureError::NotSquare {
            resolution,
            bytes: image.len(),
        });
    }
    let pixels = u64::from(resolution) * u64::from(scale);
    if pixels == 0 || pixels > u64::from(*SIZES.end()) {
        return Err(PictureError::Size(pixels));
    }
    let pixels = pixels as usize;
    let scale = scale as usize;
    let mut screen = Vec::with_capacity(pixels * pixels);
    for y in 0..pixels {
        screen.extend((0..pixels).map(|x| image[x / scale * cells + y / scale]));
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, pixels as u32, pixels as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_compression(png::Compression::High);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(&screen)?;
    writer.finish()?;
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::sample::decode_png;

    #[test]
    fn x_goes_right_and_y_goes_down() {
        // x = 0: 10 above 20; x = 1: 30 above 40.
        let (width, height, pixels) = decode_png(&grey_png(&[10, 20, 30, 40], 2, 1).unwrap());
        assert_eq!((width, height), (2, 2));
        assert_eq!(pixels, [10, 30, 20, 40]);
    }

    #[test]
    fn every_pixel_becomes_a_square() {
        let (width, _, pixels) = decode_png(&grey_png(&[10, 20, 30, 40], 2, 2).unwrap());
        assert_eq!(width, 4);
        assert_eq!(
            pixels,
            [10, 10, 30, 30, 10, 10, 30, 30, 20, 20, 40, 40, 20, 20, 40, 40]
        );
    }

    #[test]
    fn what_is_no_square_is_refused() {
        for (bytes, resolution) in [(3, 2), (5, 2), (0, 0)] {
            let error = grey_png(&vec![0; bytes], resolution, 1).unwrap_err();
            assert!(matches!(error, PictureError::NotSquare { .. }), "{error}");
        }
        for scale in [0, 5000, u32::MAX] {
            let error = grey_png(&[0; 4], 2, scale).unwrap_err();
            assert!(matches!(error, PictureError::Size(_)), "{error}");
        }
    }
}
