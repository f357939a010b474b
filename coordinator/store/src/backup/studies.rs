//! Backs up the studies of a data directory: the files that no command can make again, above all the classes that people gave.

use super::{BackupError, failed, sync};
use crate::files::is_there;
use murmuration_model::study_files::{STUDIES, STUDY_ORIGINALS};
use std::{fs, path::Path};

/// Copies the [`STUDY_ORIGINALS`] of every study of the data directory `data` into `folder`. Each copied file is complete, because
/// a writer moves the new file over the old one.
pub(super) fn copy(data: &Path, folder: &Path) -> Result<(), BackupError> {
    let studies = data.join(STUDIES);
    if !is_there(&studies).map_err(failed("find", &studies))? {
        return Ok(());
    }
    let copied = folder.join(STUDIES);
    make(&copied)?;
    for study in fs::read_dir(&studies).map_err(failed("look into", &studies))? {
        let study = study.map_err(failed("look into", &studies))?;
        let from = study.path();
        // Follows links. Other files, such as the lock, are no studies.
        if from.is_dir() {
            copy_study(&from, &copied.join(study.file_name()))?;
        }
    }
    sync(&copied)
}

fn copy_study(from: &Path, to: &Path) -> Result<(), BackupError> {
    make(to)?;
    for name in STUDY_ORIGINALS {
        let (original, copied) = (from.join(name), to.join(name));
        if is_there(&original).map_err(failed("find", &original))? {
            fs::copy(&original, &copied).map_err(failed("copy", &original))?;
            sync(&copied)?;
        }
    }
    sync(to)
}

/// Makes a folder that does not exist.
fn make(folder: &Path) -> Result<(), BackupError> {
    fs::create_dir(folder).map_err(failed("make", folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use murmuration_model::study_files::{STUDY_CLASSES, STUDY_FILE};

    #[test]
    fn what_people_said_is_copied_and_what_can_be_measured_again_is_not() {
        let [data, folder] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let of = |root: &Path, name: &str| root.join(STUDIES).join("small").join(name);
        fs::create_dir_all(of(data.path(), "cells")).unwrap();
        for name in [STUDY_FILE, STUDY_CLASSES, "cells/a.json", "report.html"] {
            fs::write(of(data.path(), name), name).unwrap();
        }
        fs::write(data.path().join(STUDIES).join(".beginning"), "").unwrap();
        copy(data.path(), folder.path()).unwrap();
        for name in [STUDY_FILE, STUDY_CLASSES] {
            assert_eq!(fs::read_to_string(of(folder.path(), name)).unwrap(), name);
        }
        assert_eq!(fs::read_dir(of(folder.path(), "")).unwrap().count(), 2);
        assert_eq!(fs::read_dir(folder.path().join(STUDIES)).unwrap().count(), 1);
    }

    #[test]
    fn a_data_directory_without_studies_has_none_in_its_backup() {
        let [data, folder] = [(); 2].map(|()| tempfile::tempdir().unwrap());
        copy(data.path(), folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
