//! Decompression gives the original bytes, or an error.

use super::*;
use proptest::prelude::*;

const PIXELS: usize = 2500;

fn compressed(image: &[u8]) -> Vec<u8> {
    let image = Compressor::new().unwrap().compress(image).unwrap();
    image.frame().to_vec()
}

fn decompressed(column: &[u8]) -> Result<Vec<u8>, NoImage> {
    Decompressor::new(PIXELS).unwrap().decompress(column)
}

/// A picture with fewer than 600 pixels that are not black.
fn sparse() -> impl Strategy<Value = Vec<u8>> {
    proptest::collection::vec((0..PIXELS, 1..=255_u8), 0..600).prop_map(|pixels| {
        let mut image = vec![0; PIXELS];
        pixels.into_iter().for_each(|(place, grey)| image[place] = grey);
        image
    })
}

proptest! {
    #[test]
    fn an_image_comes_out_as_it_went_in(image in prop_oneof![
        sparse(),
        proptest::collection::vec(any::<u8>(), PIXELS),
    ]) {
        prop_assert_eq!(decompressed(&compressed(&image)).unwrap(), image);
    }

    #[test]
    fn a_changed_bit_is_noticed(image in sparse(), place in any::<prop::sample::Index>(), bit in 0..8_u8) {
        let mut column = compressed(&image);
        let place = place.index(column.len());
        column[place] ^= 1_u8 << bit;
        // Some bits of the header mean nothing, so a change of such a bit leaves the image the same.
        if let Ok(same) = decompressed(&column) {
            prop_assert_eq!(same, image);
        }
    }

    #[test]
    fn anything_is_an_image_of_the_size_or_none(column in proptest::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(image) = decompressed(&column) {
            prop_assert_eq!(image.len(), PIXELS);
        }
    }
}

#[test]
fn black_takes_a_few_bytes_and_noise_little_more_than_itself() {
    assert!(compressed(&[0; PIXELS]).len() < 30);
    let noise: Vec<u8> = (0..PIXELS as u64)
        .flat_map(|place| blake3::hash(&place.to_le_bytes()).as_bytes()[..1].to_vec())
        .collect();
    assert!(compressed(&noise).len() < PIXELS + 30);
}

#[test]
fn an_image_of_another_size_is_none() {
    let size = Err(NoImage::Size { pixels: PIXELS });
    for pixels in [0, 1, PIXELS - 1, PIXELS + 1, 1 << 20] {
        assert_eq!(decompressed(&compressed(&vec![0; pixels])), size, "{pixels}");
    }
    assert_eq!(decompressed(b""), size);
    assert_eq!(decompressed(&[0; PIXELS]), size);
    // The first value is a frame that is cut off; the second value is two sound frames, one after the other.
    let whole = compressed(&[7; PIXELS]);
    assert_eq!(decompressed(&whole[..whole.len() - 1]), Err(NoImage::Damaged));
    assert_eq!(
        decompressed(&[whole.clone(), whole].concat()),
        Err(NoImage::Damaged)
    );
}

#[test]
fn a_frame_that_holds_more_than_it_says_is_damaged() {
    let (small, large) = (compressed(&[0; PIXELS]), compressed(&[0; 60_000]));
    // A frame begins with 4 fixed bytes and one byte of flags. The next two bytes are the size of the image minus 256.
    assert_eq!(large[5..7], (60_000_u16 - 256).to_le_bytes());
    let lying = [&small[..7], &large[7..]].concat();
    assert_eq!(decompressed(&lying), Err(NoImage::Damaged));
}

#[test]
fn pictures_that_follow_each_other_are_one_value_or_several() {
    let pictures = [1, 2, 3].map(|grey| vec![grey; PIXELS]);
    let frames = pictures.each_ref().map(|picture| compressed(picture)).concat();
    let mut all = Decompressor::new(3 * PIXELS).unwrap();
    assert_eq!(all.decompress(&frames).unwrap(), pictures.concat());
    let mut each = Decompressor::new(PIXELS).unwrap();
    let mut rest = frames.as_slice();
    for picture in &pictures {
        assert_eq!(each.take_frame(&mut rest).unwrap().pixels().unwrap(), *picture);
    }
    assert!(rest.is_empty() && each.take_frame(&mut rest).is_err());
}

#[test]
fn a_frame_without_a_checksum_is_refused_from_outside() {
    let plain = bulk::compress(&[7; PIXELS], LEVEL).unwrap();
    let mut each = Decompressor::new(PIXELS).unwrap();
    assert_eq!(each.decompress(&plain).unwrap(), [7; PIXELS]);
    assert_eq!(each.take_frame(&mut plain.as_slice()), Err(NoImage::Damaged));
}

#[test]
fn the_same_picture_may_be_compressed_in_several_ways() {
    let picture: Vec<u8> = (0..PIXELS).map(|pixel| (pixel % 7 * (pixel % 3)) as u8).collect();
    let mut other = bulk::Compressor::new(19).unwrap();
    other.set_parameter(CParameter::ChecksumFlag(true)).unwrap();
    let other = other.compress(&picture).unwrap();
    let mut each = Decompressor::new(PIXELS).unwrap();
    let [one, other] =
        [compressed(&picture), other].map(|frame| each.take_frame(&mut frame.as_slice()).unwrap());
    assert!(one != other && one.same_pixels(&other));
    let black = each.take_frame(&mut compressed(&[0; PIXELS]).as_slice()).unwrap();
    assert!(!one.same_pixels(&black));
}
