//! The folder of a study in a data directory: the study file, the embedders that its cells share, and the measurements.

use crate::{
    corrections::Corrections, file::StudyError, identity::cell_digest, maps::Maps, measured::Measured,
    outcome::Outcome, reference::Reference, study::Study,
};
use murmuration_files::write_file;
use murmuration_model::study_files::{STUDIES, STUDY_CLASSES, STUDY_EMBEDDERS, STUDY_FILE, STUDY_ORIGIN};
use murmuration_swarm::{CheckpointDigest, Invalid};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use std::{
    collections::BTreeMap,
    fs,
    io::{self, Read as _},
    path::{Path, PathBuf},
};

/// Lock file in the folder of all studies, held while a study looks for a campaign or starts it.
const BEGINNING: &str = ".beginning";
/// The content of the study's atlas.
const REFERENCE: &str = "reference.json";
/// Most bytes of a file in the folder.
const MOST_BYTES: u64 = 256 << 20;

/// Bytes at the beginning of a cell's file that contain its cell and how it was measured.
const BEGINS: u64 = 512;

/// Why the folder of a study cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("there is no study \"{name}\" in {}: `murmuration lab study list` lists the studies", data.display())]
    NoStudy { name: String, data: PathBuf },
    #[error("cannot read {}: {reason}", path.display())]
    Unreadable { path: PathBuf, reason: String },
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    #[error("{}: {error}", path.display())]
    Study { path: PathBuf, error: StudyError },
    #[error(transparent)]
    Cell(#[from] Invalid),
}

/// How and from where the study was run.
#[derive(Debug, Default, Serialize, Deserialize)]
struct Origin {
    /// Whether it was run with `--quick`.
    quick: bool,
    folder: PathBuf,
    /// How its cells are measured ([`measures_digest`](crate::measures_digest)).
    measures: String,
}

/// A study as it was last run.
#[derive(Debug, Clone)]
pub struct KeptStudy {
    pub folder: StudyFolder,
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
        if entry.path().join(STUDY_FILE).is_file()
            && let Ok(name) = entry.file_name().into_string()
        {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

/// Prevents other studies of this data directory from looking for campaigns or starting them until the returned file is dropped.
/// Waits for the lock. Otherwise two studies that run at once would both find no campaign, and start it twice.
pub fn lock_beginning(data: &Path) -> Result<fs::File, FolderError> {
    let folder = data.join(STUDIES);
    let path = folder.join(BEGINNING);
    let options = || {
        fs::File::options()
            .create(true)
            .truncate(false)
            .write(true)
            .open(&path)
    };
    let locked = fs::create_dir_all(&folder)
        .and_then(|()| options())
        .and_then(|file| file.lock().map(|()| file));
    locked.map_err(|source| unreadable(&path, source))
}

impl KeptStudy {
    /// The study with its measurements, and with these classes instead of the judge's.
    pub fn outcome(self, corrections: Corrections) -> Result<Outcome, FolderError> {
        let measured = self.folder.all_measured(&self.study, &self.measures)?;
        let reference = self.folder.reference(&self.measures)?;
        Ok(Outcome::new(self.study, measured, corrections).with_reference(reference))
    }
}

impl StudyFolder {
    /// The folder of a study, which need not exist yet.
    pub fn of(data: &Path, study: &Study) -> Self {
        Self {
            path: data.join(STUDIES).join(study.name.as_str()),
        }
    }

    /// A study of a data directory, as it was last run.
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
        let path = folder.path.join(STUDY_FILE);
        let text = read(&path)?;
        let text = String::from_utf8(text).map_err(|error| unreadable(&path, error))?;
        let origin: Origin = folder.json(STUDY_ORIGIN)?.unwrap_or_default();
        let study = Study::from_toml(&text, &origin.folder, origin.quick);
        Ok(KeptStudy {
            study: study.map_err(|error| FolderError::Study { path, error })?,
            measures: origin.measures,
            folder,
        })
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a whole file of the folder.
    fn write(&self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        let path = self.path.join(name);
        match write_file(&path, bytes) {
            Ok(_) => Ok(()),
            Err(source) => Err(FolderError::Write { path, source }),
        }
    }

    /// Stores the study file and how its cells are measured. `folder` is the folder of the file, as an absolute path.
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
        self.write(STUDY_ORIGIN, &json_bytes(&origin))?;
        self.write(STUDY_FILE, text.as_bytes())
    }

    /// The checkpoints that cells share, by the digest of the campaign that trains each.
    pub fn embedders(&self) -> Result<BTreeMap<String, CheckpointDigest>, FolderError> {
        let kept: BTreeMap<String, String> = self.json(STUDY_EMBEDDERS)?.unwrap_or_default();
        let parsed = |(cell, digest): (String, String)| Ok((cell, digest.parse()?));
        kept.into_iter().map(parsed).collect()
    }

    /// Stores the checkpoints that cells share.
    pub fn keep_embedders(&self, embedders: &BTreeMap<String, CheckpointDigest>) -> Result<(), FolderError> {
        let kept: BTreeMap<&String, String> = embedders
            .iter()
            .map(|(cell, digest)| (cell, digest.to_string()))
            .collect();
        self.write(STUDY_EMBEDDERS, &json_bytes(&kept))
    }

    /// Stores the content of the study's atlas.
    pub fn keep_reference(&self, reference: &Reference) -> Result<(), FolderError> {
        self.write(REFERENCE, &json_bytes(reference))
    }

    /// The content of the study's atlas for cells that are measured in this way. `None` if there is none, if it was made in another
    /// way, or if the file is damaged: then it is made again.
    pub fn reference(&self, measures: &str) -> Result<Option<Reference>, FolderError> {
        let path = self.path.join(REFERENCE);
        if !path.is_file() {
            return Ok(None);
        }
        let reference: Option<Reference> = serde_json::from_slice(&read(&path)?).ok();
        Ok(reference.filter(|reference| reference.measures == measures && reference.is_sound()))
    }

    /// The classes that people gave on the page of the study.
    ///
    /// # Errors
    /// [`FolderError::Unreadable`] names a file that cannot be read, and the invalid line.
    pub fn classes(&self) -> Result<Corrections, FolderError> {
        let path = self.path.join(STUDY_CLASSES);
        if !path.is_file() {
            return Ok(Corrections::default());
        }
        let text = String::from_utf8(read(&path)?).map_err(|error| unreadable(&path, error))?;
        Corrections::parse(&text).map_err(|error| unreadable(&path, error))
    }

    /// Stores the classes that people gave.
    pub fn keep_classes(&self, classes: &Corrections) -> Result<(), FolderError> {
        self.write(STUDY_CLASSES, classes.to_csv().as_bytes())
    }

    /// Stores the measurements of a cell.
    pub fn keep(&self, measured: &Measured) -> Result<(), FolderError> {
        self.write(&of_cell(&measured.cell), &json_bytes(measured))
    }

    /// The measurements of the cell with this digest in this way. `None` if there are none, if they were made in another way, or if
    /// the file is damaged: then the cell is measured again.
    pub fn measured(&self, cell: &str, measures: &str) -> Result<Option<Measured>, FolderError> {
        let path = self.path.join(of_cell(cell));
        if !path.is_file() {
            return Ok(None);
        }
        let measured: Option<Measured> = serde_json::from_slice(&read(&path)?).ok();
        let is_this = |measured: &Measured| measured.cell == cell && measured.measures == measures;
        let is_sound = |measured: &Measured| measured.maps.as_ref().is_none_or(Maps::is_sound);
        Ok(measured.filter(|measured| is_this(measured) && is_sound(measured)))
    }

    /// Whether the cell with this digest was measured in this way. Reads only the beginning of its file: the rest may be damaged.
    pub fn is_measured(&self, cell: &str, measures: &str) -> Result<bool, FolderError> {
        let path = self.path.join(of_cell(cell));
        let mut beginning = Vec::new();
        let read = fs::File::open(&path).and_then(|file| file.take(BEGINS).read_to_end(&mut beginning));
        match read {
            Ok(_) => {}
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(false),
            Err(error) => return Err(unreadable(&path, error)),
        }
        let beginning = String::from_utf8_lossy(&beginning);
        let says = |field: &str, value: &str| beginning.contains(&format!("\"{field}\": \"{value}\""));
        Ok(says("cell", cell) && says("measures", measures))
    }

    /// The measurements of each cell of a study that were made in this way, in the order of the cells.
    pub fn all_measured(&self, study: &Study, measures: &str) -> Result<Vec<Option<Measured>>, FolderError> {
        let embedders = self.embedders()?;
        let measured = |cell| match study.campaign_of(cell, &embedders)? {
            Some(spec) => self.measured(&cell_digest(&spec), measures),
            None => Ok(None),
        };
        study.cells.iter().map(measured).collect()
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
    // Serialization cannot fail: every key is a text or a number.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{maps::MappedIndividual, sample};

    #[test]
    fn a_cell_is_measured_if_its_file_says_so_and_can_be_drawn() {
        let data = tempfile::tempdir().unwrap();
        let study = sample::study();
        let folder = StudyFolder::of(data.path(), &study);
        let mut measured = sample::measured(&study, 0, &[&["milling"]]);
        let cell = measured.cell.clone();
        assert!(!folder.is_measured(&cell, "so").unwrap());
        folder.keep(&measured).unwrap();
        assert!(folder.is_measured(&cell, "so").unwrap());
        assert!(!folder.is_measured(&cell, "otherwise").unwrap());
        assert_eq!(folder.measured(&cell, "so").unwrap(), Some(measured.clone()));
        let individuals = vec![MappedIndividual {
            index: 0,
            class: "milling".to_owned(),
            score: 1e300,
            controller: [0.0; 2],
            behaviour: [0.0; 2],
        }];
        measured.maps = Some(Maps { individuals });
        folder.keep(&measured).unwrap();
        assert_eq!(folder.measured(&cell, "so").unwrap(), None);
    }

    #[test]
    fn one_at_a_time_begins_campaigns() {
        let data = tempfile::tempdir().unwrap();
        let held = lock_beginning(data.path()).unwrap();
        let (sender, receiver) = std::sync::mpsc::channel();
        let folder = data.path().to_owned();
        let other = std::thread::spawn(move || {
            let held = lock_beginning(&folder).unwrap();
            sender.send(()).unwrap();
            drop(held);
        });
        let waited = receiver.recv_timeout(std::time::Duration::from_millis(200));
        assert!(waited.is_err(), "two hold it");
        drop(held);
        receiver.recv_timeout(std::time::Duration::from_secs(60)).unwrap();
        other.join().unwrap();
        assert_eq!(studies(data.path()).unwrap(), Vec::<String>::new());
    }
}
