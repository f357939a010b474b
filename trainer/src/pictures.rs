//! The pictures to train on: grey, one or more per behaviour.

/// Grey pictures of one side. Several pictures of one behaviour (its views, such as the same controller from other starts)
/// belong together without labels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pictures {
    side: usize,
    views: usize,
    bytes: Vec<u8>,
}

/// Why bytes are not pictures to train on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PicturesError {
    /// A picture without pixels, or a behaviour without pictures.
    #[error("pictures of side {side}, {views} of each behaviour: both must be 1 to 1,000")]
    Format {
        /// Pixels along a side.
        side: usize,
        /// Pictures of each behaviour.
        views: usize,
    },
    /// Bytes that do not fill the last behaviour's pictures.
    #[error("{bytes} bytes are not a whole number of behaviours with {each} bytes of pictures each")]
    Remainder {
        /// The number of bytes.
        bytes: usize,
        /// The number of bytes of one behaviour.
        each: usize,
    },
    /// There are too few behaviours.
    #[error("{0} behaviours: at least 4 are needed, two to train on and two to hold out")]
    TooFew(usize),
}

impl Pictures {
    /// Consecutive pictures of `side` x `side` bytes, with the `views` of a behaviour adjacent.
    ///
    /// # Errors
    /// If the numbers do not fit, or there are fewer than four behaviours.
    pub fn new(side: usize, views: usize, bytes: Vec<u8>) -> Result<Self, PicturesError> {
        let sizes = 1..=1000;
        if !sizes.contains(&side) || !sizes.contains(&views) {
            return Err(PicturesError::Format { side, views });
        }
        let each = side * side * views;
        if !bytes.len().is_multiple_of(each) {
            let bytes = bytes.len();
            return Err(PicturesError::Remainder { bytes, each });
        }
        match bytes.len() / each {
            few @ 0..4 => Err(PicturesError::TooFew(few)),
            _ => Ok(Self { side, views, bytes }),
        }
    }

    /// Pixels along a side.
    #[must_use]
    pub const fn side(&self) -> usize {
        self.side
    }

    /// Pictures of each behaviour.
    #[must_use]
    pub const fn views(&self) -> usize {
        self.views
    }

    /// Number of behaviours.
    #[must_use]
    pub const fn behaviours(&self) -> usize {
        self.bytes.len() / (self.side * self.side * self.views)
    }

    /// One view of a behaviour. Both indices count from 0 and must be in range.
    #[must_use]
    pub fn picture(&self, behaviour: usize, view: usize) -> &[u8] {
        let pixels = self.side * self.side;
        &self.bytes[(behaviour * self.views + view) * pixels..][..pixels]
    }

    /// BLAKE3 over side, views and every byte, as 64 hexadecimal digits: a checkpoint's `data_digest`.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new_derive_key("murmuration training pictures v1");
        hasher.update(&(self.side as u64).to_le_bytes());
        hasher.update(&(self.views as u64).to_le_bytes());
        hasher.update(&self.bytes);
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_found_by_behaviour_and_view() {
        let pictures = Pictures::new(2, 2, (0..32).collect()).unwrap();
        assert_eq!(pictures.behaviours(), 4);
        assert_eq!(pictures.picture(1, 1), [12, 13, 14, 15]);
    }

    #[test]
    fn what_is_no_set_of_pictures_is_refused() {
        let refusal = |side, views, bytes| Pictures::new(side, views, vec![0; bytes]).unwrap_err();
        assert_eq!(refusal(0, 1, 0), PicturesError::Format { side: 0, views: 1 });
        assert_eq!(refusal(2, 1, 18), PicturesError::Remainder { bytes: 18, each: 4 });
        assert_eq!(refusal(2, 2, 24), PicturesError::TooFew(3));
    }

    #[test]
    fn the_digest_tells_how_pictures_belong_together() {
        let digest = |side, views| Pictures::new(side, views, vec![0; 64]).unwrap().digest();
        assert_ne!(digest(1, 1), digest(1, 4));
        assert_ne!(digest(1, 4), digest(2, 1));
    }
}
