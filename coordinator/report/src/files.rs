//! A folder of files that are each complete or absent.

use super::ReportError;
use std::{
    fs,
    io::{self, BufWriter, Write},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};
use tempfile::NamedTempFile;

/// A folder being filled.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    written: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder and the ones above it where they do not exist.
    pub fn create(path: &Path) -> Result<Self, ReportError> {
        let folder = Self {
            path: path.to_owned(),
            written: Vec::new(),
        };
        folder.make(path)?;
        Ok(folder)
    }

    pub fn written(&self) -> &[PathBuf] {
        &self.written
    }

    /// Makes a folder in it.
    pub fn folder(&self, name: &str) -> Result<(), ReportError> {
        self.make(&self.path.join(name))
    }

    /// Writes a file of text.
    pub fn text(&mut self, name: &str, text: &str) -> Result<PathBuf, ReportError> {
        self.bytes(name, text.as_bytes())
    }

    /// Writes a file.
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
        self.write(name, |file| file.write_all(bytes))
    }

    /// Writes a file under another name and moves it into place once all of it is on disk.
    pub fn write(
        &mut self,
        name: &str,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<PathBuf, ReportError> {
        let path = self.path.join(name);
        if let Err(source) = write_whole(&path, fill) {
            return Err(ReportError::Write { path, source });
        }
        self.written.push(path.clone());
        Ok(path)
    }

    /// Removes those of these files that an earlier report left here and this one did not write.
    pub fn remove_unless_written(&self, names: impl IntoIterator<Item = String>) -> Result<(), ReportError> {
        let paths = names.into_iter().map(|name| self.path.join(name));
        for path in paths.filter(|path| !self.written.contains(path)) {
            match fs::remove_file(&path) {
                Err(source) if source.kind() != io::ErrorKind::NotFound => {
                    return Err(ReportError::Write { path, source });
                }
                _ => {}
            }
        }
        Ok(())
    }

    fn make(&self, path: &Path) -> Result<(), ReportError> {
        fs::create_dir_all(path).map_err(|source| ReportError::Write {
            path: path.to_owned(),
            source,
        })
    }
}

/// A file that is to take the place of `path` once it is whole, in the same folder.
pub fn temporary_for(path: &Path) -> io::Result<NamedTempFile> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
    // Like any file that a person writes, not for its owner's eyes alone as temporary files are.
    tempfile::Builder::new()
        .permissions(fs::Permissions::from_mode(0o666))
        .tempfile_in(folder.unwrap_or(Path::new(".")))
}

fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut file = BufWriter::new(temporary_for(path)?);
    fill(&mut file)?;
    let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
    file.as_file().sync_all()?;
    file.persist(path)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_an_earlier_report_go_and_no_others() {
        let place = tempfile::tempdir().unwrap();
        for name in ["a.svg", "b.svg", "notes.txt"] {
            fs::write(place.path().join(name), "earlier").unwrap();
        }
        let mut folder = Folder::create(place.path()).unwrap();
        folder.text("a.svg", "now").unwrap();
        folder
            .remove_unless_written(["a.svg", "b.svg", "c.svg"].map(str::to_owned))
            .unwrap();
        let there = |name| place.path().join(name).is_file();
        assert!(there("a.svg") && !there("b.svg") && there("notes.txt"));
    }

    #[test]
    fn a_file_that_cannot_be_finished_leaves_the_old_one() {
        let place = tempfile::tempdir().unwrap();
        let mut folder = Folder::create(place.path()).unwrap();
        folder.text("a.csv", "old").unwrap();
        let error = folder
            .write("a.csv", |file| {
                file.write_all(b"half")?;
                Err(io::ErrorKind::StorageFull.into())
            })
            .unwrap_err();
        let ReportError::Write { path, source } = &error else {
            panic!("{error}")
        };
        assert_eq!(
            (path, source.kind()),
            (&place.path().join("a.csv"), io::ErrorKind::StorageFull)
        );
        assert_eq!(fs::read_to_string(path).unwrap(), "old");
        assert_eq!(
            fs::read_dir(place.path()).unwrap().count(),
            1,
            "nothing half-written stays"
        );
    }
}
