//! What people said about behaviours, as a training takes it: labels, comparisons, or both.

use crate::{compared_pictures::ComparedPictures, labelled_pictures::LabelledPictures};
use murmuration_proto::{PictureShape, SeenPictures};
use std::sync::Arc;

/// What people said, to learn from; empty by default, which no training takes.
#[derive(Debug, Clone, Default)]
pub struct Teaching {
    /// Pictures with their classes.
    pub labelled: Option<Arc<LabelledPictures>>,
    /// Comparisons with their pictures.
    pub compared: Option<Arc<ComparedPictures>>,
}

impl Teaching {
    /// Number of answers that say something: labels, and comparisons in which one behaviour was more alike.
    #[must_use]
    pub fn answers(&self) -> usize {
        let labels = self.labelled.as_ref().map_or(0, |labelled| labelled.labels());
        labels + self.comparisons()
    }

    /// Number of comparisons.
    #[must_use]
    pub fn comparisons(&self) -> usize {
        let compared = self.compared.as_ref();
        compared.map_or(0, |compared| compared.triplets().len())
    }

    /// The shapes of the pictures.
    pub(super) fn shapes(&self) -> impl Iterator<Item = PictureShape> {
        let labelled = self.labelled.as_ref().map(|labelled| labelled.shape());
        let compared = self.compared.as_ref().map(|compared| compared.shape());
        labelled.into_iter().chain(compared)
    }

    /// The pictures that an embedder sees if it learns from these.
    #[must_use]
    pub fn seen(&self) -> SeenPictures {
        let mut seen = SeenPictures::default();
        if let Some(labelled) = &self.labelled {
            seen.join(&labelled.seen());
        }
        if let Some(compared) = &self.compared {
            seen.join(&compared.seen());
        }
        seen
    }

    /// A checkpoint's `label_digest`, 64 hexadecimal digits: that of the labelled pictures, or of the compared ones, or of both
    /// digests; empty if there is nothing.
    #[must_use]
    pub fn digest(&self) -> String {
        let labelled = self.labelled.as_ref().map(|labelled| labelled.digest());
        let compared = self.compared.as_ref().map(|compared| compared.digest());
        match (labelled, compared) {
            (Some(labelled), Some(compared)) => {
                let mut hasher = blake3::Hasher::new_derive_key("murmuration labels and comparisons v1");
                hasher.update(labelled.as_bytes());
                hasher.update(compared.as_bytes());
                hasher.finalize().to_hex().to_string()
            }
            (labelled, compared) => labelled.or(compared).unwrap_or_default(),
        }
    }
}

impl From<Arc<LabelledPictures>> for Teaching {
    fn from(labelled: Arc<LabelledPictures>) -> Self {
        Self {
            labelled: Some(labelled),
            compared: None,
        }
    }
}

impl From<Arc<ComparedPictures>> for Teaching {
    fn from(compared: Arc<ComparedPictures>) -> Self {
        Self {
            labelled: None,
            compared: Some(compared),
        }
    }
}
