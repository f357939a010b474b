//! A folder of files that are each complete or absent.

use super::ReportError;
use std::{
    fs,
    io::{self, BufWriter, Write},
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

/// A folder being filled.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
    written: Vec<PathBuf>,
}

impl Folder {
    /// Makes the folder and the ones above it where they do not exist.
    pub(super) fn create(path: &Path) -> Result<Self, ReportError> {
        let folder = Self {
            path: path.to_owned(),
            written: Vec::new(),
        };
        folder.make(path)?;
        Ok(folder)
    }

    /// The files that were written so far.
    pub(super) fn written(&self) -> &[PathBuf] {
        &self.written
    }

    /// Makes a folder in it.
    pub(super) fn folder(&self, name: &str) -> Result<(), ReportError> {
        self.make(&self.path.join(name))
    }

    /// Writes a file of text.
    pub(super) fn text(&mut self, name: &str, text: &str) -> Result<PathBuf, ReportError> {
        self.bytes(name, text.as_bytes())
    }

    /// Writes a file.
    pub(super) fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<PathBuf, ReportError> {
        self.write(name, |file| file.write_all(bytes))
    }

    /// Writes a file under another name and moves it into place once all of it is on disk.
    pub(super) fn write(
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

    fn make(&self, path: &Path) -> Result<(), ReportError> {
        fs::create_dir_all(path).map_err(|source| ReportError::Write {
            path: path.to_owned(),
            source,
        })
    }
}

fn write_whole(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    // Like any file that a person writes, not for its owner's eyes alone as temporary files are.
    let file = tempfile::Builder::new()
        .permissions(fs::Permissions::from_mode(0o666))
        .tempfile_in(path.parent().unwrap_or(Path::new(".")))?;
    let mut file = BufWriter::new(file);
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
