//! Labelled pictures: pictures of behaviours, each with its class.

use crate::pictures::hasher_of;
use murmuration_swarm::{PictureShape, SeenPictures};
use std::ops::Range;

/// Pictures of one shape, each with a class. The caller numbers the classes from 1 in any order;
/// [`LabelledPictures::RANDOM`] is 0. A training does not use the names of classes.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelledPictures {
    shape: PictureShape,
    bytes: Vec<u8>,
    /// The class of each picture.
    classes: Vec<u32>,
    /// Indices of all pictures, class after class.
    by_class: Vec<usize>,
    /// The range of each class in `by_class`, for classes with pictures.
    ranges: Vec<Range<usize>>,
    labels: usize,
}

/// Why a training cannot learn from pictures and classes.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LabelledPicturesError {
    /// The number of pictures differs from the number of classes.
    #[error("{labels} labelled pictures of {each} bytes each do not have {bytes} bytes")]
    Count {
        /// Bytes of all pictures.
        bytes: usize,
        /// Number of classes, which should be one for each picture.
        labels: usize,
        /// Bytes of a picture.
        each: usize,
    },
    #[error("the labels name {0} classes: at least two are needed")]
    TooFewClasses(usize),
}

impl LabelledPictures {
    /// The number of the class `random`, for behaviours of no other class. Two behaviours of this class need not be alike.
    pub const RANDOM: u32 = 0;

    /// Pictures of this shape, one after the other, and the class of each.
    ///
    /// # Errors
    /// If the number of pictures differs from the number of classes, or there are fewer than two different classes.
    pub fn new(
        shape: PictureShape,
        bytes: Vec<u8>,
        classes: Vec<u32>,
    ) -> Result<Self, LabelledPicturesError> {
        let (each, labels) = (shape.bytes(), classes.len());
        if labels.checked_mul(each) != Some(bytes.len()) {
            let bytes = bytes.len();
            return Err(LabelledPicturesError::Count { bytes, labels, each });
        }
        let mut by_class: Vec<usize> = (0..labels).collect();
        by_class.sort_by_key(|&picture| classes[picture]);
        let mut ranges = Vec::new();
        for class in by_class.chunk_by(|&one, &other| classes[one] == classes[other]) {
            let start = ranges.last().map_or(0, |last: &Range<usize>| last.end);
            ranges.push(start..start + class.len());
        }
        if ranges.len() < 2 {
            return Err(LabelledPicturesError::TooFewClasses(ranges.len()));
        }
        Ok(Self {
            shape,
            bytes,
            classes,
            by_class,
            ranges,
            labels,
        })
    }

    /// Sets the number of labels, which is less than the number of pictures if several pictures share a label.
    #[must_use]
    pub fn of_labels(self, labels: usize) -> Self {
        Self { labels, ..self }
    }

    /// Number of labels of these pictures.
    #[must_use]
    pub const fn labels(&self) -> usize {
        self.labels
    }

    #[must_use]
    pub const fn shape(&self) -> PictureShape {
        self.shape
    }

    /// Number of pictures, 2 or more.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.classes.len()
    }

    /// Number of classes, 2 or more.
    #[must_use]
    pub const fn class_count(&self) -> usize {
        self.ranges.len()
    }

    /// Indices of all pictures, class after class.
    #[must_use]
    pub(crate) fn by_class(&self) -> &[usize] {
        &self.by_class
    }

    /// The range of each class in [`LabelledPictures::by_class`]: two ranges or more, none empty.
    #[must_use]
    pub(crate) fn ranges(&self) -> &[Range<usize>] {
        &self.ranges
    }

    /// The class of a picture. The index counts from 0 and must be in range.
    #[must_use]
    pub(crate) fn class(&self, index: usize) -> u32 {
        self.classes[index]
    }

    /// A picture. The index counts from 0 and must be in range.
    #[must_use]
    pub(crate) fn picture(&self, index: usize) -> &[u8] {
        let bytes = self.shape.bytes();
        &self.bytes[index * bytes..][..bytes]
    }

    /// Fingerprints of these pictures, for an embedder that learns from them.
    #[must_use]
    pub fn seen(&self) -> SeenPictures {
        SeenPictures::of(self.bytes.chunks_exact(self.shape.bytes()))
    }

    /// BLAKE3 over shape, number of labels, classes and every byte, as 64 hexadecimal digits: a checkpoint's `label_digest`.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = hasher_of("murmuration labelled pictures v2", self.shape);
        hasher.update(&(self.labels as u64).to_le_bytes());
        for class in &self.classes {
            hasher.update(&class.to_le_bytes());
        }
        hasher.update(&self.bytes);
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;

    #[test]
    fn pictures_are_found_by_class() {
        let labelled = LabelledPictures::new(grey(1), vec![10, 20, 30, 40], vec![7, 2, 7, 0]).unwrap();
        assert_eq!(labelled.count(), 4);
        let members = labelled.ranges().iter();
        let members: Vec<_> = members.map(|range| &labelled.by_class()[range.clone()]).collect();
        assert_eq!(members, [&[3][..], &[1], &[0, 2]]);
        assert_eq!(labelled.picture(2), [30]);
    }

    #[test]
    fn what_is_nothing_to_learn_from_is_refused() {
        let refusal = |side, bytes, classes: &[u32]| {
            LabelledPictures::new(grey(side), vec![0; bytes], classes.to_vec()).unwrap_err()
        };
        let (bytes, labels, each) = (9, 2, 4);
        assert_eq!(
            refusal(2, 9, &[0, 1]),
            LabelledPicturesError::Count { bytes, labels, each }
        );
        assert_eq!(refusal(1, 2, &[3, 3]), LabelledPicturesError::TooFewClasses(1));
        assert_eq!(refusal(1, 0, &[]), LabelledPicturesError::TooFewClasses(0));
    }

    #[test]
    fn the_digest_depends_on_every_class_and_picture_and_on_how_many_labels_they_come_from() {
        let digest = |bytes: &[u8], classes: &[u32]| {
            LabelledPictures::new(grey(1), bytes.to_vec(), classes.to_vec())
                .unwrap()
                .digest()
        };
        assert_eq!(digest(&[1, 2], &[0, 1]), digest(&[1, 2], &[0, 1]));
        assert_ne!(digest(&[1, 2], &[0, 1]), digest(&[1, 2], &[1, 0]));
        assert_ne!(digest(&[1, 2], &[0, 1]), digest(&[2, 1], &[0, 1]));
        let of_one = LabelledPictures::new(grey(1), vec![1, 2], vec![0, 1])
            .unwrap()
            .of_labels(1);
        assert_ne!(of_one.digest(), digest(&[1, 2], &[0, 1]));
    }
}
