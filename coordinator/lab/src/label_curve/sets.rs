//! Labelled behaviours, and the separation of the set to learn from and the set that measures accuracy.

use murmuration_model::labels::class_numbers;
use murmuration_swarm::{PictureShape, SeenPictures};

/// Behaviours whose classes are known.
#[derive(Debug, Clone)]
pub struct LabelledBehaviours {
    shape: PictureShape,
    classes: Vec<String>,
    pictures: Vec<Vec<u8>>,
    /// For each behaviour, pictures of its controller from further starts.
    further: Vec<Vec<Vec<u8>>>,
}

/// Error if the set to learn from and the set that measures share pictures; with the number of shared pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{0} pictures are both in the training set and in the validation set")]
pub struct Overlap(pub usize);

/// A set to learn from and a set that measures accuracy, without a picture in common.
#[derive(Debug, Clone)]
pub struct Sets {
    train: LabelledBehaviours,
    validation: LabelledBehaviours,
}

impl Sets {
    /// Takes the set to learn from and the set that measures.
    ///
    /// # Errors
    /// Fails if the sets share pictures.
    pub fn new(train: LabelledBehaviours, validation: LabelledBehaviours) -> Result<Self, Overlap> {
        let further = train.further.iter().flatten();
        let seen = SeenPictures::of(train.pictures.iter().chain(further).map(Vec::as_slice));
        match validation
            .pictures
            .iter()
            .filter(|picture| seen.has(picture))
            .count()
        {
            0 => Ok(Self { train, validation }),
            shared => Err(Overlap(shared)),
        }
    }

    pub const fn train(&self) -> &LabelledBehaviours {
        &self.train
    }

    /// The set that measures accuracy.
    pub const fn validation(&self) -> &LabelledBehaviours {
        &self.validation
    }
}

impl LabelledBehaviours {
    /// An empty set for pictures of this shape.
    pub const fn new(shape: PictureShape) -> Self {
        Self {
            shape,
            classes: Vec::new(),
            pictures: Vec::new(),
            further: Vec::new(),
        }
    }

    /// Adds a behaviour with its picture. `further` are pictures of the same controller from other starts. All pictures have the
    /// shape of the set.
    pub fn push(&mut self, class: &str, picture: Vec<u8>, further: Vec<Vec<u8>>) {
        debug_assert_eq!(picture.len(), self.shape.bytes());
        self.classes.push(class.to_owned());
        self.pictures.push(picture);
        self.further.push(further);
    }

    /// Number of behaviours.
    pub const fn count(&self) -> usize {
        self.classes.len()
    }

    pub const fn shape(&self) -> PictureShape {
        self.shape
    }

    /// The classes of the behaviours, in order.
    pub fn classes(&self) -> impl Iterator<Item = &str> {
        self.classes.iter().map(String::as_str)
    }

    /// The pictures of the behaviours `which`, one after the other.
    pub(super) fn pictures(&self, which: &[usize]) -> Vec<u8> {
        which
            .iter()
            .flat_map(|&index| &self.pictures[index])
            .copied()
            .collect()
    }

    /// All pictures of the behaviours `which`, one after the other, and the [number](class_numbers) of each picture's class.
    pub(super) fn labelled_pictures(&self, which: &[usize]) -> (Vec<u8>, Vec<u32>) {
        let numbers = class_numbers(self.classes());
        let (mut pictures, mut classes) = (Vec::new(), Vec::new());
        for &index in which {
            let class = numbers[self.classes[index].as_str()];
            for picture in std::iter::once(&self.pictures[index]).chain(&self.further[index]) {
                pictures.extend_from_slice(picture);
                classes.push(class);
            }
        }
        (pictures, classes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn behaviours(greys: &[u8]) -> LabelledBehaviours {
        let mut behaviours = LabelledBehaviours::new(PictureShape::new(1, 2).unwrap());
        for grey in greys {
            let class = if grey % 2 == 0 { "even" } else { "odd" };
            behaviours.push(class, vec![*grey; 4], vec![vec![grey + 100; 4]]);
        }
        behaviours
    }

    #[test]
    fn what_is_learned_from_does_not_judge() {
        assert!(Sets::new(behaviours(&[1, 2]), behaviours(&[3, 4])).is_ok());
        let shared = Sets::new(behaviours(&[1, 2, 3]), behaviours(&[3, 1])).unwrap_err();
        assert_eq!(shared, Overlap(2));
        let further = Sets::new(behaviours(&[1, 2]), behaviours(&[102])).unwrap_err();
        assert_eq!(further, Overlap(1));
    }

    #[test]
    fn classes_are_numbered_by_name() {
        let behaviours = behaviours(&[3, 2, 4]);
        let (pictures, classes) = behaviours.labelled_pictures(&[0, 2]);
        assert_eq!(classes, [2, 2, 1, 1]);
        let greys: Vec<u8> = pictures.into_iter().step_by(4).collect();
        assert_eq!(greys, [3, 103, 4, 104]);
        assert_eq!(behaviours.pictures(&[2, 0]), [4, 4, 4, 4, 3, 3, 3, 3]);
    }
}
