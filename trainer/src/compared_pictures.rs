//! Compared pictures: behaviours of which people said which of two is more like a third.

use crate::pictures::hasher_of;
use murmuration_proto::{PictureShape, SeenPictures};

/// Behaviours with equally many pictures (views) each, and what comparisons say about them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ComparedPictures {
    shape: PictureShape,
    views: usize,
    bytes: Vec<u8>,
    triplets: Vec<ComparedTriplet>,
}

/// What a comparison says: behaviour `nearer` is more like `anchor` than `farther` is. Behaviours are numbered from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ComparedTriplet {
    /// The behaviour that the others were compared with.
    pub anchor: u32,
    /// The behaviour that is more like it.
    pub nearer: u32,
    /// The other behaviour.
    pub farther: u32,
}

/// Why pictures and comparisons cannot be learned from.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ComparedPicturesError {
    /// A behaviour without pictures, or with too many.
    #[error("views = {0}: must be 1 to 16 pictures of each compared behaviour")]
    Views(usize),
    /// Bytes that do not fill the last behaviour's pictures.
    #[error("{bytes} bytes are not a whole number of compared behaviours with {each} bytes of pictures each")]
    Remainder {
        /// The number of bytes.
        bytes: usize,
        /// The number of bytes of one behaviour.
        each: usize,
    },
    /// No comparison, or too many.
    #[error("{0} comparisons: must be 1 to 1,000,000")]
    Triplets(usize),
    /// A comparison is about a behaviour that has no picture.
    #[error(
        "comparisons[{triplet}].{field} = {behaviour}: must be less than {count}, the number of behaviours"
    )]
    OutOfRange {
        /// Place of the comparison, from 0.
        triplet: usize,
        /// Which of its behaviours.
        field: &'static str,
        /// The behaviour.
        behaviour: u32,
        /// The number of behaviours.
        count: usize,
    },
    /// A comparison names one behaviour twice.
    #[error("comparisons[{triplet}] names behaviour {behaviour} twice: must be about three different ones")]
    Repeated {
        /// Place of the comparison, from 0.
        triplet: usize,
        /// The behaviour.
        behaviour: u32,
    },
}

impl ComparedPictures {
    /// Maximum number of comparisons.
    pub const MAX_TRIPLETS: usize = 1_000_000;
    /// Maximum number of pictures of a behaviour.
    pub const MAX_VIEWS: usize = 16;

    /// Consecutive pictures of this shape, with the `views` of a behaviour adjacent, and what is known about the behaviours.
    ///
    /// # Errors
    /// If the numbers do not fit, or a comparison is not about three of the behaviours.
    pub fn new(
        shape: PictureShape,
        views: usize,
        bytes: Vec<u8>,
        triplets: Vec<ComparedTriplet>,
    ) -> Result<Self, ComparedPicturesError> {
        if !(1..=Self::MAX_VIEWS).contains(&views) {
            return Err(ComparedPicturesError::Views(views));
        }
        let each = shape.bytes() * views;
        if !bytes.len().is_multiple_of(each) {
            let bytes = bytes.len();
            return Err(ComparedPicturesError::Remainder { bytes, each });
        }
        if !(1..=Self::MAX_TRIPLETS).contains(&triplets.len()) {
            return Err(ComparedPicturesError::Triplets(triplets.len()));
        }
        let count = bytes.len() / each;
        for (place, triplet) in triplets.iter().enumerate() {
            triplet.check(place, count)?;
        }
        Ok(Self {
            shape,
            views,
            bytes,
            triplets,
        })
    }

    /// Their shape.
    #[must_use]
    pub const fn shape(&self) -> PictureShape {
        self.shape
    }

    /// Number of pictures.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.bytes.len() / self.shape.bytes()
    }

    /// Pictures of each behaviour.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.views
    }

    /// What the comparisons say: one or more.
    #[must_use]
    pub fn triplets(&self) -> &[ComparedTriplet] {
        &self.triplets
    }

    /// One view of a behaviour. Both indices count from 0 and must be in range.
    #[must_use]
    pub(crate) fn picture(&self, behaviour: u32, view: usize) -> &[u8] {
        let bytes = self.shape.bytes();
        &self.bytes[(behaviour as usize * self.views + view) * bytes..][..bytes]
    }

    /// The pictures that an embedder sees if it learns from these.
    #[must_use]
    pub fn seen(&self) -> SeenPictures {
        SeenPictures::of(self.bytes.chunks_exact(self.shape.bytes()))
    }

    /// BLAKE3 over shape, views, comparisons and every byte, as 64 hexadecimal digits.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = hasher_of("murmuration compared pictures v1", self.shape);
        hasher.update(&(self.views as u64).to_le_bytes());
        hasher.update(&(self.triplets.len() as u64).to_le_bytes());
        for triplet in &self.triplets {
            for behaviour in triplet.behaviours() {
                hasher.update(&behaviour.to_le_bytes());
            }
        }
        hasher.update(&self.bytes);
        hasher.finalize().to_hex().to_string()
    }
}

impl ComparedTriplet {
    /// Anchor, nearer and farther one.
    #[must_use]
    pub const fn behaviours(self) -> [u32; 3] {
        [self.anchor, self.nearer, self.farther]
    }

    fn check(self, triplet: usize, count: usize) -> Result<(), ComparedPicturesError> {
        let fields = ["anchor", "nearer", "farther"];
        for (field, behaviour) in fields.into_iter().zip(self.behaviours()) {
            if behaviour as usize >= count {
                return Err(ComparedPicturesError::OutOfRange {
                    triplet,
                    field,
                    behaviour,
                    count,
                });
            }
        }
        let behaviour = match self.behaviours() {
            [anchor, nearer, farther] if anchor == nearer || anchor == farther => anchor,
            [_, nearer, farther] if nearer == farther => nearer,
            _ => return Ok(()),
        };
        Err(ComparedPicturesError::Repeated { triplet, behaviour })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pictures::tests::grey;

    fn triplet([anchor, nearer, farther]: [u32; 3]) -> ComparedTriplet {
        ComparedTriplet {
            anchor,
            nearer,
            farther,
        }
    }

    fn compared(
        views: usize,
        bytes: usize,
        triplets: &[[u32; 3]],
    ) -> Result<ComparedPictures, ComparedPicturesError> {
        let triplets = triplets.iter().copied().map(triplet).collect();
        ComparedPictures::new(grey(1), views, (0..bytes as u8).collect(), triplets)
    }

    #[test]
    fn pictures_are_found_by_behaviour_and_view() {
        let compared = compared(2, 6, &[[2, 0, 1]]).unwrap();
        assert_eq!(compared.picture(2, 1), [5]);
        assert_eq!((compared.count(), compared.views()), (6, 2));
        assert!(compared.seen().has(&[3]) && !compared.seen().has(&[6]));
    }

    #[test]
    fn what_is_wrong_is_named() {
        let refusal =
            |views, bytes, triplets: &[[u32; 3]]| compared(views, bytes, triplets).unwrap_err().to_string();
        assert!(refusal(0, 3, &[[0, 1, 2]]).starts_with("views = 0"));
        assert!(refusal(17, 51, &[[0, 1, 2]]).starts_with("views = 17"));
        assert!(refusal(2, 5, &[[0, 1, 2]]).contains("5 bytes are not a whole number"));
        assert!(refusal(1, 3, &[]).starts_with("0 comparisons"));
        assert!(refusal(1, 3, &[[0, 1, 2], [0, 3, 1]]).starts_with("comparisons[1].nearer = 3"));
        assert!(refusal(1, 3, &[[0, 1, 0]]).contains("names behaviour 0 twice"));
        assert!(refusal(1, 3, &[[0, 2, 2]]).contains("names behaviour 2 twice"));
    }

    #[test]
    fn the_digest_depends_on_every_comparison_and_picture() {
        let digest = |views, bytes, triplets: &[[u32; 3]]| compared(views, bytes, triplets).unwrap().digest();
        let one = digest(1, 6, &[[0, 1, 2]]);
        assert_eq!(one, digest(1, 6, &[[0, 1, 2]]));
        assert_ne!(one, digest(1, 6, &[[0, 2, 1]]));
        assert_ne!(one, digest(2, 6, &[[0, 1, 2]]));
        assert_ne!(one, digest(1, 5, &[[0, 1, 2]]));
    }
}
