//! Checks whether files and folders exist; the result is an error if the system cannot determine this.

use murmuration_files::expect_regular;
use std::{
    fs,
    io::{self, Read as _},
    path::{self, Component, Path, PathBuf},
};

/// Bytes that are read of a small file; those of leases have about 200 bytes.
const SHORT_BYTES: u64 = 4 << 10;

/// Whether anything exists at `path`. False only if the folder of `path`, or a folder above, was read and lacks the name.
///
/// # Errors
/// The system's error if the system cannot read a folder; for a broken link, an error that names the link's target. The target's
/// volume may not be mounted: a caller that took the path for free would then make new data in place of the data on the volume.
pub fn is_there(path: &Path) -> io::Result<bool> {
    match fs::symlink_metadata(path) {
        Ok(found) if found.is_symlink() => leads_somewhere(path).map(|()| true),
        Ok(_) => Ok(true),
        Err(error) if error.kind() == io::ErrorKind::NotFound => match path.parent() {
            Some(folder) if folder != Path::new("") => is_there(folder).map(|_| false),
            _ => Ok(false),
        },
        Err(error) => Err(error),
    }
}

fn leads_somewhere(link: &Path) -> io::Result<()> {
    match fs::metadata(link) {
        Ok(_) => Ok(()),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let target = fs::read_link(link)?;
            Err(io::Error::other(format!(
                "{} is a link to {}, which does not exist: mount its volume, or remove the link",
                link.display(),
                target.display()
            )))
        }
        Err(error) => Err(error),
    }
}

/// Whether a folder is empty or does not exist.
///
/// # Errors
/// If the system cannot read the path, or the path is not a folder.
pub fn is_empty(folder: &Path) -> io::Result<bool> {
    Ok(!is_there(folder)? || fs::read_dir(folder)?.next().is_none())
}

/// The absolute path with its links resolved. Parts of the path that do not exist follow unchanged.
///
/// # Errors
/// If the system cannot determine which parts of the path exist.
pub fn without_links(path: &Path) -> io::Result<PathBuf> {
    let path = path::absolute(path)?;
    let mut missing = Vec::new();
    for part in path.ancestors() {
        if is_there(part)? {
            let mut whole = fs::canonicalize(part)?;
            for component in missing.into_iter().rev() {
                match component {
                    Component::ParentDir => drop(whole.pop()),
                    other => whole.push(other),
                }
            }
            return Ok(whole);
        }
        missing.extend(part.components().next_back());
    }
    Ok(path)
}

/// The path of a database's log. If `database` is a link to the file, SQLite keeps the log beside the file itself.
pub(crate) fn log_of(database: &Path) -> PathBuf {
    match database.canonicalize() {
        Ok(file) => with_suffix(&file, "-wal"),
        Err(_) => with_suffix(database, "-wal"),
    }
}

/// `path` with `suffix` after its name.
pub(crate) fn with_suffix(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(suffix);
    name.into()
}

/// Reads the beginning of a small file, which is opened anew: a network file system fetches new contents when a file is opened.
///
/// # Errors
/// If the file cannot be read, or is no regular file.
pub(crate) fn read_short(path: &Path) -> io::Result<Vec<u8>> {
    read_beginning(path, SHORT_BYTES)
}

/// Reads up to `most` bytes of a file, as [`read_short`] does.
///
/// # Errors
/// The errors of [`read_short`].
pub(crate) fn read_beginning(path: &Path, most: u64) -> io::Result<Vec<u8>> {
    expect_regular(path)?;
    let mut bytes = Vec::new();
    fs::File::open(path)?.take(most).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Syncs the bytes of a file, or the entries of a folder, to the disk.
///
/// # Errors
/// If the sync fails.
pub(crate) fn sync(path: &Path) -> io::Result<()> {
    fs::File::open(path)?.sync_all()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    #[test]
    fn only_a_name_that_its_folder_does_not_have_is_not_there() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("file"), "").unwrap();
        symlink(at("file"), at("link")).unwrap();
        symlink(at("unmounted/file"), at("lost")).unwrap();
        symlink(at("circle"), at("circle")).unwrap();
        for (name, found) in [
            ("file", true),
            ("link", true),
            ("absent", false),
            ("no/such/one", false),
        ] {
            assert_eq!(is_there(&at(name)).unwrap(), found, "{name}");
        }
        // A path beyond the link gives the same error.
        for name in ["lost", "lost/further"] {
            let error = is_there(&at(name)).unwrap_err().to_string();
            assert!(error.contains("unmounted/file, which does not exist"), "{error}");
        }
        assert!(is_there(&at("circle")).is_err());
        assert!(is_there(&at("file/within")).is_err());
    }

    #[test]
    fn only_a_folder_can_be_empty() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(is_empty(&at("absent")).unwrap());
        assert!(is_empty(folder.path()).unwrap());
        fs::write(at("file"), "").unwrap();
        symlink(at("unmounted"), at("lost")).unwrap();
        assert!(!is_empty(folder.path()).unwrap());
        for other in ["file", "file/within", "lost"] {
            assert!(is_empty(&at(other)).is_err(), "{other}");
        }
    }

    #[test]
    fn a_path_is_known_without_its_links_also_where_it_ends_in_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let whole = fs::canonicalize(folder.path()).unwrap();
        fs::create_dir(whole.join("data")).unwrap();
        symlink(whole.join("data"), whole.join("link")).unwrap();
        for (path, without) in [
            ("data", "data"),
            ("link/backups/monday", "data/backups/monday"),
            ("absent/../data/monday", "data/monday"),
            ("data/../other", "other"),
        ] {
            assert_eq!(
                without_links(&whole.join(path)).unwrap(),
                whole.join(without),
                "{path}"
            );
        }
    }
}
