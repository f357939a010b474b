//! `BLAKE3SUMS`: the digest of every file of an export, one per line, in the format of `b3sum --check`.

use crate::{CAMPAIGN, DATABASE, ExportError, SPEC};
use murmuration_files::{digest_of, listed_file};
use std::{
    collections::BTreeMap,
    fs::{self, File},
    io,
    path::Path,
};

/// The file name of the list of digests.
pub(crate) const FILE: &str = "BLAKE3SUMS";
/// Maximum size of the list in bytes: room for the digests of more than 1,000 checkpoints and their descriptions.
const MAX_BYTES: u64 = 1 << 20;

/// The digests of the files of a folder, by path within it.
#[derive(Debug, Default)]
pub(crate) struct Digests(BTreeMap<String, blake3::Hash>);

impl Digests {
    /// Adds the digest of a file that has been written.
    pub(crate) fn add(&mut self, folder: &Path, name: &str) -> Result<(), ExportError> {
        let digest = digest(&folder.join(name))?;
        self.0.insert(name.to_owned(), digest);
        Ok(())
    }

    /// The names of the listed files, in alphabetical order.
    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.0.keys().map(String::as_str)
    }

    /// Whether a file is listed.
    pub(crate) fn has(&self, name: &str) -> bool {
        self.0.contains_key(name)
    }

    /// The text of the list.
    pub(crate) fn to_text(&self) -> String {
        let line = |(name, digest): (&String, &blake3::Hash)| format!("{}  {name}\n", digest.to_hex());
        self.0.iter().map(line).collect()
    }

    /// Reads the list of a folder, and checks every file against it.
    pub(crate) fn check(folder: &Path) -> Result<Self, ExportError> {
        let path = folder.join(FILE);
        let found = fs::symlink_metadata(&path).map_err(|error| {
            let reason =
                format!("it is not an export ({FILE}: {error}); `murmuration export CAMPAIGN DIR` makes one");
            ExportError::damaged(folder, reason)
        })?;
        if !found.is_file() || found.len() > MAX_BYTES {
            return Err(ExportError::damaged(
                &path,
                "it is not the list of an export's files",
            ));
        }
        let text = fs::read_to_string(&path).map_err(ExportError::file("read", &path))?;
        let mut digests = BTreeMap::new();
        for line in text.lines() {
            let (digest, name) = listed_file(line).ok_or_else(|| {
                ExportError::damaged(&path, "a line is not a digest followed by a file name")
            })?;
            if digests.insert(name.to_owned(), digest).is_some() {
                return Err(ExportError::damaged(&path, format!("{name} is listed twice")));
            }
        }
        for (name, listed) in &digests {
            let file = folder.join(name);
            for parent in Path::new(name)
                .ancestors()
                .skip(1)
                .filter(|parent| *parent != Path::new(""))
            {
                let parent = folder.join(parent);
                let found = fs::symlink_metadata(&parent).map_err(ExportError::file("read", &parent))?;
                if !found.is_dir() {
                    return Err(ExportError::damaged(&parent, "it is not a folder"));
                }
            }
            if digest(&file)? != *listed {
                let reason = format!("it was changed after the export: its digest is not that in {FILE}");
                return Err(ExportError::damaged(&file, reason));
            }
        }
        Ok(Self(digests))
    }
}

/// Whether a folder holds an unchanged export and nothing else: only the listed files, and the folders of these files. A folder
/// of other files with a list of their digests is no export.
///
/// # Errors
/// If the folder cannot be read.
pub(crate) fn is_alone(folder: &Path) -> io::Result<bool> {
    let list = folder.join(FILE);
    let is_list = fs::symlink_metadata(&list).is_ok_and(|found| found.is_file() && found.len() <= MAX_BYTES);
    if !is_list {
        return Ok(false);
    }
    let text = String::from_utf8_lossy(&fs::read(&list)?).into_owned();
    let listed: BTreeMap<&str, blake3::Hash> = text
        .lines()
        .filter_map(listed_file)
        .map(|(digest, name)| (name, digest))
        .collect();
    let is_listed = |name| listed.contains_key(name);
    if ![SPEC, CAMPAIGN, DATABASE].into_iter().all(is_listed) {
        return Ok(false);
    }
    let mut folders = vec![folder.to_path_buf()];
    while let Some(inner) = folders.pop() {
        for found in fs::read_dir(&inner)? {
            let (kind, path) = found.and_then(|found| Ok((found.file_type()?, found.path())))?;
            let name = path.strip_prefix(folder).ok().and_then(Path::to_str);
            let is_of_it = match name {
                Some(FILE) => kind.is_file(),
                Some(name) if kind.is_file() => listed
                    .get(name)
                    .is_some_and(|listed| digest(&path).is_ok_and(|found| found == *listed)),
                Some(name) if kind.is_dir() => {
                    listed.keys().any(|listed| Path::new(listed).starts_with(name))
                }
                _ => false,
            };
            if !is_of_it {
                return Ok(false);
            }
            if kind.is_dir() {
                folders.push(path);
            }
        }
    }
    Ok(true)
}

/// Opens a file of an export: neither a link, nor a folder, nor a device.
pub(crate) fn open(path: &Path) -> Result<File, ExportError> {
    let found = fs::symlink_metadata(path).map_err(ExportError::file("read", path))?;
    if !found.is_file() {
        return Err(ExportError::damaged(path, "it is not a regular file"));
    }
    File::open(path).map_err(ExportError::file("read", path))
}

fn digest(path: &Path) -> Result<blake3::Hash, ExportError> {
    digest_of(open(path)?).map_err(ExportError::file("read", path))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_export_with_anything_else_beside_it_is_not_alone() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        assert!(!is_alone(folder.path()).unwrap(), "an empty folder is no export");
        fs::create_dir(folder.path().join("checkpoints")).unwrap();
        let mut digests = Digests::default();
        for name in ["a.txt", "checkpoints/b.onnx"] {
            write(name, "one");
            digests.add(folder.path(), name).unwrap();
        }
        write(FILE, &digests.to_text());
        assert!(
            !is_alone(folder.path()).unwrap(),
            "a list of somebody's own files"
        );
        for name in [SPEC, CAMPAIGN, DATABASE] {
            write(name, "one");
            digests.add(folder.path(), name).unwrap();
        }
        write(FILE, &digests.to_text());
        assert!(is_alone(folder.path()).unwrap());
        write("a.txt", "one, and notes of three weeks");
        assert!(!is_alone(folder.path()).unwrap(), "what was changed");
        write("a.txt", "one");
        for more in ["notes.txt", "checkpoints/notes.txt"] {
            write(more, "mine");
            assert!(!is_alone(folder.path()).unwrap(), "{more}");
            fs::remove_file(folder.path().join(more)).unwrap();
        }
        fs::create_dir(folder.path().join("src")).unwrap();
        assert!(!is_alone(folder.path()).unwrap(), "a folder of somebody's own");
    }

    #[test]
    fn what_is_listed_twice_or_lies_behind_a_link_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("outside")).unwrap();
        fs::write(at("outside/a"), "one").unwrap();
        std::os::unix::fs::symlink(at("outside"), at("inside")).unwrap();
        let line = format!("{}  inside/a\n", blake3::hash(b"one").to_hex());
        fs::write(at(FILE), &line).unwrap();
        let message = Digests::check(folder.path()).unwrap_err().to_string();
        assert!(message.contains("it is not a folder"), "{message}");
        fs::write(at(FILE), line.repeat(2)).unwrap();
        let message = Digests::check(folder.path()).unwrap_err().to_string();
        assert!(message.contains("listed twice"), "{message}");
    }

    #[test]
    fn a_file_that_changed_or_is_a_link_is_found() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("a.txt", "one");
        let mut digests = Digests::default();
        digests.add(folder.path(), "a.txt").unwrap();
        write(FILE, &digests.to_text());
        assert!(Digests::check(folder.path()).unwrap().has("a.txt"));
        write("a.txt", "ond");
        let message = Digests::check(folder.path()).unwrap_err().to_string();
        assert!(message.contains("a.txt: it was changed"), "{message}");
        fs::remove_file(folder.path().join("a.txt")).unwrap();
        write("b.txt", "one");
        std::os::unix::fs::symlink(folder.path().join("b.txt"), folder.path().join("a.txt")).unwrap();
        let message = Digests::check(folder.path()).unwrap_err().to_string();
        assert!(message.contains("not a regular file"), "{message}");
    }
}
