//! Studies: the file of each study, and the records of its measurements.

mod folders;

pub(crate) use folders::take_over;

use super::{Store, StoreError, numbers::clamped};
use murmuration_model::study_records::{StudyFile, StudyRecord, StudyRecordKind};
use murmuration_swarm::CampaignName;
use rusqlite::{Connection, OptionalExtension as _, Transaction, params};

/// How often a study was changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StudyVersion {
    /// Number of changes of the study's file and measurements.
    pub measured: i64,
    /// Number of changes of the classes that people gave.
    pub classes: i64,
}

/// A record of a study, without its content.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StudyEntry {
    pub kind: StudyRecordKind,
    /// Key that distinguishes the record from other records of its kind.
    pub key: String,
    /// Digest of the settings of the measurement.
    pub measures: String,
}

impl Store {
    /// The names of all studies, in alphabetical order.
    ///
    /// # Errors
    /// If the names cannot be read.
    pub fn studies(&self) -> Result<Vec<String>, StoreError> {
        self.read(|connection| {
            let mut statement = connection.prepare_cached("SELECT name FROM studies ORDER BY name")?;
            let names = statement.query_map([], |row| row.get(0))?;
            names.map(|name| Ok(name?)).collect()
        })
    }

    /// Stores the file of a study, records of the study, or both. A new file replaces the former file, and a record replaces the
    /// former record with the same kind and key.
    ///
    /// # Errors
    /// [`StoreError::NoStudy`] if the study does not exist and `file` is `None`; nothing has changed then.
    pub fn keep_study(
        &self,
        name: &CampaignName,
        file: Option<&StudyFile>,
        records: &[StudyRecord],
    ) -> Result<(), StoreError> {
        self.write(|transaction| keep(transaction, name.as_str(), file, records))
    }

    /// # Errors
    /// [`StoreError::NoStudy`], or if the study cannot be read.
    pub fn study_version(&self, name: &str) -> Result<StudyVersion, StoreError> {
        self.read(|connection| {
            let query = "SELECT measured, classes FROM studies WHERE name = ?1";
            let version = connection.query_row(query, [name], |row| {
                Ok(StudyVersion {
                    measured: row.get(0)?,
                    classes: row.get(1)?,
                })
            });
            version.optional()?.ok_or_else(|| no_study(name))
        })
    }

    /// # Errors
    /// [`StoreError::NoStudy`], or if the study cannot be read.
    pub fn study_file(&self, name: &str) -> Result<StudyFile, StoreError> {
        self.read(|connection| {
            let query = "SELECT toml, folder, quick, measures FROM studies WHERE name = ?1";
            let file = connection.query_row(query, [name], |row| {
                Ok(StudyFile {
                    toml: row.get(0)?,
                    folder: row.get(1)?,
                    quick: row.get(2)?,
                    measures: row.get(3)?,
                })
            });
            file.optional()?.ok_or_else(|| no_study(name))
        })
    }

    /// The records of a study without their contents, in the order of kinds and keys; empty if the study does not exist.
    ///
    /// # Errors
    /// If the records cannot be read.
    pub fn study_entries(&self, name: &str) -> Result<Vec<StudyEntry>, StoreError> {
        self.read(|connection| {
            let query = "SELECT kind, key, measures FROM study_records WHERE study = ?1 ORDER BY kind, key";
            let mut statement = connection.prepare_cached(query)?;
            let mut rows = statement.query([name])?;
            let mut entries = Vec::new();
            while let Some(row) = rows.next()? {
                let kind: String = row.get(0)?;
                let kind = StudyRecordKind::ALL
                    .into_iter()
                    .find(|known| known.name() == kind);
                entries.push(StudyEntry {
                    kind: kind
                        .ok_or_else(|| StoreError::damaged("a record of a study is of no known kind"))?,
                    key: row.get(1)?,
                    measures: row.get(2)?,
                });
            }
            Ok(entries)
        })
    }

    /// The content of a record; `None` if the record does not exist.
    ///
    /// # Errors
    /// If the content cannot be read.
    pub fn study_content(
        &self,
        name: &str,
        kind: StudyRecordKind,
        key: &str,
    ) -> Result<Option<Vec<u8>>, StoreError> {
        self.read(|connection| content(connection, name, kind, key))
    }

    /// At most `most` bytes of the content of a record, from byte `from` on; empty beyond the end of the content, or if the
    /// record does not exist.
    ///
    /// # Errors
    /// If the bytes cannot be read.
    pub fn study_content_part(
        &self,
        name: &str,
        entry: &StudyEntry,
        from: usize,
        most: usize,
    ) -> Result<Vec<u8>, StoreError> {
        self.read(|connection| {
            let query = "SELECT substr(content, ?4, ?5) FROM study_records WHERE study = ?1 AND kind = ?2 AND key = ?3";
            let mut statement = connection.prepare_cached(query)?;
            let of = params![name, entry.kind.name(), entry.key, clamped(from as u64 + 1), clamped(most as u64)];
            let part = statement.query_row(of, |row| row.get(0));
            Ok(part.optional()?.unwrap_or_default())
        })
    }

    /// Every record of a study with its content.
    ///
    /// # Errors
    /// If a record cannot be read.
    pub fn study_records(&self, name: &str) -> Result<Vec<StudyRecord>, StoreError> {
        let mut records = Vec::new();
        for StudyEntry { kind, key, measures } in self.study_entries(name)? {
            // If a record was replaced after its entry was read, this reads the new content.
            if let Some(content) = self.study_content(name, kind, &key)? {
                records.push(StudyRecord {
                    kind,
                    key,
                    measures,
                    content,
                });
            }
        }
        Ok(records)
    }
}

fn no_study(name: &str) -> StoreError {
    StoreError::NoStudy(name.to_owned())
}

fn keep(
    transaction: &Transaction<'_>,
    name: &str,
    file: Option<&StudyFile>,
    records: &[StudyRecord],
) -> Result<(), StoreError> {
    if let Some(file) = file {
        transaction.execute(
            "INSERT INTO studies (name, toml, folder, quick, measures) VALUES (?1, ?2, ?3, ?4, ?5)
             ON CONFLICT (name) DO UPDATE SET toml = ?2, folder = ?3, quick = ?4, measures = ?5",
            params![name, file.toml, file.folder, file.quick, file.measures],
        )?;
    }
    let mut statement = transaction.prepare_cached(
        "INSERT OR REPLACE INTO study_records (study, kind, key, measures, content) VALUES (?1, ?2, ?3, ?4, ?5)",
    )?;
    let is_measured = |record: &StudyRecord| record.kind != StudyRecordKind::Classes;
    let (measured, classes) = (
        file.is_some() || records.iter().any(is_measured),
        !records.iter().all(is_measured),
    );
    let changed = transaction.execute(
        "UPDATE studies SET measured = measured + ?2, classes = classes + ?3 WHERE name = ?1",
        params![name, measured, classes],
    )?;
    if changed == 0 {
        return Err(no_study(name));
    }
    for record in records {
        let StudyRecord {
            kind,
            key,
            measures,
            content,
        } = record;
        statement.execute(params![name, kind.name(), key, measures, content])?;
    }
    Ok(())
}

fn content(
    connection: &Connection,
    name: &str,
    kind: StudyRecordKind,
    key: &str,
) -> Result<Option<Vec<u8>>, StoreError> {
    let query = "SELECT content FROM study_records WHERE study = ?1 AND kind = ?2 AND key = ?3";
    let mut statement = connection.prepare_cached(query)?;
    let content = statement.query_row(params![name, kind.name(), key], |row| row.get(0));
    Ok(content.optional()?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DataDirectory;

    fn record(kind: StudyRecordKind, key: &str, content: &str) -> StudyRecord {
        StudyRecord {
            kind,
            key: key.to_owned(),
            measures: "so".to_owned(),
            content: content.into(),
        }
    }

    #[test]
    fn records_replace_those_of_the_same_kind_and_key() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(&DataDirectory::hold(folder.path()).unwrap()).unwrap();
        let name: CampaignName = "small".to_owned().try_into().unwrap();
        let cell = record(StudyRecordKind::Cell, "a", "first");
        let refused = store.keep_study(&name, None, std::slice::from_ref(&cell));
        assert!(matches!(refused, Err(StoreError::NoStudy(_))), "{refused:?}");
        assert_eq!(store.study_records("small").unwrap(), []);

        let file = StudyFile {
            toml: "name = \"small\"".to_owned(),
            folder: "/home".to_owned(),
            quick: true,
            measures: "so".to_owned(),
        };
        store.keep_study(&name, Some(&file), &[cell]).unwrap();
        let before = store.study_version("small").unwrap();
        let classes = record(StudyRecordKind::Classes, "", "cell,index,class,by");
        let again = record(StudyRecordKind::Cell, "a", "second");
        let other = record(StudyRecordKind::Cell, "b", "other");
        for added in [&classes, &again, &other] {
            store
                .keep_study(&name, None, std::slice::from_ref(added))
                .unwrap();
        }
        assert_eq!(store.studies().unwrap(), ["small"]);
        assert_eq!(store.study_file("small").unwrap(), file);
        let entry = &store.study_entries("small").unwrap()[0];
        let part = |from, most| store.study_content_part("small", entry, from, most).unwrap();
        assert_eq!(
            (part(0, 3), part(3, 9), part(6, 9)),
            (b"sec".to_vec(), b"ond".to_vec(), Vec::new())
        );
        assert_eq!(store.study_records("small").unwrap(), [again, other, classes]);
        let after = store.study_version("small").unwrap();
        assert_eq!(
            (after.measured - before.measured, after.classes - before.classes),
            (2, 1)
        );
    }
}
