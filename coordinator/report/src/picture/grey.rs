//! The grey image of a behaviour, the right way round.

use super::{PictureError, SIZES};

/// Grey value of what is between two pictures.
const GAP: u8 = 255;

/// The grey image of a behaviour as a PNG, every pixel `scale` pixels wide, without smoothing.
///
/// `image` holds `resolution` squared grey values with index `x * resolution + y` (axis 0 is x), as in an evaluation;
/// the picture has x to the right and y down, as on the screen.
///
/// # Errors
/// [`PictureError::NotSquare`] where the bytes are not such a square, [`PictureError::Size`] where the picture would be
/// smaller than 1 pixel or wider than 4096.
pub fn grey_png(image: &[u8], resolution: u32, scale: u32) -> Result<Vec<u8>, PictureError> {
    grey_row_png(&[image], resolution, scale)
}

/// Grey images as [`grey_png`] has one, side by side, with a white line of `scale` pixels between two.
///
/// # Errors
/// As [`grey_png`], of the whole row.
pub fn grey_row_png(images: &[&[u8]], resolution: u32, scale: u32) -> Result<Vec<u8>, PictureError> {
    let cells = resolution as usize;
    let is_square = |image: &&[u8]| !image.is_empty() && image.len() == cells * cells;
    if let Some(image) = images.iter().find(|image| !is_square(image)) {
        return Err(PictureError::NotSquare {
            resolution,
            bytes: image.len(),
        });
    }
    let columns = (u64::from(resolution) + 1) * images.len() as u64;
    let width = columns.saturating_sub(1) * u64::from(scale);
    if width == 0 || width > u64::from(*SIZES.end()) {
        return Err(PictureError::Size(width));
    }
    let scale = scale as usize;
    let (width, height) = (width as usize, cells * scale);
    let pixel = |x: usize, y: usize| {
        let image = images[x / (cells + 1)];
        match x % (cells + 1) {
            gap if gap == cells => GAP,
            x => image[x * cells + y],
        }
    };
    let mut screen = Vec::with_capacity(width * height);
    for y in 0..height {
        screen.extend((0..width).map(|x| pixel(x / scale, y / scale)));
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
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
    fn pictures_of_a_row_have_a_white_line_between_them() {
        let row = grey_row_png(&[&[10, 20, 30, 40], &[1, 2, 3, 4]], 2, 1).unwrap();
        let (width, height, pixels) = decode_png(&row);
        assert_eq!((width, height), (5, 2));
        assert_eq!(pixels, [10, 30, 255, 1, 3, 20, 40, 255, 2, 4]);
        assert!(matches!(grey_row_png(&[], 2, 1), Err(PictureError::Size(0))));
        assert!(grey_row_png(&[&[0; 4], &[0; 3]], 2, 1).is_err());
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
