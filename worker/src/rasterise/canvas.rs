//! A black and white canvas, one bit a pixel.

/// Pixels in a word.
const WORD: usize = u64::BITS as usize;

/// A bitmap: small enough for the first-level cache at the paper's 500 x 500, for memory at 10,000 x 10,000.
#[derive(Debug, Clone)]
pub(super) struct Canvas {
    width: u32,
    height: u32,
    /// Words in a column (all y of one x).
    stride: usize,
    words: Vec<u64>,
}

impl Canvas {
    /// A black canvas of `[width, height]` pixels.
    pub(super) fn new([width, height]: [usize; 2]) -> Self {
        let stride = height.div_ceil(WORD);
        Self {
            width: width as u32,
            height: height as u32,
            stride,
            words: vec![0; width * stride],
        }
    }

    pub(super) fn clear(&mut self) {
        self.words.fill(0);
    }

    /// Makes pixels white; those outside are dropped.
    #[inline]
    pub(super) fn paint(&mut self, pixels: impl Iterator<Item = [i32; 2]>) {
        self.update(pixels, |word, bit| word | bit);
    }

    /// Makes pixels black; those outside are dropped.
    #[inline]
    pub(super) fn erase(&mut self, pixels: impl Iterator<Item = [i32; 2]>) {
        self.update(pixels, |word, bit| word & !bit);
    }

    #[inline]
    fn update(&mut self, pixels: impl Iterator<Item = [i32; 2]>, change: impl Fn(u64, u64) -> u64) {
        for [x, y] in pixels {
            // Negative ones wrap to far outside.
            let (x, y) = (x as u32, y as u32);
            if x < self.width && y < self.height {
                let (x, y) = (x as usize, y as usize);
                let word = &mut self.words[x * self.stride + y / WORD];
                *word = change(*word, 1 << (y % WORD));
            }
        }
    }

    /// Calls `see` with x and y of every white pixel.
    #[inline]
    pub(super) fn for_each_white(&self, mut see: impl FnMut(usize, usize)) {
        for (x, column) in self.words.chunks_exact(self.stride).enumerate() {
            for (w, &word) in column.iter().enumerate() {
                let mut rest = word;
                while rest != 0 {
                    see(x, w * WORD + rest.trailing_zeros() as usize);
                    rest &= rest - 1;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::BTreeSet;

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
                if white {
                    canvas.paint([[x, y]].into_iter());
                    if inside {
                        expected.insert((x as usize, y as usize));
                    }
                } else {
                    canvas.erase([[x, y]].into_iter());
                    expected.remove(&(x as usize, y as usize));
                }
            }
            let mut seen = BTreeSet::new();
            canvas.for_each_white(|x, y| assert!(seen.insert((x, y))));
            prop_assert_eq!(seen, expected);
            canvas.clear();
            canvas.for_each_white(|_, _| panic!("cleared"));
        }
    }
}
