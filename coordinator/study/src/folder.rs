//! The folder of a study in a data directory: its file, the embedders that its cells share, and what was measured.

use crate::{file::StudyError, identity::cell_digest, measured::Measured, study::Study};
use murmuration_proto::{CheckpointDigest, Invalid};
use murmuration_report::{Folder, ReportError};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::{
    collections::BTreeMap,
    fs, io,
    path::{Path, PathBuf},
};

/// The folder of all studies in a data directory.
const STUDIES: &str = "studies";
/// The study file, as it was when the study was last run.
const FILE: &str = "study.toml";
/// How it was run.
const ORIGIN: &str = "origin.json";
/// The checkpoints that cells share.
const EMBEDDERS: &str = "embedders.json";
/// Most bytes of a file in the folder.
const MOST_BYTES: u64 = 256 << 20;

/// Why the folder of a study cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// There is no such study.
    #[error("there is no study \"{name}\" in {}: `murmuration study list` lists the studies", data.display())]
    NoStudy {
        /// The name.
        name: String,
        /// The data directory.
        data: PathBuf,
    },
    /// A file cannot be read.
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A file cannot be written.
    #[error("{0}")]
    Write(#[from] ReportError),
    /// The study file that was kept cannot be used.
    #[error("{}: {error}", path.display())]
    Study {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        error: StudyError,
    },
    /// A cell of the study cannot be made.
    #[error("{0}")]
    Cell(#[from] Invalid),
}

/// Where the study came from.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Origin {
    /// Whether it was run with `--quick`.
    quick: bool,
    /// The folder of its file.
    folder: PathBuf,
    /// How its cells were measured.
    measures: String,
}

/// A study as it was last run.
#[derive(Debug, Clone)]
pub struct KeptStudy {
    /// Its folder.
    pub folder: StudyFolder,
    /// The study.
    pub study: Study,
    /// How its cells were measured ([`measures_digest`](crate::measures_digest)).
    pub measures: String,
}

/// The folder of a study in a data directory.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyFolder {
    path: PathBuf,
}

/// The names of the studies of a data directory, in alphabetical order.
///
/// # Errors
/// [`FolderError::Unreadable`].
pub fn studies(data: &Path) -> Result<Vec<String>, FolderError> {
    let folder = data.join(STUDIES);
    let entries = match fs::read_dir(&folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(unreadable(&folder, error)),
    };
    let mut names = Vec::new();
    for entry in entries {
        let entry = entry.map_err(|error| unreadable(&folder, error))?;
        if entry.path().join(FILE).is_file()
            && let Ok(name) = entry.file_name().into_string()
        {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

impl StudyFolder {
    /// That of a study, which need not exist yet.
    #[must_use]
    pub fn of(data: &Path, study: &Study) -> Self {
        Self {
            path: data.join(STUDIES).join(study.name().as_str()),
        }
    }

    /// A study of a data directory, as it was last run.
    ///
    /// # Errors
    /// See [`FolderError`].
    pub fn open(data: &Path, name: &str) -> Result<KeptStudy, FolderError> {
        if !studies(data)?.iter().any(|known| known == name) {
            return Err(FolderError::NoStudy {
                name: name.to_owned(),
                data: data.to_owned(),
            });
        }
        let folder = Self {
            path: data.join(STUDIES).join(name),
        };
        let path = folder.path.join(FILE);
        let text = read(&path)?;
        let text = String::from_utf8(text).map_err(|error| unreadable(&path, error))?;
        let origin: Origin = folder.json(ORIGIN)?.unwrap_or_default();
        let study = Study::from_toml(&text, &origin.folder, origin.quick);
        Ok(KeptStudy {
            study: study.map_err(|error| FolderError::Study { path, error })?,
            measures: origin.measures,
            folder,
        })
    }

    /// The folder.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Keeps the study file and how its cells are measured. `folder` is the file's, made absolute.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn keep_study(
        &self,
        text: &str,
        (folder, quick): (&Path, bool),
        measures: &str,
    ) -> Result<(), FolderError> {
        let origin = Origin {
            quick,
            folder: folder.to_owned(),
            measures: measures.to_owned(),
        };
        let mut files = Folder::create(&self.path)?;
        files.bytes(ORIGIN, &json_bytes(&origin))?;
        files.text(FILE, text)?;
        Ok(())
    }

    /// The checkpoints that cells share, by the digest of the campaign that trains each.
    ///
    /// # Errors
    /// [`FolderError::Unreadable`].
    pub fn embedders(&self) -> Result<BTreeMap<String, CheckpointDigest>, FolderError> {
        let kept: BTreeMap<String, String> = self.json(EMBEDDERS)?.unwrap_or_default();
        let parsed = |(cell, digest): (String, String)| Ok((cell, digest.parse()?));
        kept.into_iter().map(parsed).collect()
    }

    /// Keeps the checkpoints that cells share.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn keep_embedders(&self, embedders: &BTreeMap<String, CheckpointDigest>) -> Result<(), FolderError> {
        let kept: BTreeMap<&String, String> = embedders
            .iter()
            .map(|(cell, digest)| (cell, digest.to_string()))
            .collect();
        Folder::create(&self.path)?.bytes(EMBEDDERS, &json_bytes(&kept))?;
        Ok(())
    }

    /// Keeps what was measured of a cell.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn keep(&self, measured: &Measured) -> Result<(), FolderError> {
        let mut files = Folder::create(&self.path)?;
        files.folder("cells")?;
        files.bytes(&of_cell(&measured.cell), &json_bytes(measured))?;
        Ok(())
    }

    /// What was measured of the cell with this digest in this way; `None` if nothing was, or in another way, or if the file is
    /// damaged: then it is measured again.
    ///
    /// # Errors
    /// [`FolderError::Unreadable`].
    pub fn measured(&self, cell: &str, measures: &str) -> Result<Option<Measured>, FolderError> {
        let path = self.path.join(of_cell(cell));
        if !path.is_file() {
            return Ok(None);
        }
        let measured: Option<Measured> = serde_json::from_slice(&read(&path)?).ok();
        Ok(measured.filter(|measured| measured.cell == cell && measured.measures == measures))
    }

    /// What was measured of each cell of a study in this way, in the order of the cells.
    ///
    /// # Errors
    /// [`FolderError::Unreadable`] or [`FolderError::Cell`].
    pub fn all_measured(&self, study: &Study, measures: &str) -> Result<Vec<Option<Measured>>, FolderError> {
        let embedders = self.embedders()?;
        let measured = |cell| match study.campaign_of(cell, &embedders)? {
            Some(spec) => self.measured(&cell_digest(&spec), measures),
            None => Ok(None),
        };
        study.cells().iter().map(measured).collect()
    }

    /// A file of JSON; `None` if it does not exist.
    fn json<T: DeserializeOwned>(&self, name: &str) -> Result<Option<T>, FolderError> {
        let path = self.path.join(name);
        if !path.is_file() {
            return Ok(None);
        }
        let read = serde_json::from_slice(&read(&path)?);
        read.map(Some).map_err(|error| unreadable(&path, error))
    }
}

fn of_cell(digest: &str) -> String {
    format!("cells/{digest}.json")
}

fn json_bytes(value: &impl Serialize) -> Vec<u8> {
    // Every key is a text or a number, and nothing else can fail.
    serde_json::to_vec_pretty(value).unwrap_or_default()
}

fn read(path: &Path) -> Result<Vec<u8>, FolderError> {
    let length = fs::metadata(path).map_err(|error| unreadable(path, error))?.len();
    if length > MOST_BYTES {
        return Err(unreadable(path, format!("it has more than {MOST_BYTES} bytes")));
    }
    fs::read(path).map_err(|error| unreadable(path, error))
}

fn unreadable(path: &Path, reason: impl ToString) -> FolderError {
    FolderError::Unreadable {
        path: path.to_owned(),
        reason: reason.to_string(),
    }
}
