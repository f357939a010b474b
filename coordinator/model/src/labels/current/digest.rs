//! The digest of what stands.

use super::Labels;
use std::fmt;

/// BLAKE3 of the pairs (individual, class) that stand; 64 hexadecimal digits as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LabelDigest(blake3::Hash);

impl fmt::Display for LabelDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_hex())
    }
}

impl Labels {
    /// The digest of [`Labels::by_individual`]: who gave a label, when, and what stood before it do not matter.
    #[must_use]
    pub fn digest(&self) -> LabelDigest {
        let mut hasher = blake3::Hasher::new_derive_key("murmuration labels v1");
        for (index, class) in self.by_individual() {
            hasher.update(&index.to_le_bytes());
            hasher.update(&(class.as_str().len() as u64).to_le_bytes());
            hasher.update(class.as_str().as_bytes());
        }
        LabelDigest(hasher.finalize())
    }
}
