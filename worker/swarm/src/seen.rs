//! The pictures whose classes an embedder learned from, so that these pictures do not judge the embedder.

use crate::Invalid;
use std::collections::BTreeSet;

/// Bytes of a fingerprint: among a million pictures, the chance that two share a fingerprint is under one in ten million.
const BYTES: usize = 8;

/// The pictures whose classes an embedder or its ancestors learned from, as the first eight bytes of their BLAKE3 digests.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SeenPictures(BTreeSet<[u8; BYTES]>);

impl SeenPictures {
    /// Maximum number of pictures: their fingerprints take 2 MiB.
    pub const MOST: usize = 1 << 18;

    /// The set of these pictures, given by their grey values.
    #[must_use]
    pub fn of<'a>(pictures: impl Iterator<Item = &'a [u8]>) -> Self {
        Self(pictures.map(fingerprint).collect())
    }

    /// Whether a picture is in the set. A wrong yes has a chance of under one in ten million.
    #[must_use]
    pub fn has(&self, picture: &[u8]) -> bool {
        self.0.contains(&fingerprint(picture))
    }

    /// Adds the pictures of an ancestor.
    pub fn join(&mut self, other: &Self) {
        self.0.extend(&other.0);
    }

    /// The fingerprints one after the other, in ascending order.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        self.0.iter().flatten().copied().collect()
    }

    /// Reads the bytes of [`SeenPictures::to_bytes`].
    ///
    /// # Errors
    /// If the bytes are not a whole number of fingerprints, or too many.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Invalid> {
        let (fingerprints, rest) = bytes.as_chunks::<BYTES>();
        if !rest.is_empty() || fingerprints.len() > Self::MOST {
            let allowed = format!("a multiple of {BYTES}, for at most {} pictures", Self::MOST);
            return Err(Invalid::new(
                "labelled",
                format!("{} bytes", bytes.len()),
                allowed,
            ));
        }
        Ok(Self(fingerprints.iter().copied().collect()))
    }
}

fn fingerprint(picture: &[u8]) -> [u8; BYTES] {
    let digest = blake3::hash(picture);
    std::array::from_fn(|place| digest.as_bytes()[place])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_seen_is_known_again() {
        let pictures: [&[u8]; 3] = [&[1; 2500], &[2; 2500], &[1; 2500]];
        let mut seen = SeenPictures::of(pictures.into_iter());
        assert!(seen.has(&[2; 2500]) && !seen.has(&[3; 2500]));
        assert_eq!(seen.to_bytes().len(), 16, "the same picture counts once");
        assert_eq!(SeenPictures::from_bytes(&seen.to_bytes()).unwrap(), seen);
        seen.join(&SeenPictures::of([&[3; 2500][..]].into_iter()));
        assert!(seen.has(&[3; 2500]) && seen.has(&[1; 2500]));
    }

    #[test]
    fn what_is_no_list_of_fingerprints_is_refused() {
        assert_eq!(SeenPictures::from_bytes(&[0; 9]).unwrap_err().field, "labelled");
        let many = vec![0; 8 * (SeenPictures::MOST + 1)];
        assert!(SeenPictures::from_bytes(&many).is_err());
        assert_eq!(SeenPictures::from_bytes(&[]).unwrap(), SeenPictures::default());
    }
}
