//! Augmentation: makes another picture of the same behaviour, cropped, resized, turned and reflected.

use crate::{network::scaled, real::Real};
use murmuration_swarm::{PictureShape, RandomStream, training::Recipe};
use rand::RngExt as _;

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Augmentation {
    /// Smallest and largest share of a picture's width and height that a crop keeps. The shares of width and height are drawn
    /// separately. A share over 1 shrinks the picture and adds a black border.
    pub(crate) crop: [f64; 2],
    pub(crate) symmetries: Symmetries,
}

/// The symmetries of the square that augmentation chooses from, with equal probabilities.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Symmetries {
    /// A quarter, a half or three quarters of a turn. As in the paper, every picture is turned.
    Turns,
    /// All eight symmetries: turns and reflections, including the identity.
    All,
}

impl From<&Recipe> for Augmentation {
    /// The augmentation of pictures without a class. Labelled pictures have their own crop.
    fn from(recipe: &Recipe) -> Self {
        Self {
            crop: recipe.unlabelled_crop(),
            symmetries: match recipe.reflects() {
                true => Symmetries::All,
                false => Symmetries::Turns,
            },
        }
    }
}

impl Augmentation {
    /// Writes an augmented copy of the `picture` to `output`, as an image (see [`append_image`](crate::network::append_image)).
    /// All channels are cropped, turned and reflected alike.
    pub(crate) fn apply<T: Real>(
        &self,
        picture: &[u8],
        shape: PictureShape,
        stream: &mut RandomStream,
        output: &mut [T],
    ) {
        let side = shape.side();
        let rows = self.window(side, stream).places::<T>();
        let columns = self.window(side, stream).places::<T>();
        let symmetry = match self.symmetries {
            Symmetries::Turns => TURNS[stream.below(3) as usize],
            Symmetries::All => stream.below(8),
        };
        let mut line = vec![T::zero(); side];
        for (place, channel) in picture.chunks_exact(shape.pixels()).enumerate() {
            let target = Target::new(symmetry, shape, place);
            for (i, row) in rows.iter().enumerate() {
                let [low, high] = [row.low, row.high].map(|row| &channel[row * side..][..side]);
                for ((value, &low), &high) in line.iter_mut().zip(low).zip(high) {
                    *value = row.between(scaled(low), scaled(high));
                }
                for (j, column) in columns.iter().enumerate() {
                    output[target.of(i, j)] = column.between(line[column.low], line[column.high]);
                }
            }
        }
    }

    fn window(&self, side: usize, stream: &mut RandomStream) -> Window {
        let share = stream.between(self.crop[0], self.crop[1]);
        let start = stream.random::<f64>() * (1.0 - share) * side as f64;
        Window { start, share, side }
    }
}

/// The numbers of the quarter, half and three-quarter turn, among the symmetries 0 to 7.
const TURNS: [u64; 3] = [5, 3, 6];

/// The places of a channel's pixels in an image, under one of the eight symmetries. In the number of a symmetry, bit 0 reverses
/// the rows, bit 1 reverses the columns, and bit 2 exchanges rows and columns.
struct Target {
    first: usize,
    row_step: isize,
    column_step: isize,
}

impl Target {
    fn new(symmetry: u64, shape: PictureShape, channel: usize) -> Self {
        let [side, short] = [shape.side(), shape.channels()].map(|size| size as isize);
        let long = side * short;
        let (row_step, column_step) = if symmetry & 4 == 0 {
            (long, short)
        } else {
            (short, long)
        };
        let last = side - 1;
        let (reverse_rows, reverse_columns) = (symmetry & 1 != 0, symmetry & 2 != 0);
        let mut first = channel as isize;
        if reverse_rows {
            first += last * row_step;
        }
        if reverse_columns {
            first += last * column_step;
        }
        Self {
            first: first as usize,
            row_step: if reverse_rows { -row_step } else { row_step },
            column_step: if reverse_columns {
                -column_step
            } else {
                column_step
            },
        }
    }

    const fn of(&self, row: usize, column: usize) -> usize {
        self.first
            .wrapping_add_signed(self.row_step * row as isize + self.column_step * column as isize)
    }
}

/// A part of an axis, stretched or shrunk to the whole axis.
#[derive(Debug, Clone, Copy)]
struct Window {
    /// Start of the window, pixels; negative if the window is longer than the axis.
    start: f64,
    /// Length of the window, as a share of the axis.
    share: f64,
    side: usize,
}

/// The source pixels of one pixel of a stretched axis.
#[derive(Debug, Clone, Copy)]
struct Place<T> {
    low: usize,
    high: usize,
    /// The weight of `high`.
    part: T,
    /// Factor of the pixel's brightness: 1 inside the picture, 0 outside.
    light: T,
}

impl<T: Real> Place<T> {
    fn between(&self, low: T, high: T) -> T {
        (low + (high - low) * self.part) * self.light
    }
}

impl Window {
    /// One place for each pixel. Beyond the centres of the first and last pixels of the window (or the picture), nothing is
    /// interpolated.
    fn places<T: Real>(self) -> Vec<Place<T>> {
        let first = self.start.max(0.0);
        let last = (self.start + self.share * self.side as f64).min(self.side as f64) - 1.0;
        let place = |i: usize| {
            let centre = self.start + (i as f64 + 0.5) * self.share;
            let inside = (0.0..=self.side as f64).contains(&centre);
            let place = (centre - 0.5).min(last).max(first);
            let low = place as usize;
            Place {
                low,
                high: (low + 1).min(self.side - 1),
                part: T::of(place - low as f64),
                light: if inside { T::one() } else { T::zero() },
            }
        };
        (0..self.side).map(place).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;
    use murmuration_swarm::Purpose;
    use proptest::prelude::*;

    const SIDE: usize = 4;
    const PLAIN: Augmentation = Augmentation {
        crop: [1.0, 1.0],
        symmetries: Symmetries::All,
    };

    fn picture() -> Vec<u8> {
        (0..16).map(|i| i * 15).collect()
    }

    fn changed(augmentation: Augmentation, index: u64) -> Vec<u8> {
        let mut output = vec![0.0; SIDE * SIDE];
        let mut stream = RandomStream::derive(1, Purpose::Augment, index);
        augmentation.apply(&picture(), grey(SIDE), &mut stream, &mut output);
        output
            .into_iter()
            .map(|value: f64| (value * 255.0).round() as u8)
            .collect()
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
    fn channels_are_changed_alike_and_those_of_a_pixel_are_adjacent() {
        let inverse = picture().iter().map(|grey| 255 - grey).collect();
        let both = [picture(), inverse].concat();
        let augmentation = Augmentation {
            crop: [0.5, 0.9],
            ..PLAIN
        };
        for index in 0..50 {
            let stream = || RandomStream::derive(1, Purpose::Augment, index);
            let apply = |picture: &[u8], shape: PictureShape| {
                let mut output = vec![0.0; shape.bytes()];
                augmentation.apply(picture, shape, &mut stream(), &mut output);
                output
            };
            let image: Vec<f64> = apply(&both, PictureShape::new(2, SIDE).unwrap());
            for (place, picture) in both.chunks_exact(16).enumerate() {
                let channel: Vec<f64> = image.iter().skip(place).step_by(2).copied().collect();
                assert_eq!(channel, apply(picture, grey(SIDE)), "{index}");
            }
        }
    }

    fn stretched(start: f64, share: f64) -> Vec<f64> {
        let ramp = [1.0, 2.0, 3.0, 4.0];
        let window = Window {
            start,
            share,
            side: 4,
        };
        let places = window.places::<f64>().into_iter();
        places
            .map(|place| place.between(ramp[place.low], ramp[place.high]))
            .collect()
    }

    #[test]
    fn a_crop_of_half_a_ramp_is_half_a_ramp() {
        assert_eq!(stretched(1.0, 0.5), [2.0, 2.25, 2.75, 3.0]);
    }

    #[test]
    fn a_ramp_at_half_its_size_stands_on_black() {
        assert_eq!(stretched(-2.0, 2.0), [0.0, 1.5, 3.5, 0.0]);
    }

    proptest! {
        #[test]
        fn what_is_even_stays_even(low in 0.01..1.0f64, part in 0.0..1.0f64, index: u64) {
            let augmentation = Augmentation { crop: [low, low + (1.0 - low) * part], ..PLAIN };
            let mut output = vec![f64::NAN; 49];
            let mut stream = RandomStream::derive(2, Purpose::Augment, index);
            augmentation.apply(&[200; 49], grey(7), &mut stream, &mut output);
            prop_assert!(output.iter().all(|value| (value - 200.0 / 255.0).abs() < 1e-12));
        }
    }
}
