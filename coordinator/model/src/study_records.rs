//! The data that a coordinator keeps of a study: its file, and records of its measurements.

use murmuration_proto::{PART_BYTES, v1};
use murmuration_swarm::{Invalid, counted};

/// Folder of the reports of studies in a data directory; each study has a folder in it.
pub const STUDIES: &str = "studies";

/// The file and the options of the last run of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyFile {
    /// Text of the study file.
    pub toml: String,
    /// The file's folder, an absolute path.
    pub folder: String,
    /// Whether the study was run with `--quick`.
    pub quick: bool,
    /// Digest of the settings by which the cells were measured.
    pub measures: String,
}

/// The kind of a record.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum StudyRecordKind {
    /// Measurements of a cell, JSON. The key is the digest of the cell's specification.
    Cell,
    /// Digest of a checkpoint. The key is the digest of the specification that trained the checkpoint.
    Embedder,
    /// The atlas that recall is measured by, JSON.
    Reference,
    /// The classes that people gave, CSV.
    Classes,
}

/// A record of a study.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyRecord {
    pub kind: StudyRecordKind,
    /// Key that distinguishes the record from other records of its kind.
    pub key: String,
    /// Digest of the settings of the measurement; empty for embedders and classes.
    pub measures: String,
    pub content: Vec<u8>,
}

impl StudyRecordKind {
    pub const ALL: [Self; 4] = [Self::Cell, Self::Embedder, Self::Reference, Self::Classes];

    /// The kind's name in the store.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cell => "cell",
            Self::Embedder => "embedder",
            Self::Reference => "reference",
            Self::Classes => "classes",
        }
    }
}

impl StudyRecord {
    /// Longest key, in bytes: a digest.
    const MAX_KEY: usize = 64;
    /// Maximum number of bytes of the content (256 MiB).
    pub const MAX_CONTENT: usize = 256 << 20;

    /// The record as parts of a message: first the record without its content, then the content.
    pub fn parts(self) -> impl Iterator<Item = v1::study_part::Part> {
        use v1::study_part::Part;
        let record = Part::Record((&self).into());
        let content: Vec<Part> = self
            .content
            .chunks(PART_BYTES)
            .map(|content| Part::Content(content.to_vec()))
            .collect();
        std::iter::once(record).chain(content)
    }
}

/// A study, or records of a study, as the parts arrive.
#[derive(Debug, Default)]
pub struct StudyParts {
    pub file: Option<StudyFile>,
    pub records: Vec<StudyRecord>,
    /// Bytes of the contents of all records.
    bytes: usize,
}

impl StudyParts {
    /// # Errors
    /// If the part is invalid: content must have 1 to [`PART_BYTES`] bytes, and a record before it.
    pub fn add(&mut self, part: Option<v1::study_part::Part>) -> Result<(), Invalid> {
        use v1::study_part::Part;
        match part {
            None => {}
            Some(Part::File(file)) => self.file = Some(file.into()),
            Some(Part::Record(record)) => self.records.push(record.try_into()?),
            Some(Part::Content(content)) => {
                if !(1..=PART_BYTES).contains(&content.len()) {
                    let found = counted(content.len() as u64, "byte");
                    let allowed = format!("1 to {PART_BYTES} bytes a part");
                    return Err(Invalid::new("content", found, allowed));
                }
                let record = self.records.last_mut();
                let record = record.ok_or_else(|| Invalid::missing("record", "before its content"))?;
                self.bytes += content.len();
                record.content.extend(content);
            }
        }
        Ok(())
    }

    /// Bytes of the contents of all records.
    #[must_use]
    pub const fn bytes(&self) -> usize {
        self.bytes
    }
}

impl From<StudyFile> for v1::StudyFile {
    fn from(file: StudyFile) -> Self {
        Self {
            toml: file.toml,
            folder: file.folder,
            quick: file.quick,
            measures: file.measures,
        }
    }
}

impl From<v1::StudyFile> for StudyFile {
    fn from(message: v1::StudyFile) -> Self {
        Self {
            toml: message.toml,
            folder: message.folder,
            quick: message.quick,
            measures: message.measures,
        }
    }
}

/// The record without its content, which follows in parts of its own.
impl TryFrom<v1::StudyRecord> for StudyRecord {
    type Error = Invalid;

    fn try_from(message: v1::StudyRecord) -> Result<Self, Invalid> {
        use v1::StudyRecordKind as Kind;
        let kind = match message.kind() {
            Kind::Unspecified => return Err(Invalid::missing("record.kind", "a kind of record")),
            Kind::Cell => StudyRecordKind::Cell,
            Kind::Embedder => StudyRecordKind::Embedder,
            Kind::Reference => StudyRecordKind::Reference,
            Kind::Classes => StudyRecordKind::Classes,
        };
        if message.key.len() > Self::MAX_KEY || message.measures.len() > Self::MAX_KEY {
            let allowed = format!("at most {} characters", Self::MAX_KEY);
            return Err(Invalid::new("record.key", "a longer one", allowed));
        }
        Ok(Self {
            kind,
            key: message.key,
            measures: message.measures,
            content: Vec::new(),
        })
    }
}

impl From<StudyRecordKind> for v1::StudyRecordKind {
    fn from(kind: StudyRecordKind) -> Self {
        match kind {
            StudyRecordKind::Cell => Self::Cell,
            StudyRecordKind::Embedder => Self::Embedder,
            StudyRecordKind::Reference => Self::Reference,
            StudyRecordKind::Classes => Self::Classes,
        }
    }
}

/// The record without its content.
impl From<&StudyRecord> for v1::StudyRecord {
    fn from(record: &StudyRecord) -> Self {
        Self {
            kind: v1::StudyRecordKind::from(record.kind).into(),
            key: record.key.clone(),
            measures: record.measures.clone(),
        }
    }
}
