//! Writes a file under a temporary name beside its target, and renames it once it is complete and on disk.

use rustix::{
    fs::{OFlags, fcntl_getfl, fcntl_setfl},
    io::Errno,
    process::geteuid,
};
use std::{
    fmt,
    fs::{self, File, Metadata, Permissions},
    io::{self, BufWriter, Write},
    os::unix::fs::{FileTypeExt as _, MetadataExt as _, OpenOptionsExt as _, PermissionsExt as _, fchown},
    path::{Path, PathBuf},
    thread,
    time::{Duration, Instant},
};
use tempfile::NamedTempFile;

/// Maximum number of symbolic links to follow.
const MAX_LINKS: u32 = 40;
/// Longest wait for a process that reads a pipe.
const READER_WAIT: Duration = Duration::from_secs(2);
/// Pause between two attempts to open a pipe that no process reads yet.
const READER_PAUSE: Duration = Duration::from_millis(20);

/// A file that is being written. [`NewFile::finish`] replaces the existing file of the same name; until then, the existing file
/// stays.
///
/// Follows links and replaces their target. Writes directly to devices and pipes, which have no content to lose, and to files
/// that a process has open, such as `/dev/stdout`. The new file keeps the permissions and, where the system allows it, the owner
/// of the file that it replaces.
#[derive(Debug)]
pub struct NewFile(Place);

#[derive(Debug)]
enum Place {
    Beside {
        file: BufWriter<NamedTempFile>,
        target: PathBuf,
        former: Option<Former>,
    },
    Itself {
        file: BufWriter<File>,
        path: PathBuf,
    },
}

/// Properties of the replaced file that the new file keeps.
#[derive(Debug)]
struct Former {
    user: u32,
    group: u32,
    permissions: Permissions,
}

/// Outcome of writing a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Written {
    New,
    Replaced,
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::New => "wrote",
            Self::Replaced => "replaced",
        })
    }
}

impl NewFile {
    /// Begins to write the file `path`, and creates missing parent folders.
    ///
    /// # Errors
    /// The system's error, or an error if `path` is a folder, a socket, or a pipe that no process reads.
    pub fn create(path: &Path) -> io::Result<Self> {
        // The default mode of temporary files, 0600, is too strict for the final file.
        Self::with_mode(path, 0o666)
    }

    /// Begins to write a file that only this process's user may read, whatever the owner and the permissions of the file that it
    /// replaces.
    ///
    /// # Errors
    /// The errors of [`NewFile::create`], and an error if `path` is a device or a pipe, which has permissions of its own.
    pub fn create_secret(path: &Path) -> io::Result<Self> {
        let mut created = Self::with_mode(path, 0o600)?;
        match &mut created.0 {
            Place::Beside { former, .. } => {
                // The former file may be somebody else's.
                *former = None;
                Ok(created)
            }
            Place::Itself { .. } => Err(io::Error::other("it is not a regular file")),
        }
    }

    fn with_mode(path: &Path, mode: u32) -> io::Result<Self> {
        let target = without_links(path)?;
        let former = match fs::symlink_metadata(&target) {
            Ok(found) if found.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
            Ok(found) if found.is_file() => Some(Former {
                user: found.uid(),
                group: found.gid(),
                permissions: found.permissions(),
            }),
            Ok(_) => return Self::directly(&target),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(error),
        };
        if former.is_some() {
            // Renaming needs write permission only for the folder. Opening the file for writing prevents replacing a
            // write-protected file.
            File::options().write(true).open(&target)?;
        }
        let folder = folder_of(&target);
        fs::create_dir_all(folder)?;
        let file = tempfile::Builder::new()
            .permissions(Permissions::from_mode(mode))
            .tempfile_in(folder)?;
        Ok(Self(Place::Beside {
            file: BufWriter::new(file),
            target,
            former,
        }))
    }

    /// Writes directly to a device, a pipe, or a file that a process has open.
    fn directly(path: &Path) -> io::Result<Self> {
        if fs::metadata(path)?.file_type().is_socket() {
            return Err(io::Error::other("it is a socket"));
        }
        let file = open_to_append(path)?;
        Ok(Self(Place::Itself {
            file: BufWriter::new(file),
            path: path.to_owned(),
        }))
    }

    /// Path of the unfinished file, for a program that writes the file itself.
    #[must_use]
    pub fn path(&self) -> &Path {
        match &self.0 {
            Place::Beside { file, .. } => file.get_ref().path(),
            Place::Itself { path, .. } => path,
        }
    }

    /// Waits until the file is on disk, and renames it to its target.
    ///
    /// # Errors
    /// The system's error, which leaves the previous file unchanged.
    pub fn finish(self) -> io::Result<Written> {
        self.place(true)
    }

    /// Like [`NewFile::finish`], but does not replace a file that appeared after [`NewFile::create`]. If such a file appeared,
    /// the new file keeps its temporary name, which the error contains.
    ///
    /// # Errors
    /// The errors of [`NewFile::finish`], and `AlreadyExists` if a file with this name has appeared.
    pub fn finish_unless_taken(self) -> io::Result<Written> {
        self.place(false)
    }

    fn place(self, over_newer: bool) -> io::Result<Written> {
        let (file, target, former) = match self.0 {
            Place::Beside { file, target, former } => (file, target, former),
            Place::Itself { mut file, .. } => return file.flush().map(|()| Written::New),
        };
        let file = file.into_inner().map_err(io::IntoInnerError::into_error)?;
        let written = match &former {
            Some(_) => Written::Replaced,
            None => Written::New,
        };
        let is_new = former.is_none();
        if let Some(Former {
            user,
            group,
            permissions,
        }) = former
        {
            // Only root can change a file's owner. Other users can change the group to one of their own groups.
            let _ = fchown(file.as_file(), Some(user), Some(group))
                .or_else(|_| fchown(file.as_file(), None, Some(group)));
            file.as_file().set_permissions(permissions)?;
        }
        file.as_file().sync_all()?;
        if is_new && !over_newer {
            persist_beside(file, &target)?;
        } else {
            file.persist(&target)?;
        }
        File::open(folder_of(&target))?.sync_all()?;
        Ok(written)
    }
}

/// Renames a file to `target`. If `target` exists by now, the file keeps its temporary name.
fn persist_beside(file: NamedTempFile, target: &Path) -> io::Result<()> {
    let refused = match file.persist_noclobber(target) {
        Ok(_) => return Ok(()),
        Err(refused) => refused,
    };
    // Some file systems do not support renaming without replacing.
    if refused.error.kind() != io::ErrorKind::AlreadyExists && !target.exists() {
        refused.file.persist(target)?;
        return Ok(());
    }
    let (_, kept) = refused.file.keep()?;
    let message = format!(
        "a file of this name has appeared meanwhile and was kept; the new contents are in {}",
        kept.display()
    );
    Err(io::Error::new(io::ErrorKind::AlreadyExists, message))
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.0 {
            Place::Beside { file, .. } => file.write(bytes),
            Place::Itself { file, .. } => file.write(bytes),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match &mut self.0 {
            Place::Beside { file, .. } => file.flush(),
            Place::Itself { file, .. } => file.flush(),
        }
    }
}

/// Opens a device, a pipe, or a file that a process has open. Opening a pipe that no process reads, or a serial line without a
/// peer, would wait without end, so the file is opened without waiting, and later writes wait as usual.
fn open_to_append(path: &Path) -> io::Result<File> {
    let begun = Instant::now();
    loop {
        let opened = File::options()
            .append(true)
            .custom_flags(OFlags::NONBLOCK.bits().cast_signed())
            .open(path);
        match opened {
            // A shell that starts the reader and this process together may start the reader last.
            Err(error) if is_without_reader(&error) && begun.elapsed() < READER_WAIT => {
                thread::sleep(READER_PAUSE);
            }
            Err(error) if is_without_reader(&error) => {
                return Err(io::Error::other(
                    "it is a pipe that no process reads, or a device without a peer: start the reader first",
                ));
            }
            Err(error) => return Err(error),
            Ok(file) => {
                let flags = fcntl_getfl(&file)? - OFlags::NONBLOCK;
                fcntl_setfl(&file, flags)?;
                return Ok(file);
            }
        }
    }
}

fn is_without_reader(error: &io::Error) -> bool {
    error.raw_os_error() == Some(Errno::NXIO.raw_os_error())
}

/// Writes a complete file.
///
/// # Errors
/// The errors of [`NewFile::create`] and [`NewFile::finish`], which leave the previous file unchanged.
pub fn write_file(path: &Path, bytes: impl AsRef<[u8]>) -> io::Result<Written> {
    let mut file = NewFile::create(path)?;
    file.write_all(bytes.as_ref())?;
    file.finish()
}

/// Resolves symbolic links, even if their target does not exist. Does not resolve links to file descriptors.
fn without_links(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..MAX_LINKS {
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_symlink() => {
                if is_descriptor(&path)? {
                    return Ok(path);
                }
                check_owner(&path, &found)?;
                path = folder_of(&path).join(fs::read_link(&path)?);
            }
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => return Ok(path),
        }
    }
    Err(io::Error::other("too many links lead to one another"))
}

/// Refuses another user's link in a shared folder such as `/tmp`, as Linux does with `fs.protected_symlinks`. The other user
/// could use such a link to have one of this user's files replaced.
fn check_owner(link: &Path, found: &Metadata) -> io::Result<()> {
    const STICKY_FOR_ALL: u32 = 0o1002;
    let folder = fs::metadata(folder_of(link))?;
    let is_shared = folder.mode() & STICKY_FOR_ALL == STICKY_FOR_ALL;
    if is_shared && ![folder.uid(), geteuid().as_raw()].contains(&found.uid()) {
        let message = format!(
            "{} is a link that another user made in a shared folder",
            link.display()
        );
        return Err(io::Error::new(io::ErrorKind::PermissionDenied, message));
    }
    Ok(())
}

/// Whether a link leads to an open file descriptor, as `/dev/stdout` leads to `/proc/self/fd/1`. Other output can go to the same
/// file, so the file must not be replaced.
fn is_descriptor(link: &Path) -> io::Result<bool> {
    Ok(fs::canonicalize(folder_of(link))?.starts_with("/proc"))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rustix::fs::{CWD, FileType, Mode, mknodat};
    use std::os::{
        fd::AsRawFd as _,
        unix::fs::{lchown, symlink},
    };

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_that_is_not_finished_leaves_the_former_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        write_file(&path, "old").unwrap();
        let mut file = NewFile::create(&path).unwrap();
        file.write_all(&[b'x'; 100_000]).unwrap();
        drop(file);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(names(folder.path()), ["table.csv"]);
        assert_eq!(write_file(&path, "new").unwrap(), Written::Replaced);
        assert_eq!(fs::read_to_string(&path).unwrap(), "new");
        assert_eq!(names(folder.path()), ["table.csv"]);
    }

    #[test]
    fn a_file_that_appears_meanwhile_stays_and_nothing_is_lost() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("table.csv");
        let mut file = NewFile::create(&path).unwrap();
        file.write_all(b"mine").unwrap();
        fs::write(&path, "another's").unwrap();
        let refused = file.finish_unless_taken().unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_to_string(&path).unwrap(), "another's");
        let kept = names(folder.path())
            .into_iter()
            .find(|name| name != "table.csv")
            .unwrap();
        assert!(refused.to_string().contains(&kept), "{refused}");
        assert_eq!(fs::read_to_string(folder.path().join(kept)).unwrap(), "mine");
        // `finish_unless_taken` replaces a file that existed before `create`.
        let mut file = NewFile::create(&path).unwrap();
        file.write_all(b"newer").unwrap();
        assert_eq!(file.finish_unless_taken().unwrap(), Written::Replaced);
    }

    #[test]
    fn a_link_stays_and_its_file_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write_file(&at("file"), "old").unwrap();
        for (link, target) in [("link", "file"), ("dangling", "later")] {
            symlink(at(target), at(link)).unwrap();
            write_file(&at(link), "new").unwrap();
            assert!(at(link).is_symlink());
            assert_eq!(fs::read_to_string(at(target)).unwrap(), "new");
        }
    }

    #[test]
    fn another_users_link_in_a_shared_folder_is_not_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::set_permissions(folder.path(), Permissions::from_mode(0o1777)).unwrap();
        write_file(&at("mine"), "old").unwrap();
        symlink(at("mine"), at("link")).unwrap();
        write_file(&at("link"), "new").unwrap();
        if geteuid().is_root() {
            lchown(at("link"), Some(1), None).unwrap();
            // Root owns the folder, and another user owns the link.
            let refused = write_file(&at("link"), "newer").unwrap_err();
            assert_eq!(refused.kind(), io::ErrorKind::PermissionDenied, "{refused}");
        }
        assert_eq!(fs::read_to_string(at("mine")).unwrap(), "new");
    }

    #[test]
    fn what_a_process_has_open_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let shared = File::create(at("shared")).unwrap();
        (&shared).write_all(b"first").unwrap();
        let descriptor = format!("/proc/self/fd/{}", shared.as_raw_fd());
        symlink(&descriptor, at("link")).unwrap();
        for (path, text) in [(Path::new(&descriptor), ", second"), (&at("link"), ", third")] {
            assert_eq!(write_file(path, text).unwrap(), Written::New);
        }
        assert_eq!(fs::read_to_string(at("shared")).unwrap(), "first, second, third");
        assert!(at("link").is_symlink());
    }

    #[test]
    fn a_file_among_devices_is_a_file() {
        let memory = Path::new("/dev/shm");
        if !memory.is_dir() {
            return;
        }
        let folder = tempfile::tempdir_in(memory).unwrap();
        let path = folder.path().join("table.csv");
        for (text, written) in [("older", Written::New), ("new", Written::Replaced)] {
            assert_eq!(write_file(&path, text).unwrap(), written);
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
    }

    #[test]
    fn a_link_to_itself_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("loop");
        symlink(&path, &path).unwrap();
        assert!(write_file(&path, "lost").is_err());
    }

    #[test]
    fn permissions_are_kept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.csv");
        write_file(&path, "old").unwrap();
        fs::set_permissions(&path, Permissions::from_mode(0o640)).unwrap();
        write_file(&path, "new").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o777, 0o640);
    }

    #[test]
    fn devices_are_written_to_and_folders_are_refused() {
        assert_eq!(write_file(Path::new("/dev/null"), "lost").unwrap(), Written::New);
        let full = write_file(Path::new("/dev/full"), "lost").unwrap_err();
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        assert!(!fs::metadata("/dev/null").unwrap().is_file());
        let folder = tempfile::tempdir().unwrap();
        let refused = write_file(folder.path(), "lost").unwrap_err();
        assert_eq!(refused.kind(), io::ErrorKind::IsADirectory);
        let within = folder.path().join("new/folders/file");
        assert_eq!(write_file(&within, "there").unwrap(), Written::New);
        let socket = folder.path().join("socket");
        let _listener = std::os::unix::net::UnixListener::bind(&socket).unwrap();
        let refused = write_file(&socket, "lost").unwrap_err();
        assert_eq!(refused.to_string(), "it is a socket");
    }

    #[test]
    fn a_pipe_is_written_to_if_a_process_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        mknodat(CWD, &pipe, FileType::Fifo, Mode::RUSR | Mode::WUSR, 0).unwrap();
        let refused = write_file(&pipe, "lost").unwrap_err();
        assert!(
            refused.to_string().contains("a pipe that no process reads"),
            "{refused}"
        );
        // More than a pipe holds: the writer waits for the reader.
        let text = "x".repeat(1 << 20);
        let read = thread::spawn({
            let pipe = pipe.clone();
            move || {
                thread::sleep(READER_PAUSE * 3);
                fs::read_to_string(pipe)
            }
        });
        assert_eq!(write_file(&pipe, &text).unwrap(), Written::New);
        assert!(read.join().unwrap().unwrap() == text);
    }
}
