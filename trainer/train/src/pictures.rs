//! The pictures to train on, one or more per behaviour.

use murmuration_swarm::{Features, PictureShape};

/// Pictures of one shape. The several pictures of a behaviour (its views, such as the same controller from other starts)
/// belong together even without labels.
#[derive(Debug, Clone, PartialEq)]
pub struct Pictures {
    shape: PictureShape,
    views: usize,
    bytes: Vec<u8>,
    /// The features of the first view of each behaviour; empty if the features are not known.
    features: Vec<Features>,
}

/// Why bytes cannot be used as pictures to train on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PicturesError {
    /// A behaviour without pictures, or with too many.
    #[error("{0} pictures of each behaviour: must be 1 to 1,000")]
    Views(usize),
    /// Bytes that do not fill the last behaviour's pictures.
    #[error("{bytes} bytes are not a whole number of behaviours with {each} bytes of pictures each")]
    Remainder {
        /// The number of bytes.
        bytes: usize,
        /// The number of bytes of one behaviour.
        each: usize,
    },
    #[error("{0} behaviours: at least 4 are needed, two to train on and two to hold out")]
    TooFew(usize),
    #[error("features of {came} behaviours: must be of {behaviours}, and finite")]
    Features { came: usize, behaviours: usize },
}

impl Pictures {
    /// Consecutive pictures of this shape, with the `views` of a behaviour adjacent.
    ///
    /// # Errors
    /// If `views` is out of range, `bytes` is not a whole number of behaviours, or there are fewer than four behaviours.
    pub fn new(shape: PictureShape, views: usize, bytes: Vec<u8>) -> Result<Self, PicturesError> {
        if !(1..=1000).contains(&views) {
            return Err(PicturesError::Views(views));
        }
        let each = shape.bytes() * views;
        if !bytes.len().is_multiple_of(each) {
            let bytes = bytes.len();
            return Err(PicturesError::Remainder { bytes, each });
        }
        match bytes.len() / each {
            few @ 0..4 => Err(PicturesError::TooFew(few)),
            _ => Ok(Self {
                shape,
                views,
                bytes,
                features: Vec::new(),
            }),
        }
    }

    /// Adds the features of the first view of each behaviour.
    ///
    /// # Errors
    /// [`PicturesError::Features`] if the number of features differs from the number of behaviours, or a feature is not finite.
    pub fn with_features(self, features: Vec<Features>) -> Result<Self, PicturesError> {
        let is_finite = features.iter().flatten().all(|value| value.is_finite());
        match features.len() == self.behaviours() && is_finite {
            true => Ok(Self { features, ..self }),
            false => Err(PicturesError::Features {
                came: features.len(),
                behaviours: self.behaviours(),
            }),
        }
    }

    /// The features of each behaviour, if they are known.
    #[must_use]
    pub fn features(&self) -> Option<&[Features]> {
        (!self.features.is_empty()).then_some(&self.features)
    }

    #[must_use]
    pub const fn shape(&self) -> PictureShape {
        self.shape
    }

    /// Pictures of each behaviour.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.views
    }

    #[must_use]
    pub const fn behaviours(&self) -> usize {
        self.bytes.len() / (self.shape.bytes() * self.views)
    }

    /// One view of a behaviour. Both indices count from 0 and must be in range.
    #[must_use]
    pub fn picture(&self, behaviour: usize, view: usize) -> &[u8] {
        let bytes = self.shape.bytes();
        &self.bytes[(behaviour * self.views + view) * bytes..][..bytes]
    }

    /// BLAKE3 over shape, views, every byte and the features, as 64 hexadecimal digits: a checkpoint's `data_digest`.
    #[must_use]
    pub fn digest(&self) -> String {
        let context = match self.features() {
            Some(_) => "murmuration training pictures with features v1",
            None => "murmuration training pictures v1",
        };
        let mut hasher = hasher_of(context, self.shape);
        hasher.update(&(self.views as u64).to_le_bytes());
        hasher.update(&self.bytes);
        for value in self.features.iter().flatten() {
            hasher.update(&value.to_le_bytes());
        }
        hasher.finalize().to_hex().to_string()
    }
}

/// A hasher that has hashed the shape of the pictures. Pictures of one channel keep the digests that they had before pictures
/// could have several channels.
pub(crate) fn hasher_of(context: &str, shape: PictureShape) -> blake3::Hasher {
    let mut hasher = match shape.channels() {
        1 => blake3::Hasher::new_derive_key(context),
        channels => {
            let mut hasher = blake3::Hasher::new_derive_key(&format!("{context} in channels"));
            hasher.update(&(channels as u64).to_le_bytes());
            hasher
        }
    };
    hasher.update(&(shape.side() as u64).to_le_bytes());
    hasher
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Pictures of one channel.
    pub(crate) fn grey(side: usize) -> PictureShape {
        PictureShape::new(1, side).unwrap()
    }

    #[test]
    fn pictures_are_found_by_behaviour_and_view() {
        let pictures = Pictures::new(grey(2), 2, (0..32).collect()).unwrap();
        assert_eq!(pictures.behaviours(), 4);
        assert_eq!(pictures.picture(1, 1), [12, 13, 14, 15]);
    }

    #[test]
    fn what_is_no_set_of_pictures_is_refused() {
        let refusal = |side, views, bytes| Pictures::new(grey(side), views, vec![0; bytes]).unwrap_err();
        assert_eq!(refusal(1, 0, 0), PicturesError::Views(0));
        assert_eq!(refusal(2, 1, 18), PicturesError::Remainder { bytes: 18, each: 4 });
        assert_eq!(refusal(2, 2, 24), PicturesError::TooFew(3));
    }

    #[test]
    fn features_are_of_every_behaviour_and_change_the_digest() {
        let pictures = Pictures::new(grey(2), 2, (0..32).collect()).unwrap();
        assert_eq!(pictures.features(), None);
        let with = |features| pictures.clone().with_features(features);
        let known = with(vec![[0.5; 5]; 4]).unwrap();
        assert_eq!(known.features().unwrap().len(), 4);
        assert_ne!(known.digest(), pictures.digest());
        assert_ne!(known.digest(), with(vec![[0.25; 5]; 4]).unwrap().digest());
        with(vec![[0.5; 5]; 3]).unwrap_err();
        with(vec![[f64::NAN; 5]; 4]).unwrap_err();
    }

    #[test]
    fn the_digest_tells_how_pictures_belong_together() {
        let digest = |channels, side, views| {
            let shape = PictureShape::new(channels, side).unwrap();
            Pictures::new(shape, views, vec![0; 64]).unwrap().digest()
        };
        let digests = [
            digest(1, 1, 1),
            digest(1, 1, 4),
            digest(1, 2, 1),
            digest(4, 1, 1),
            digest(4, 2, 1),
        ];
        for (i, one) in digests.iter().enumerate() {
            assert!(!digests[..i].contains(one), "{i}");
        }
    }
}
