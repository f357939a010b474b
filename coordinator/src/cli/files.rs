//! Files that a command writes where a person says.

use super::CliError;
use murmuration_link::errln;
use std::{fs, path::Path};

/// Writes a file, with the folders above it where they do not exist, and says so.
pub(super) fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<(), CliError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(path, bytes))
        .map_err(|error| CliError::unwritable(path, &error))?;
    errln!("wrote {}", path.display());
    Ok(())
}
