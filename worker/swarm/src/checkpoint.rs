//! Checkpoints: published embedders, named by the digest of their bytes.

use crate::{Invalid, SeenPictures, Text, counted, text};
use murmuration_proto::v1;
use std::{collections::BTreeMap, fmt, str::FromStr};

/// BLAKE3 of a checkpoint's ONNX bytes; 64 hexadecimal digits as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct CheckpointDigest(blake3::Hash);

impl CheckpointDigest {
    /// The digest of these ONNX bytes.
    #[must_use]
    pub fn of(bytes: &[u8]) -> Self {
        Self(blake3::hash(bytes))
    }
}

impl fmt::Display for CheckpointDigest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0.to_hex())
    }
}

impl FromStr for CheckpointDigest {
    type Err = Invalid;

    fn from_str(text: &str) -> Result<Self, Invalid> {
        let shown = || format!("\"{}\"", text.chars().take(80).collect::<String>().escape_debug());
        let hash = blake3::Hash::from_hex(text);
        hash.map(Self)
            .map_err(|_| Invalid::new("checkpoint", shown(), "64 hexadecimal digits"))
    }
}

/// The description of a checkpoint: its lineage and its figures.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Lineage {
    /// The checkpoint that training started from; `None` if it started from scratch.
    pub parent: Option<CheckpointDigest>,
    /// Digest of the images that the embedder was trained on, hexadecimal, at most 64 characters; empty if there were none.
    pub data_digest: String,
    /// Digest of the labels that the embedder was trained on, hexadecimal, at most 64 characters; empty if there were none.
    pub label_digest: String,
    /// The training configuration, TOML; at most 64 KiB, without invisible characters.
    pub configuration: String,
    /// At most 100 figures measured on the checkpoint, by name (1 to 64 visible characters), each at most
    /// [`Lineage::MAX_FIGURE`].
    pub metrics: BTreeMap<String, f64>,
    /// The pictures whose classes the embedder or its ancestors learned from.
    pub labelled: SeenPictures,
}

impl Lineage {
    /// Largest magnitude of a figure: well above any loss, spread or count.
    pub const MAX_FIGURE: f64 = 1e15;
    /// Maximum number of bytes of a configuration.
    const MAX_CONFIGURATION: usize = 64 << 10;
    /// Maximum number of characters of a digest, or of a figure's name.
    const MAX_NAME: usize = 64;

    /// The message that describes a checkpoint of this lineage.
    #[must_use]
    pub fn describe(&self, digest: CheckpointDigest, size: u64, created_ms: u64) -> v1::Checkpoint {
        v1::Checkpoint {
            digest: digest.to_string(),
            size,
            parent: self.parent.map(|parent| parent.to_string()).unwrap_or_default(),
            data_digest: self.data_digest.clone(),
            label_digest: self.label_digest.clone(),
            configuration: self.configuration.clone(),
            metrics: self.metrics.clone().into_iter().collect(),
            created_ms,
            labelled: self.labelled.to_bytes(),
        }
    }

    /// The messages that publish these ONNX bytes with this lineage, in order.
    #[must_use]
    pub fn publish_requests(&self, bytes: &[u8]) -> Vec<v1::PublishCheckpointRequest> {
        use v1::publish_checkpoint_request::Part;
        let description = self.describe(CheckpointDigest::of(bytes), bytes.len() as u64, 0);
        let chunk = |data: &[u8]| Part::Chunk(v1::CheckpointChunk { data: data.to_vec() });
        std::iter::once(Part::Description(description))
            .chain(bytes.chunks(murmuration_proto::PART_BYTES).map(chunk))
            .map(|part| v1::PublishCheckpointRequest { part: Some(part) })
            .collect()
    }
}

impl TryFrom<v1::Checkpoint> for Lineage {
    type Error = Invalid;

    fn try_from(message: v1::Checkpoint) -> Result<Self, Invalid> {
        for (field, digest) in [
            ("data_digest", &message.data_digest),
            ("label_digest", &message.label_digest),
        ] {
            if digest.len() > Self::MAX_NAME || !digest.bytes().all(|byte| byte.is_ascii_hexdigit()) {
                let allowed = format!("at most {} hexadecimal digits", Self::MAX_NAME);
                return Err(Invalid::new(field, text::quoted(digest), allowed));
            }
        }
        let configuration = &message.configuration;
        if configuration.len() > Self::MAX_CONFIGURATION {
            let allowed = format!("at most {} bytes", Self::MAX_CONFIGURATION);
            let value = format!("{} bytes", configuration.len());
            return Err(Invalid::new("configuration", value, allowed));
        }
        if Text::lines(configuration).as_str() != configuration {
            let allowed = "without characters that cannot be seen";
            return Err(Invalid::new(
                "configuration",
                text::quoted(configuration),
                allowed,
            ));
        }
        if message.metrics.len() > 100 {
            return Err(Invalid::new(
                "metrics",
                counted(message.metrics.len() as u64, "figure"),
                "at most 100",
            ));
        }
        for name in message.metrics.keys() {
            if text::name("metrics", name, Self::MAX_NAME)? != *name {
                let allowed = "names without spaces at the beginning or end";
                return Err(Invalid::new("metrics", text::quoted(name), allowed));
            }
        }
        let is_figure = |value: f64| value.abs() <= Self::MAX_FIGURE;
        if let Some((name, value)) = message.metrics.iter().find(|(_, value)| !is_figure(**value)) {
            let allowed = format!("finite, and at most {:e} in magnitude", Self::MAX_FIGURE);
            return Err(Invalid::new(
                format!("metrics.{name}"),
                format!("{value:e}"),
                allowed,
            ));
        }
        let parent = match message.parent.as_str() {
            "" => None,
            parent => Some(parent.parse().map_err(|error: Invalid| Invalid {
                field: "parent".into(),
                ..error
            })?),
        };
        Ok(Self {
            parent,
            data_digest: message.data_digest,
            label_digest: message.label_digest,
            configuration: message.configuration,
            metrics: message.metrics.into_iter().collect(),
            labelled: SeenPictures::from_bytes(&message.labelled)?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_digest_is_its_hexadecimal_text() {
        let digest = CheckpointDigest::of(b"model");
        assert_eq!(digest.to_string().parse::<CheckpointDigest>().unwrap(), digest);
        for bad in ["", "abc", &"x".repeat(64), &"a".repeat(65)] {
            let message = bad.parse::<CheckpointDigest>().unwrap_err().to_string();
            assert!(message.ends_with("must be 64 hexadecimal digits"), "{message}");
        }
    }

    #[test]
    fn a_description_reads_back_as_the_same_lineage() {
        let lineage = Lineage {
            parent: Some(CheckpointDigest::of(b"parent")),
            data_digest: "d".into(),
            configuration: "network = \"compact\"".into(),
            metrics: BTreeMap::from([("triplet_accuracy".into(), 0.9)]),
            labelled: SeenPictures::of([&[7; 9][..]].into_iter()),
            ..Lineage::default()
        };
        let message = lineage.describe(CheckpointDigest::of(b"model"), 5, 0);
        assert_eq!(Lineage::try_from(message).unwrap(), lineage);
        for loss in [f64::NAN, f64::NEG_INFINITY, 1e308, -1e16] {
            let message = v1::Checkpoint {
                metrics: [("loss".to_owned(), loss)].into(),
                ..Default::default()
            };
            assert_eq!(Lineage::try_from(message).unwrap_err().field, "metrics.loss");
        }
    }

    #[test]
    fn words_that_hide_or_are_too_long_are_refused_by_name() {
        let refused = |message: v1::Checkpoint| Lineage::try_from(message).unwrap_err().to_string();
        let text = refused(v1::Checkpoint {
            metrics: [("lo\u{202e}ss".to_owned(), 0.5)].into(),
            ..Default::default()
        });
        assert!(
            text.starts_with("metrics = ") && text.contains("U+202E"),
            "{text}"
        );
        let text = refused(v1::Checkpoint {
            metrics: [("x".repeat(1 << 20), 0.5)].into(),
            ..Default::default()
        });
        assert!(text.starts_with("metrics = ") && text.len() < 200, "{text}");
        for configuration in ["seed = 1\u{1b}[2J", "# \u{200b}"] {
            let text = refused(v1::Checkpoint {
                configuration: configuration.to_owned(),
                ..Default::default()
            });
            assert!(text.contains("without characters that cannot be seen"), "{text}");
        }
        let text = refused(v1::Checkpoint {
            data_digest: "a".repeat(65),
            ..Default::default()
        });
        assert!(text.contains("at most 64 hexadecimal digits"), "{text}");
    }
}
