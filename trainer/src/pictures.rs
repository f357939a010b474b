//! What is trained on: grey pictures, one or more of each controller.

/// Grey pictures of behaviours, all of one side. Pictures of one controller from several starts show the same
/// behaviour, and belong together without anybody having labelled them.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Pictures {
    side: usize,
    starts: usize,
    bytes: Vec<u8>,
}

/// Why bytes are not pictures to train on.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum PicturesError {
    /// A picture without pixels, or a controller without pictures.
    #[error("pictures of side {side}, {starts} a controller: both must be 1 to 1,000")]
    Format {
        /// Pixels along a side.
        side: usize,
        /// Pictures of each controller.
        starts: usize,
    },
    /// Bytes that do not fill the last controller's pictures.
    #[error("{bytes} bytes are not a whole number of controllers with {each} bytes of pictures each")]
    Remainder {
        /// How many there were.
        bytes: usize,
        /// How many a controller has.
        each: usize,
    },
    /// Too few to tell apart.
    #[error("{0} controllers: at least 4 are needed, two to train on and two to hold out")]
    TooFew(usize),
}

impl Pictures {
    /// Pictures of `side` x `side` bytes, one after the other, those of a controller's `starts` together.
    ///
    /// # Errors
    /// Where the numbers do not fit, or there are fewer than four controllers.
    pub fn new(side: usize, starts: usize, bytes: Vec<u8>) -> Result<Self, PicturesError> {
        let sizes = 1..=1000;
        if !sizes.contains(&side) || !sizes.contains(&starts) {
            return Err(PicturesError::Format { side, starts });
        }
        let each = side * side * starts;
        if bytes.len() % each != 0 {
            let bytes = bytes.len();
            return Err(PicturesError::Remainder { bytes, each });
        }
        match bytes.len() / each {
            0..4 => Err(PicturesError::TooFew(bytes.len() / each)),
            _ => Ok(Self { side, starts, bytes }),
        }
    }

    /// Pixels along a side.
    #[must_use]
    pub const fn side(&self) -> usize {
        self.side
    }

    /// Pictures of each controller.
    #[must_use]
    pub const fn starts(&self) -> usize {
        self.starts
    }

    /// Number of controllers.
    #[must_use]
    pub const fn controllers(&self) -> usize {
        self.bytes.len() / (self.side * self.side * self.starts)
    }

    /// The picture of one controller from one of its starts, both counted from 0 and within what there is.
    #[must_use]
    pub fn picture(&self, controller: usize, start: usize) -> &[u8] {
        let pixels = self.side * self.side;
        &self.bytes[(controller * self.starts + start) * pixels..][..pixels]
    }

    /// BLAKE3 over side, starts and every byte, as 64 hexadecimal digits: a checkpoint's `data_digest`.
    #[must_use]
    pub fn digest(&self) -> String {
        let mut hasher = blake3::Hasher::new_derive_key("murmuration training pictures v1");
        hasher.update(&(self.side as u64).to_le_bytes());
        hasher.update(&(self.starts as u64).to_le_bytes());
        hasher.update(&self.bytes);
        hasher.finalize().to_hex().to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_are_found_by_controller_and_start() {
        let pictures = Pictures::new(2, 2, (0..32).collect()).unwrap();
        assert_eq!(pictures.controllers(), 4);
        assert_eq!(pictures.picture(1, 1), [12, 13, 14, 15]);
    }

    #[test]
    fn what_is_no_set_of_pictures_is_refused() {
        let refusal = |side, starts, bytes| Pictures::new(side, starts, vec![0; bytes]).unwrap_err();
        assert_eq!(refusal(0, 1, 0), PicturesError::Format { side: 0, starts: 1 });
        assert_eq!(refusal(2, 1, 18), PicturesError::Remainder { bytes: 18, each: 4 });
        assert_eq!(refusal(2, 2, 24), PicturesError::TooFew(3));
    }

    #[test]
    fn the_digest_tells_how_pictures_belong_together() {
        let digest = |side, starts| Pictures::new(side, starts, vec![0; 64]).unwrap().digest();
        assert_ne!(digest(1, 1), digest(1, 4));
        assert_ne!(digest(1, 4), digest(2, 1));
    }
}
