//! Reads files that a person names, up to a maximum length for each kind of file.
//!
//! A named file can be a pipe or a device that never ends. This module checks lengths, not contents.

use murmuration_onnx::MAX_MODEL_BYTES;
use murmuration_swarm::grouped;
use std::{
    fs::{self, File},
    io::{self, Read},
    os::unix::fs::MetadataExt as _,
    path::Path,
};

/// The kind of a file, which determines its maximum length. Every limit is at least ten times the usual length.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputKind {
    /// Campaign file (TOML).
    Campaign,
    /// Study file (TOML).
    Study,
    /// File of controllers, one per line.
    Controllers,
    /// File of labels (CSV).
    Labels,
    /// File of starts of swarms (CSV).
    Starts,
    /// File of tracks of robots (CSV).
    Tracks,
    /// Picture of a behaviour (PNG).
    Picture,
    /// Reference case (JSON).
    Case,
    /// Checkpoint (ONNX).
    Checkpoint,
    /// Manifest of a backup (JSON).
    Manifest,
    /// Digests of tokens, with their holders (TOML).
    Tokens,
    Token,
    /// Access file of a coordinator (JSON).
    Access,
    /// The sessions of a coordinator (JSON).
    Sessions,
    /// Certificate or private key (PEM).
    Pem,
}

impl InputKind {
    /// Maximum number of bytes of a file of this kind.
    #[must_use]
    pub const fn max_bytes(self) -> u64 {
        match self {
            Self::Token => 4 << 10,
            Self::Access => 64 << 10,
            Self::Campaign | Self::Study | Self::Tokens | Self::Pem => 1 << 20,
            Self::Controllers | Self::Sessions | Self::Picture | Self::Case | Self::Manifest => 16 << 20,
            Self::Checkpoint => MAX_MODEL_BYTES as u64,
            Self::Labels | Self::Starts => 256 << 20,
            Self::Tracks => 64 << 30,
        }
    }

    const fn noun(self) -> &'static str {
        match self {
            Self::Campaign => "a campaign file",
            Self::Study => "a study file",
            Self::Controllers => "a file of controllers",
            Self::Labels => "a file of labels",
            Self::Starts => "a file of starts",
            Self::Tracks => "a file of tracks",
            Self::Picture => "the picture of a behaviour",
            Self::Case => "a reference case",
            Self::Checkpoint => "a checkpoint",
            Self::Manifest => "the manifest of a backup",
            Self::Tokens => "a tokens file",
            Self::Token => "a token's file",
            Self::Access => "an access file",
            Self::Sessions => "a file of sessions",
            Self::Pem => "a PEM file",
        }
    }
}

/// A file is longer than its kind allows. An [`io::Error`] of the kind [`io::ErrorKind::FileTooLarge`] contains this error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it is too long: {} has at most {} bytes", .0.noun(), grouped(.0.max_bytes()))]
pub struct TooLong(pub InputKind);

/// Checks that `path` is a regular file, or a link to one: opening a pipe would wait for ever, and a device may never end.
///
/// # Errors
/// The system's error, or an error that says what is wrong.
pub fn expect_regular(path: &Path) -> io::Result<()> {
    match fs::metadata(path)?.is_file() {
        true => Ok(()),
        false => Err(io::Error::other("it is not a regular file: remove it")),
    }
}

/// Checks that `path` is a regular file with this one name: a file in somebody else's folder could also be a link to another
/// file.
///
/// # Errors
/// The system's error, or an error that says what is wrong.
pub fn expect_own_file(path: &Path) -> io::Result<()> {
    let about = fs::symlink_metadata(path)?;
    if about.is_symlink() {
        return Err(io::Error::other("it is a link to another place: remove it"));
    }
    expect_regular(path)?;
    match about.nlink() > 1 {
        true => Err(io::Error::other(
            "it is a hard link, so it is another file too: remove it",
        )),
        false => Ok(()),
    }
}

/// Opens the file at `path`, to be read piece by piece.
///
/// # Errors
/// The system's error; reading more bytes than the kind allows gives [`TooLong`].
pub fn open(path: &Path, kind: InputKind) -> io::Result<impl Read + use<>> {
    Ok(Limited {
        reader: File::open(path)?.take(kind.max_bytes() + 1),
        kind,
    })
}

struct Limited<R> {
    reader: io::Take<R>,
    kind: InputKind,
}

impl<R: Read> Read for Limited<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let len = self.reader.read(bytes)?;
        match self.reader.limit() {
            0 => Err(io::Error::new(io::ErrorKind::FileTooLarge, TooLong(self.kind))),
            _ => Ok(len),
        }
    }
}

/// The bytes of the file at `path`.
///
/// # Errors
/// The system's error, or [`TooLong`].
pub fn read_bytes(path: &Path, kind: InputKind) -> io::Result<Vec<u8>> {
    bytes_of(File::open(path)?, kind)
}

/// The text of the file at `path`.
///
/// # Errors
/// The system's error, [`TooLong`], or an error if the text is not UTF-8.
pub fn read_text(path: &Path, kind: InputKind) -> io::Result<String> {
    text_of(File::open(path)?, kind)
}

/// The text from a `reader` such as standard input.
///
/// # Errors
/// The errors of [`read_text`].
pub fn text_of(reader: impl Read, kind: InputKind) -> io::Result<String> {
    let text = String::from_utf8(bytes_of(reader, kind)?);
    text.map_err(|error| io::Error::new(io::ErrorKind::InvalidData, error.utf8_error()))
}

fn bytes_of(reader: impl Read, kind: InputKind) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let reader = reader.take(kind.max_bytes() + 1);
    Limited { reader, kind }.read_to_end(&mut bytes)?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    #[test]
    fn a_file_is_read_up_to_the_longest_of_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("token");
        let most = InputKind::Token.max_bytes() as usize;
        fs::write(&path, "x".repeat(most)).unwrap();
        assert_eq!(read_text(&path, InputKind::Token).unwrap().len(), most);
        fs::write(&path, "x".repeat(most + 1)).unwrap();
        for error in [
            read_text(&path, InputKind::Token).unwrap_err(),
            read_bytes(&path, InputKind::Token).unwrap_err(),
        ] {
            assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
            assert_eq!(
                error.to_string(),
                "it is too long: a token's file has at most 4,096 bytes"
            );
        }
        // A text cut within a letter is still reported as too long.
        fs::write(&path, "é".repeat(most)).unwrap();
        let cut = read_text(&path, InputKind::Token).unwrap_err();
        assert_eq!(cut.kind(), io::ErrorKind::FileTooLarge);
    }

    #[test]
    fn what_never_ends_is_not_read_for_ever() {
        for kind in [InputKind::Campaign, InputKind::Tokens, InputKind::Case] {
            let endless = read_text(Path::new("/dev/zero"), kind).unwrap_err();
            assert_eq!(endless.kind(), io::ErrorKind::FileTooLarge);
        }
    }
}
