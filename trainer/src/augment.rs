//! Another picture of the same behaviour: cropped, resized, turned and reflected.

use crate::{network::scaled, real::Real};
use murmuration_proto::Stream;
use serde::{Deserialize, Serialize};

/// How far pictures are changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Augmentation {
    /// Least and greatest share of width and of height that a crop keeps; over 1 the picture shrinks, on black.
    pub(crate) crop: [f64; 2],
    pub(crate) symmetries: Symmetries,
    /// Sharpest change of brightness...
    pub(crate) gain: f64,
    pub(crate) noise: f64,
    pub(crate) erase: f64,
}

/// Which of the square's eight symmetries are applied, each as likely as the others.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Symmetries {
    /// A quarter, a half or three quarters of a turn (the paper's; never none).
    Turns,
    /// All eight: turns and reflections, and none.
    All,
}

impl Augmentation {
    /// Writes a changed copy of the `picture` of `side` x `side` to `output`, scaled to 0 to 1.
    pub(crate) fn apply<T: Real>(&self, picture: &[u8], side: usize, stream: &mut Stream, output: &mut [T]) {
        let rows = self.window(side, stream);
        let columns = self.window(side, stream);
        let symmetry = match self.symmetries {
            Symmetries::Turns => TURNS[stream.below(3) as usize],
            Symmetries::All => stream.below(8),
        };
        let place = Placement::new(symmetry, side);
        let mut line = vec![T::zero(); side];
        for i in 0..side {
            rows.blend_rows(i, picture, &mut line);
            for j in 0..side {
                output[place.of(i, j)] = columns.blend(j, &line);
            }
        }
        if self.gain > 0.0 {
            let gain = T::of(stream.between(1.0 - self.gain, 1.0 + self.gain));
            for v in output.iter_mut() { *v = *v * gain; }
        }
        if self.noise > 0.0 {
            let sd = stream.between(0.0, self.noise);
            for v in output.iter_mut() {
                let bits = stream.bits();
                let g = ((bits & 0xffff) + ((bits >> 16) & 0xffff) + ((bits >> 32) & 0xffff) + (bits >> 48)) as f64 / 65536.0 - 2.0;
                *v = *v + T::of(g * 1.7 * sd);
            }
        }
        if self.erase > 0.0 && stream.chance(self.erase) {
            let h = stream.between(0.1, 0.35) * side as f64;
            let w = stream.between(0.1, 0.35) * side as f64;
            let y = stream.below(side as u64 - h as u64) as usize;
            let x = stream.below(side as u64 - w as u64) as usize;
            for i in y..y + h as usize { for j in x..x + w as usize { output[i * side + j] = T::zero(); } }
        }
    }

    fn window(&self, side: usize, stream: &mut Stream) -> Window {
        let share = stream.between(self.crop[0], self.crop[1]);
        let start = stream.unit() * (1.0 - share) * side as f64;
        Window { start, share, side }
    }
}

/// Quarter, half and three-quarter turn, among the symmetries 0 to 7.
const TURNS: [u64; 3] = [5, 3, 6];

/// Where the pixels of a picture go under one of the eight symmetries: bit 0 reverses rows, bit 1 columns, bit 2
/// exchanges the two.
struct Placement {
    first: usize,
    row_step: isize,
    column_step: isize,
}

impl Placement {
    fn new(symmetry: u64, side: usize) -> Self {
        let (long, short) = (side as isize, 1);
        let (row_step, column_step) = if symmetry & 4 == 0 { (long, short) } else { (short, long) };
        let last = side as isize - 1;
        let (reverse_rows, reverse_columns) = (symmetry & 1 != 0, symmetry & 2 != 0);
        let mut first = 0;
        if reverse_rows {
            first += last * row_step;
        }
        if reverse_columns {
            first += last * column_step;
        }
        Self {
            first: first as usize,
            row_step: if reverse_rows { -row_step } else { row_step },
            column_step: if reverse_columns { -column_step } else { column_step },
        }
    }

    const fn of(&self, row: usize, column: usize) -> usize {
        self.first
            .wrapping_add_signed(self.row_step * row as isize + self.column_step * column as isize)
    }
}

/// A part of an axis, stretched over the whole of it.
struct Window {
    start: f64,
    share: f64,
    side: usize,
}

impl Window {
    /// The two pixels that the place `i` lies between, and how much the second counts; `None` outside the picture.
    fn between(&self, i: usize) -> Option<(usize, usize, f64)> {
        let last = (self.side - 1) as f64;
        let end = self.start + self.share * self.side as f64 - 1.0;
        let place = self.start + (i as f64 + 0.5) * self.share - 0.5;
        if self.share > 1.0 && (place < -0.5 || place > last + 0.5) {
            return None;
        }
        let place = place.clamp(self.start.max(0.0), end.clamp(self.start.max(0.0), last));
        let low = place as usize;
        Some((low, (low + 1).min(self.side - 1), place - low as f64))
    }

    fn blend_rows<T: Real>(&self, i: usize, picture: &[u8], line: &mut [T]) {
        let Some((low, high, part)) = self.between(i) else {
            line.fill(T::zero());
            return;
        };
        let part = T::of(part);
        let [low, high] = [low, high].map(|row| &picture[row * self.side..][..self.side]);
        for ((value, &low), &high) in line.iter_mut().zip(low).zip(high) {
            let [low, high] = [low, high].map(scaled::<T>);
            *value = low + (high - low) * part;
        }
    }

    fn blend<T: Real>(&self, j: usize, line: &[T]) -> T {
        self.between(j).map_or_else(T::zero, |(low, high, part)| {
            line[low] + (line[high] - line[low]) * T::of(part)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_proto::Purpose;
    use proptest::prelude::*;

    const SIDE: usize = 4;
    const PLAIN: Augmentation = Augmentation {
        crop: [1.0, 1.0],
        symmetries: Symmetries::All,
        gain: 0.0, noise: 0.0, erase: 0.0,
    };

    fn picture() -> Vec<u8> {
        (0..16).map(|i| i * 15).collect()
    }

    fn changed(augmentation: Augmentation, index: u64) -> Vec<u8> {
        let mut output = vec![0.0; SIDE * SIDE];
        let mut stream = Stream::derive(1, Purpose::Augment, index);
        augmentation.apply(&picture(), SIDE, &mut stream, &mut output);
        output.into_iter().map(|value: f64| (value * 255.0).round() as u8).collect()
    }

    fn turned(picture: &[u8]) -> Vec<u8> {
        let of = |i: usize| picture[i % SIDE * SIDE + SIDE - 1 - i / SIDE];
        (0..SIDE * SIDE).map(of).collect()
    }

    fn reflected(picture: &[u8]) -> Vec<u8> {
        picture.chunks(SIDE).rev().flatten().copied().collect()
    }

    #[test]
    fn without_a_crop_the_eight_symmetries_appear() {
        let mut expected = vec![picture()];
        for _ in 0..3 {
            expected.push(turned(&expected[expected.len() - 1]));
        }
        expected.extend(expected.clone().iter().map(|picture| reflected(picture)));
        expected.sort();
        let mut seen: Vec<Vec<u8>> = (0..200).map(|index| changed(PLAIN, index)).collect();
        seen.sort();
        seen.dedup();
        assert_eq!(seen, expected);
    }

    #[test]
    fn the_papers_turns_leave_no_picture_as_it_was() {
        let turns = Augmentation {
            symmetries: Symmetries::Turns,
            ..PLAIN
        };
        let mut seen: Vec<Vec<u8>> = (0..200).map(|index| changed(turns, index)).collect();
        seen.sort();
        seen.dedup();
        let mut expected = vec![turned(&picture())];
        for _ in 0..2 {
            expected.push(turned(&expected[expected.len() - 1]));
        }
        expected.sort();
        assert_eq!(seen, expected);
    }

    #[test]
    fn a_crop_of_half_a_ramp_is_half_a_ramp() {
        let window = Window {
            start: 1.0,
            share: 0.5,
            side: 4,
        };
        let ramp = [0.0, 1.0, 2.0, 3.0];
        let seen: Vec<f64> = (0..4).map(|j| window.blend(j, &ramp)).collect();
        assert_eq!(seen, [1.0, 1.25, 1.75, 2.0]);
    }

    proptest! {
        #[test]
        fn nothing_is_added_that_was_not_there(low in 0.1..1.0f64, more in 0.0..1.0f64, index: u64) {
            let augmentation = Augmentation { crop: [low, low + more], ..PLAIN };
            let mut output = vec![f64::NAN; 16];
            let mut stream = Stream::derive(2, Purpose::Augment, index);
            augmentation.apply(&[200; 16], 4, &mut stream, &mut output);
            for value in output {
                prop_assert!(value == 0.0 && low + more > 1.0 || (value - 200.0 / 255.0).abs() < 1e-12);
            }
        }
    }
}
