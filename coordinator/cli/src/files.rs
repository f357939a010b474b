//! Files that a command reads and writes at paths given by the user.

use super::CliError;
use murmuration_files::{InputKind, NewFile, Replaces, read_bytes, read_text};
use murmuration_link::errln;
use murmuration_store::{Store, files};
use std::{
    fs,
    io::Write as _,
    path::{Path, PathBuf},
};

pub fn read(path: &Path, kind: InputKind) -> Result<Vec<u8>, CliError> {
    read_bytes(path, kind).map_err(|error| CliError::unreadable(path, &error))
}

pub fn read_words(path: &Path, kind: InputKind) -> Result<String, CliError> {
    read_text(path, kind).map_err(|error| CliError::unreadable(path, &error))
}

pub fn is_there(path: &Path) -> Result<bool, CliError> {
    files::is_there(path).map_err(|error| CliError::unreadable(path, &error))
}

/// The files that a command may replace in a folder named by the user.
pub const fn replaces(force: bool) -> Replaces {
    match force {
        true => Replaces::Changed,
        false => Replaces::Unchanged,
    }
}

/// The option of commands that write files at paths given by the user.
#[derive(Debug, Clone, Copy, clap::Args)]
pub struct Overwrite {
    /// Replace files that exist
    #[arg(long)]
    force: bool,
}

impl Overwrite {
    #[cfg(test)]
    pub(crate) const ALLOWED: Self = Self { force: true };

    /// Refuses to replace an existing file without `--force`: the file may be the work of hours.
    pub fn check(self, path: &Path) -> Result<(), CliError> {
        // Standard output may be redirected to an existing file; the command appends to that file.
        let is_descriptor = ["/dev/stdout", "/dev/stderr", "/dev/fd", "/proc"]
            .iter()
            .any(|place| path.starts_with(place));
        match !self.force && !is_descriptor && path.is_file() {
            true => Err(CliError::Input(format!(
                "{} exists already: name another file, or replace it with --force",
                path.display()
            ))),
            false => Ok(()),
        }
    }

    /// Writes a whole file, creates missing folders above it, and reports the file. Without `--force`, a file that appeared since
    /// the command began stays.
    pub fn write(self, path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), CliError> {
        let mut file = self.begin(path)?;
        let written = file.write_all(bytes.as_ref());
        written.map_err(|error| CliError::unwritable(path, &error))?;
        finish(file, path)
    }

    /// Begins a file that gets its name from [`finish`].
    pub fn begin(self, path: &Path) -> Result<NewFile, CliError> {
        self.check(path)?;
        expect_outside_data(path)?;
        NewFile::create(path).map_err(|error| CliError::unwritable(path, &error))
    }
}

/// Refuses to write a file that the command reads, that another of its options writes, or that exists.
pub fn check_outputs<'a>(
    outputs: impl IntoIterator<Item = (&'a str, &'a PathBuf)>,
    inputs: impl IntoIterator<Item = &'a PathBuf>,
    overwrite: Overwrite,
) -> Result<(), CliError> {
    let whole = |path: &Path| files::without_links(path).unwrap_or_else(|_| path.to_owned());
    let mut taken: Vec<PathBuf> = inputs.into_iter().map(|path| whole(path)).collect();
    let read = taken.len();
    for (option, path) in outputs {
        let file = whole(path);
        // Several options may write to one device or pipe.
        let is_device = fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir());
        match taken.iter().position(|other| *other == file) {
            Some(place) if !is_device => {
                let what = if place < read {
                    "a file that is read"
                } else {
                    "the file of another option"
                };
                let path = path.display();
                return Err(CliError::Input(format!(
                    "{option} {path} is {what}: name another one"
                )));
            }
            _ => taken.push(file),
        }
        overwrite.check(path)?;
    }
    Ok(())
}

/// Refuses a place in a data directory, which only a coordinator may change.
pub fn expect_outside_data(path: &Path) -> Result<(), CliError> {
    let whole = files::without_links(path).unwrap_or_else(|_| path.to_owned());
    let whole = std::path::absolute(&whole).unwrap_or(whole);
    let existing = whole.ancestors().find_map(|part| part.canonicalize().ok());
    let existing = existing.unwrap_or_default();
    let mut folders = existing.ancestors();
    if let Some(folder) = folders.find(|folder| folder.join(Store::FILE).exists()) {
        return Err(CliError::Input(format!(
            "{} is in the data directory {}: name a place elsewhere",
            path.display(),
            folder.display()
        )));
    }
    Ok(())
}

/// Gives a complete file the name `path`, and reports it.
pub fn finish(file: NewFile, path: &Path) -> Result<(), CliError> {
    let written = file
        .finish_unless_taken()
        .map_err(|error| CliError::unwritable(path, &error))?;
    errln!("{written} {}", path.display());
    Ok(())
}

/// A type of files that options write.
#[derive(Debug, Clone, Copy)]
pub enum FileType {
    Gif,
    Png,
    Svg,
    Film,
    Header,
    Csv,
}

impl FileType {
    /// Refuses a name with the extension of another type. A name without an extension is accepted.
    pub fn check(self, option: &str, path: &Path) -> Result<(), CliError> {
        let (what, ending) = match self {
            Self::Gif => ("an animated GIF", "gif"),
            Self::Png => ("a PNG picture", "png"),
            Self::Svg => ("an SVG picture", "svg"),
            Self::Film => ("a film", "mp4"),
            Self::Header => ("a C header", "h"),
            Self::Csv => ("a table", "csv"),
        };
        match path.extension() {
            Some(other) if !other.eq_ignore_ascii_case(ending) => Err(CliError::Input(format!(
                "{option} {} would hold {what}: name a file that ends in .{ending}",
                path.display()
            ))),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[track_caller]
    fn check(outputs: [&str; 2], expected: bool) {
        let outputs = outputs.map(PathBuf::from);
        let named = ["--png", "--gif"].into_iter().zip(&outputs);
        let checked = check_outputs(named, [], Overwrite { force: false });
        assert_eq!(checked.is_ok(), expected, "{outputs:?}: {checked:?}");
    }

    #[test]
    fn a_file_is_written_once() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name).display().to_string();
        std::os::unix::fs::symlink(folder.path(), folder.path().join("link")).unwrap();
        fs::create_dir(folder.path().join("within")).unwrap();
        check([&at("one"), &at("other")], true);
        check(["twice", "./twice"], false);
        check(["new/twice", "./new/twice"], false);
        check([&at("twice"), &at("link/twice")], false);
        check([&at("twice"), &at("within/../twice")], false);
        check(
            ["/dev/shm/murmuration-twice", "/dev/shm/murmuration-twice"],
            false,
        );
        check(["/dev/null", "/dev/null"], true);
    }
}
