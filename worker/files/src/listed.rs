//! Lists of files with their digests, one per line, in the format of `b3sum`.

use murmuration_swarm::text;
use std::{
    fs::File,
    io,
    path::{Component, Path},
};

/// Maximum number of characters of a path in a list.
const MAX_NAME_CHARS: usize = 200;

/// Parses a line of a list: a file's digest and path. `None` if the line has another format, or if the path leads out of the
/// folder or has invisible characters.
#[must_use]
pub fn listed_file(line: &str) -> Option<(blake3::Hash, &str)> {
    let (digest, name) = line.split_once("  ")?;
    let mut parts = Path::new(name).components();
    let is_within = !name.is_empty() && parts.all(|part| matches!(part, Component::Normal(_)));
    let can_be_seen = text::name("name", name, MAX_NAME_CHARS).is_ok_and(|shown| shown == name);
    let digest = blake3::Hash::from_hex(digest).ok()?;
    (is_within && can_be_seen).then_some((digest, name))
}

/// The BLAKE3 digest of an open file, from its current position.
///
/// # Errors
/// The system's error.
pub fn digest_of(file: File) -> io::Result<blake3::Hash> {
    let mut hasher = blake3::Hasher::new();
    hasher.update_reader(file)?;
    Ok(hasher.finalize())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_stays_within_the_folder() {
        let digest = blake3::hash(b"").to_hex();
        for name in ["README.md", "checkpoints/a.onnx"] {
            assert_eq!(listed_file(&format!("{digest}  {name}")).unwrap().1, name);
        }
        for name in [
            "",
            "/etc/passwd",
            "../secret",
            "checkpoints/../../secret",
            "./README.md",
            "a\u{1b}[2Jb",
            "a\u{202e}b",
        ] {
            assert!(listed_file(&format!("{digest}  {name}")).is_none(), "{name}");
        }
        assert!(listed_file("no digest  README.md").is_none() && listed_file("README.md").is_none());
    }
}
