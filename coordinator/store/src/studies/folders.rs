//! Studies of earlier versions of Murmuration, which kept each study as a folder in the data directory.

use super::keep;
use crate::StoreError;
use murmuration_model::study_records::{STUDIES, StudyFile, StudyRecord, StudyRecordKind};
use murmuration_swarm::CampaignName;
use rusqlite::Connection;
use std::{
    fs, io,
    path::{Path, PathBuf},
};

/// If the database has no studies, stores the studies that the data directory `data` has in folders. The folders stay. Files that
/// cannot be read are skipped.
///
/// # Errors
/// If the database cannot be written, or the folder of all studies cannot be read.
pub(crate) fn take_over(connection: &mut Connection, data: &Path) -> Result<(), StoreError> {
    let query = "SELECT count(*) FROM studies";
    if connection.query_row(query, [], |row| row.get::<_, i64>(0))? > 0 {
        return Ok(());
    }
    let entries = match fs::read_dir(data.join(STUDIES)) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(StoreError::from_io(error, "read", &data.join(STUDIES))),
    };
    let transaction = connection.transaction()?;
    for folder in entries.filter_map(Result::ok).map(|entry| entry.path()) {
        if let Some((name, file)) = study(&folder) {
            keep(
                &transaction,
                name.as_str(),
                Some(&file),
                &records(&folder, &file.measures),
            )?;
        }
    }
    Ok(transaction.commit()?)
}

/// The name and the file of the study in a folder; `None` if the folder does not belong to a study.
fn study(folder: &Path) -> Option<(CampaignName, StudyFile)> {
    let name: CampaignName = folder.file_name()?.to_str()?.to_owned().try_into().ok()?;
    let toml = fs::read_to_string(folder.join("study.toml")).ok()?;
    let origin = fs::read(folder.join("origin.json")).unwrap_or_default();
    let origin: serde_json::Value = serde_json::from_slice(&origin).unwrap_or_default();
    let text = |field: &str| origin[field].as_str().unwrap_or_default().to_owned();
    let file = StudyFile {
        toml,
        folder: text("folder"),
        quick: origin["quick"].as_bool().unwrap_or_default(),
        measures: text("measures"),
    };
    Some((name, file))
}

/// The records in a study's folder: measurements of cells, embedders, the reference, and the classes that people gave.
/// `measures` is the digest of the settings of the last measurements.
fn records(folder: &Path, measures: &str) -> Vec<StudyRecord> {
    let mut records = Vec::new();
    let mut add = |kind, key: &str, measures: &str, content: Vec<u8>| {
        records.push(StudyRecord {
            kind,
            key: key.to_owned(),
            measures: measures.to_owned(),
            content,
        });
    };
    for path in files_in(&folder.join("cells")) {
        let Ok(content) = fs::read(&path) else { continue };
        let cell: serde_json::Value = serde_json::from_slice(&content).unwrap_or_default();
        if let (Some(key), Some(measures)) = (cell["cell"].as_str(), cell["measures"].as_str()) {
            add(StudyRecordKind::Cell, key, measures, content.clone());
        }
    }
    let embedders = fs::read(folder.join("embedders.json")).unwrap_or_default();
    let embedders: serde_json::Map<String, serde_json::Value> =
        serde_json::from_slice(&embedders).unwrap_or_default();
    for (key, digest) in &embedders {
        let digest = digest.as_str().unwrap_or_default();
        add(StudyRecordKind::Embedder, key, "", digest.into());
    }
    if let Ok(content) = fs::read(folder.join("reference.json")) {
        add(StudyRecordKind::Reference, "", measures, content);
    }
    if let Ok(content) = fs::read(folder.join("classes.csv")) {
        add(StudyRecordKind::Classes, "", "", content);
    }
    records
}

fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    entries.filter_map(Result::ok).map(|entry| entry.path()).collect()
}

#[cfg(test)]
mod tests {
    use crate::{DataDirectory, Store};
    use murmuration_model::study_records::StudyRecordKind::{Cell, Classes, Embedder};
    use std::fs;

    #[test]
    fn studies_of_earlier_versions_are_taken_over_with_their_classes() {
        let data = tempfile::tempdir().unwrap();
        let study = data.path().join("studies").join("small");
        fs::create_dir_all(study.join("cells")).unwrap();
        let kept = [
            ("study.toml", "name = \"small\""),
            (
                "origin.json",
                r#"{"quick": true, "folder": "/home", "measures": "so"}"#,
            ),
            ("embedders.json", r#"{"a": "1f0c"}"#),
            ("classes.csv", "cell,index,class,by"),
            ("cells/a.json", r#"{"cell": "a", "measures": "so"}"#),
            ("cells/b.json", "{"),
        ];
        for (name, text) in kept {
            fs::write(study.join(name), text).unwrap();
        }
        fs::write(data.path().join("studies").join(".beginning"), "").unwrap();
        let held = DataDirectory::hold(data.path()).unwrap();
        let mut connection = rusqlite::Connection::open(data.path().join(Store::FILE)).unwrap();
        crate::schema::create_older(&mut connection, 3);
        drop(connection);

        let store = Store::open(&held).unwrap();
        assert_eq!(store.studies().unwrap(), ["small"]);
        assert!(store.study_file("small").unwrap().quick);
        let entries = store.study_entries("small").unwrap();
        let found: Vec<_> = entries
            .iter()
            .map(|entry| (entry.kind, entry.key.as_str()))
            .collect();
        assert_eq!(found, [(Cell, "a"), (Classes, ""), (Embedder, "a")]);
        let content = store.study_content("small", Embedder, "a").unwrap();
        assert_eq!(content.unwrap(), b"1f0c");
    }
}
