//! Files that a command reads and writes where a person says.

use super::CliError;
use murmuration_accuracy::LabelledSet;
use murmuration_link::{InputKind, errln, read_bytes, read_text};
use murmuration_proto::counted;
use murmuration_store::files;
use std::{fs, path::Path};

/// The bytes of a file.
pub(super) fn read(path: &Path, kind: InputKind) -> Result<Vec<u8>, CliError> {
    read_bytes(path, kind).map_err(|error| CliError::unreadable(path, &error))
}

/// The text of a file.
pub(super) fn read_words(path: &Path, kind: InputKind) -> Result<String, CliError> {
    read_text(path, kind).map_err(|error| CliError::unreadable(path, &error))
}

/// Whether there is something at `path`.
pub(super) fn is_there(path: &Path) -> Result<bool, CliError> {
    files::is_there(path).map_err(|error| CliError::unreadable(path, &error))
}

/// Writes a file, with the folders above it where they do not exist, and says so.
pub(super) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), CliError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let what = if path.is_file() { "replaced" } else { "wrote" };
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, bytes))
        .map_err(|error| CliError::unwritable(path, &error))?;
    errln!("{what} {}", path.display());
    Ok(())
}

/// What a command writes where an option says.
#[derive(Debug, Clone, Copy)]
pub(super) enum Written {
    Gif,
    Png,
    Svg,
    Film,
    Header,
    Csv,
}

impl Written {
    /// Refuses a name that ends as those of other files do; one without an ending says nothing else.
    pub(super) fn check(self, option: &str, path: &Path) -> Result<(), CliError> {
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

/// Of how many behaviours something was said, and what of the files was left out.
pub(super) fn tell_counted(sets: &[LabelledSet]) {
    errln!(
        "{} with a class given by a person",
        counted(behaviours(sets), "behaviour")
    );
    if let rows @ 1.. = synthetic(sets) {
        errln!(
            "skipped: {} by the synthetic annotator, which is not a person",
            counted(rows, "answer")
        );
    }
}

/// The behaviours with a class that a person gave.
pub(super) fn behaviours(sets: &[LabelledSet]) -> u64 {
    sets.iter().map(|set| set.classes().count() as u64).sum()
}

/// The answers of the synthetic annotator, which were left out.
pub(super) fn synthetic(sets: &[LabelledSet]) -> u64 {
    sets.iter().map(LabelledSet::synthetic).sum()
}
