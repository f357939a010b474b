//! A black and white canvas with one bit per pixel, stamped sixteen columns at a time.

use super::stamps::{SIDE, Stamp};

/// Number of rows in a band, the same as in a stamp.
pub(super) const BAND: usize = u16::BITS as usize;
/// Number of padding columns on either side, so that a stamp about a pixel of the canvas stays within the words. Padding is never
/// read.
const MARGIN: usize = SIDE;

/// A bitmap. A bitmap of the paper's 500 x 500 pixels fits the first-level cache; a bitmap of 10,000 x 10,000 pixels fits the
/// memory.
///
/// A word holds 16 pixels of a column. The words of neighbouring columns are neighbours in memory and make a band of 16 rows.
/// So a stamp, 16 x 16 pixels, changes 16 words in a row (32 bytes) in each of two bands, one above the other. One band above
/// and one band below the canvas are padding, which is never read.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    width: u32,
    height: u32,
    /// Words in a band.
    pitch: usize,
    words: Vec<u16>,
}

impl Canvas {
    /// A black canvas of `[width, height]` pixels.
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        let pitch = width + 2 * MARGIN;
        Self {
            width: width as u32,
            height: height as u32,
            pitch,
            words: vec![0; pitch * (height.div_ceil(BAND) + 2)],
        }
    }

    pub(super) fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Makes pixels white, except pixels outside the canvas.
    pub(super) fn paint(&mut self, pixels: impl Iterator<Item = [i32; 2]>) {
        self.update(pixels, |word, bit| word | bit);
    }

    /// Makes pixels black, except pixels outside the canvas.
    pub(super) fn erase(&mut self, pixels: impl Iterator<Item = [i32; 2]>) {
        self.update(pixels, |word, bit| word & !bit);
    }

    fn update(&mut self, pixels: impl Iterator<Item = [i32; 2]>, change: impl Fn(u16, u16) -> u16) {
        for pixel in pixels {
            if self.contains(pixel) {
                let [x, y] = pixel.map(|value| value as usize);
                let word = &mut self.words[(y / BAND + 1) * self.pitch + MARGIN + x];
                *word = change(*word, 1 << (y % BAND));
            }
        }
    }

    /// Width and height, in pixels.
    pub(super) const fn size(&self) -> [u32; 2] {
        [self.width, self.height]
    }

    /// Whether the canvas has this pixel.
    #[inline(always)]
    pub(super) const fn contains(&self, [x, y]: [i32; 2]) -> bool {
        // The cast makes negative coordinates larger than any canvas.
        (x as u32) < self.width && (y as u32) < self.height
    }

    /// Makes the pixels of a stamp about the pixel `centre` white. The canvas must have this pixel.
    #[inline(always)]
    pub(super) fn stamp_white(&mut self, stamp: &Stamp, centre: [i32; 2]) {
        self.stamp(
            stamp,
            centre,
            #[inline(always)]
            |word, bits| word | bits,
        );
    }

    /// Makes the pixels of a stamp about the pixel `centre` black. The canvas must have this pixel.
    #[inline(always)]
    pub(super) fn stamp_black(&mut self, stamp: &Stamp, centre: [i32; 2]) {
        self.stamp(
            stamp,
            centre,
            #[inline(always)]
            |word, bits| word & !bits,
        );
    }

    #[inline(always)]
    fn stamp(&mut self, stamp: &Stamp, centre: [i32; 2], change: impl Fn(u16, u16) -> u16) {
        let [before_x, before_y] = stamp.before.map(u32::from);
        let x = (centre[0] as u32 + MARGIN as u32 - before_x) as usize;
        let y = (centre[1] as u32 + BAND as u32 - before_y) as usize;
        let (first, shift) = (y / BAND * self.pitch + x, y % BAND);
        let words = self.words.get_mut(first..first + self.pitch + SIDE);
        let Some((upper, lower)) = words.and_then(|words| words.split_at_mut_checked(self.pitch)) else {
            return;
        };
        let (Some(upper), Some(lower)) = (upper.first_chunk_mut::<SIDE>(), lower.first_chunk_mut::<SIDE>())
        else {
            return;
        };
        // Update both bands, although most stamps lie in one band: the CPU would mispredict a branch. Work on copies, so that the
        // compiler knows that the bands do not overlap.
        let (mut above, mut below) = (*upper, *lower);
        for ((above, below), bits) in above.iter_mut().zip(&mut below).zip(stamp.columns) {
            *above = change(*above, bits << shift);
            *below = change(*below, bits >> 1 >> (BAND - 1 - shift));
        }
        (*upper, *lower) = (above, below);
    }

    /// The words of a band of 16 rows, one per column; empty beyond the canvas. Bits of rows below the canvas are unspecified.
    #[inline(always)]
    pub(super) fn band(&self, band: usize) -> &[u16] {
        let first = (band + 1) * self.pitch + MARGIN;
        self.words
            .get(first..first + self.width as usize)
            .unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

    /// Columns and rows of the white pixels.
    fn white(canvas: &Canvas) -> BTreeSet<[i32; 2]> {
        let is_white = |&[x, y]: &[i32; 2]| {
            let (x, y) = (x as usize, y as usize);
            canvas.band(y / BAND)[x] >> (y % BAND) & 1 == 1
        };
        let pixels = (0..canvas.width as i32).flat_map(|x| (0..canvas.height as i32).map(move |y| [x, y]));
        pixels.filter(is_white).collect()
    }

    proptest! {
        #[test]
        fn what_is_white_is_what_was_painted_last(
            size in [1usize..140, 1usize..140],
            strokes in prop::collection::vec((any::<bool>(), prop::array::uniform2(-5i32..145)), 0..200),
        ) {
            let mut canvas = Canvas::new(size);
            let mut expected = BTreeSet::new();
            for (white, [x, y]) in strokes {
                let inside = (0..size[0] as i32).contains(&x) && (0..size[1] as i32).contains(&y);
                prop_assert_eq!(canvas.contains([x, y]), inside);
                if white {
                    canvas.paint([[x, y]].into_iter());
                    if inside {
                        expected.insert([x, y]);
                    }
                } else {
                    canvas.erase([[x, y]].into_iter());
                    expected.remove(&[x, y]);
                }
            }
            prop_assert_eq!(white(&canvas), expected);
            canvas.clear();
            prop_assert!(white(&canvas).is_empty());
        }

        #[test]
        fn a_stamp_is_its_pixels(
            size in [1usize..140, 1usize..140],
            stamps in prop::collection::vec(
                (
                    any::<bool>(),
                    prop::array::uniform2(0i32..140),
                    prop::array::uniform2(-15i32..=0),
                    prop::collection::vec(prop::array::uniform2(0i32..16), 1..60),
                ),
                0..20,
            ),
        ) {
            let (mut by_stamp, mut by_pixel) = (Canvas::new(size), Canvas::new(size));
            for (white, centre, corner, pixels) in stamps {
                let centre = [0, 1].map(|axis| centre[axis] % size[axis] as i32);
                let offset = |pixel: &[i32; 2]| [0, 1].map(|axis| pixel[axis] + corner[axis]);
                let offsets: Vec<_> = pixels.iter().map(offset).collect();
                let stamp = Stamp::of(&offsets).unwrap();
                let pixels = offsets.iter().map(|offset| [0, 1].map(|axis| centre[axis] + offset[axis]));
                if white {
                    by_stamp.stamp_white(&stamp, centre);
                    by_pixel.paint(pixels);
                } else {
                    by_stamp.stamp_black(&stamp, centre);
                    by_pixel.erase(pixels);
                }
            }
            prop_assert_eq!(white(&by_stamp), white(&by_pixel));
        }
    }
}
