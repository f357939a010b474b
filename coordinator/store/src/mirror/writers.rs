//! The file `mirror.json`: a data directory records its mirrors there, and who wrote to them.

use super::{MirrorError, entries::Entry};
use crate::{
    StoreError,
    files::{read_beginning, sync},
};
use bytes::Bytes;
use murmuration_files::write_file;
use serde::{Deserialize, Serialize};
use std::{collections::BTreeMap, fs, io, path::Path};

/// The file in the data directory.
pub(super) const FILE: &str = "mirror.json";
/// Maximum number of bytes of that file; it has some hundred for each mirror that the directory has had.
const MAX_BYTES: u64 = 1 << 20;

/// The processes of a data directory that wrote to its mirror, and to mirrors before it.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Writers {
    /// The mirror that was claimed last.
    #[serde(flatten)]
    pub(super) here: Known,
    /// Other mirrors. Their writers are known until the mirror that was claimed last has the database.
    #[serde(default)]
    elsewhere: Vec<Known>,
}

/// The processes of a data directory that wrote to one mirror.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(super) struct Known {
    /// The mirror's canonical path, or its URL.
    #[serde(default)]
    pub(super) mirror: String,
    /// The process that holds the directory now, or held it last; empty if unknown.
    pub(super) writer: String,
    /// The process that wrote the newest entry before, in case that `writer` never wrote; empty if unknown.
    pub(super) former: String,
    /// Whether the directory's database is still being made from the mirror.
    pub(super) restoring: bool,
    /// Inode of the database that was made from the mirror, if it is complete.
    #[serde(default)]
    pub(super) database: Option<u64>,
    /// Whether the mirror has had a snapshot of the database.
    #[serde(default)]
    pub(super) has_snapshot: bool,
    /// The claims of `writer` and `former`.
    #[serde(default)]
    pub(super) claims: Vec<RememberedClaim>,
}

/// A claim of a process of this directory. It is never removed from the mirror.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct RememberedClaim {
    writer: String,
    pub(super) number: u64,
    /// BLAKE3 of the objects that the entry can be.
    pub(super) digests: Vec<String>,
}

impl RememberedClaim {
    /// Entry `number` of `writer`: the claim, or the trial that takes its place in an object store without a fence.
    pub(super) fn new(writer: &str, number: u64, objects: [&Bytes; 2]) -> Self {
        Self {
            writer: writer.to_owned(),
            number,
            digests: objects
                .map(|object| blake3::hash(object).to_hex().to_string())
                .into(),
        }
    }
}

impl Known {
    /// Whether the directory's database, which has this inode, has all up to `entry`.
    fn wrote(&self, entry: &Entry, database: Option<u64>) -> bool {
        let writers = [&self.writer, &self.former];
        let is_whole = !self.restoring || self.database.is_some_and(|restored| Some(restored) == database);
        is_whole && !entry.writer.is_empty() && writers.contains(&&entry.writer)
    }

    /// This mirror once the directory's database may no longer be the one that wrote to it; `None` if nothing remains to be known.
    fn without_writers(self) -> Option<Self> {
        self.has_snapshot.then(|| Self {
            mirror: self.mirror,
            has_snapshot: true,
            ..Self::default()
        })
    }
}

impl Writers {
    /// Reads the file of the data directory `data`; without the file, the directory has had no mirror.
    ///
    /// # Errors
    /// If the file cannot be read, or is not what [`Writers::write`] writes.
    pub(super) fn read(data: &Path) -> Result<Self, MirrorError> {
        let path = data.join(FILE);
        let bytes = match read_beginning(&path, MAX_BYTES) {
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Self::default()),
            read => read.map_err(|error| StoreError::from_io(error, "read", &path))?,
        };
        serde_json::from_slice(&bytes).map_err(|error| {
            let error = io::Error::other(format!("{error}: remove it, and name a new mirror"));
            StoreError::from_io(error, "understand", &path).into()
        })
    }

    pub(super) fn write(&self, data: &Path) -> Result<(), MirrorError> {
        let bytes = serde_json::to_vec(self).map_err(io::Error::other)?;
        write_file(&data.join(FILE), &bytes)?;
        Ok(sync(data)?)
    }

    /// Writes this in place of an attempt that has failed.
    pub(super) fn write_back(&self, data: &Path) -> Result<(), MirrorError> {
        if !self.here.writer.is_empty() {
            return self.write(data);
        }
        match fs::remove_file(data.join(FILE)) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error.into()),
            _ => Ok(()),
        }
    }

    /// The mirror that was claimed last, then the others.
    fn all(&self) -> impl Iterator<Item = &Known> {
        std::iter::once(&self.here).chain(&self.elsewhere)
    }

    /// Whether the directory's database has all up to `entry`, the newest of its mirror or of one that it tried.
    pub(super) fn know(&self, entry: &Entry, database: Option<u64>) -> bool {
        self.all().any(|known| known.wrote(entry, database))
    }

    /// Whether the mirror at `place` has had data of this directory.
    pub(super) fn had_data_in(&self, place: &str) -> bool {
        self.all()
            .any(|known| known.has_snapshot && known.mirror == place)
    }

    /// The remembered claims of a process, each once.
    pub(super) fn claims_of(&self, writer: &str) -> Vec<RememberedClaim> {
        let claims = self.all().flat_map(|known| &known.claims);
        let claims = claims.filter(|claim| claim.writer == writer);
        let each: BTreeMap<u64, &RememberedClaim> = claims.map(|claim| (claim.number, claim)).collect();
        each.into_values().cloned().collect()
    }

    /// The claims that a mirror has whose newest entry is this process's: its own, and those before it in the same mirror.
    pub(super) fn claims_before(&self, writer: &str) -> Vec<RememberedClaim> {
        match self.all().find(|known| known.writer == writer) {
            Some(known) => known.claims.clone(),
            None => self.claims_of(writer),
        }
    }

    /// The record while the directory claims the mirror `here`. Without a database, the record loses the writers of other mirrors.
    pub(super) fn with(&self, here: Known, has_database: bool) -> Self {
        let is_other = |known: &&Known| !known.mirror.is_empty() && known.mirror != here.mirror;
        let others = self.all().filter(is_other).cloned();
        let elsewhere = match has_database {
            true => others.collect(),
            false => others.filter_map(Known::without_writers).collect(),
        };
        Self { here, elsewhere }
    }
}

/// Notes that the mirror has a snapshot of the database in `data`, which changes without the other mirrors from now on.
pub(crate) fn note_snapshot(data: &Path) -> Result<(), MirrorError> {
    let mut writers = Writers::read(data)?;
    writers.here.has_snapshot = true;
    writers.elsewhere = writers
        .elsewhere
        .into_iter()
        .filter_map(Known::without_writers)
        .collect();
    writers.write(data)
}

/// Refuses a data directory that has a mirror: its changes would be missing from the mirror.
pub(crate) fn expect_none(data: &Path) -> Result<(), StoreError> {
    let writers = Writers::read(data).map_err(|error| match error {
        MirrorError::Store(error) => error,
        other => StoreError::from_io(io::Error::other(other.to_string()), "read", &data.join(FILE)),
    })?;
    if writers.here.writer.is_empty() {
        return Ok(());
    }
    // After a failed attempt with another mirror, the former one has the data.
    let with_data = writers.all().find(|known| known.has_snapshot);
    Err(StoreError::Mirrored {
        data: data.to_path_buf(),
        mirror: with_data.unwrap_or(&writers.here).mirror.clone(),
        file: FILE,
    })
}
