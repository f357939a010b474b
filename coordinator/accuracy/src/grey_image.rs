//! Reads grey images for embedders from PNG files.

use murmuration_files::{InputKind, read_bytes};
use murmuration_onnx::ImageShape;
use std::{io::Cursor, path::Path};

/// Reads the pixels of a grey PNG with 8 bits per pixel, for an embedder of `images`; or returns an error message about the file.
pub(super) fn pixels(image: &Path, images: ImageShape) -> Result<Vec<u8>, String> {
    if ![1, 3].contains(&images.channels) {
        return Err(format!(
            "a PNG has one channel, but the embedder takes images of {images}: simulate the behaviours again"
        ));
    }
    let file = read_bytes(image, InputKind::Picture).map_err(|error| error.to_string())?;
    let mut reader = png::Decoder::new(Cursor::new(file))
        .read_info()
        .map_err(|error| error.to_string())?;
    let info = reader.info();
    if (info.color_type, info.bit_depth) != (png::ColorType::Grayscale, png::BitDepth::Eight) {
        return Err("it is not a grey PNG with 8 bits a pixel".to_owned());
    }
    let picture = ImageShape {
        channels: 1,
        height: info.height as usize,
        width: info.width as usize,
    };
    if images.of_pictures(picture.bytes()) != Some(picture) {
        return Err(format!(
            "it is a picture of {picture}, and the embedder takes {images}"
        ));
    }
    let mut pixels = vec![0; picture.bytes()];
    reader
        .next_frame(&mut pixels)
        .map_err(|error| error.to_string())?;
    Ok(pixels)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{self, File};

    #[test]
    fn rows_are_the_first_axis() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("1.png");
        let write = |color, width, height, data: &[u8]| {
            let mut encoder = png::Encoder::new(File::create(&path).unwrap(), width, height);
            encoder.set_color(color);
            encoder.write_header().unwrap().write_image_data(data).unwrap();
        };
        let shape = |channels, height, width| ImageShape {
            channels,
            height,
            width,
        };
        let refused = |height, width| pixels(&path, shape(1, height, width)).unwrap_err();
        assert!(refused(1, 1).starts_with("No such file"), "{}", refused(1, 1));
        fs::write(&path, "no picture").unwrap();
        assert!(refused(1, 1).contains("signature"), "{}", refused(1, 1));
        write(png::ColorType::Rgb, 1, 1, &[1, 2, 3]);
        assert_eq!(refused(1, 1), "it is not a grey PNG with 8 bits a pixel");
        write(png::ColorType::Grayscale, 3, 2, &[1, 2, 3, 4, 5, 6]);
        assert_eq!(
            refused(3, 2),
            "it is a picture of 2 x 3, and the embedder takes 3 x 2"
        );
        assert_eq!(pixels(&path, shape(1, 2, 3)).unwrap(), [1, 2, 3, 4, 5, 6]);
        let several = pixels(&path, shape(2, 2, 3)).unwrap_err();
        assert!(
            several.contains("takes images of 2 channels of 2 x 3"),
            "{several}"
        );
    }
}
