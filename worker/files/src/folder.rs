//! A folder of files that one command writes, such as a report. A list in the folder names the files that Murmuration wrote, for
//! later commands.

use crate::{listed::digest_of, listed::listed_file, new_file::write_file, unfinished::UnfinishedFolder};
use murmuration_swarm::counted;
use std::{
    collections::BTreeMap,
    fmt,
    fs::{self, File},
    io::{self, BufWriter, Write},
    path::{Path, PathBuf},
};

/// Name of the list of files that commands wrote into a folder.
const LIST: &str = ".murmuration-files";
/// First line of the list.
const EXPLANATION: &str = "# Files that murmuration wrote into this folder, each with its BLAKE3 digest. It replaces and removes no others.";
/// Maximum length of the list in bytes: enough for some 100,000 files.
const MAX_LIST_BYTES: u64 = 16 << 20;
/// Prefix of the name of a folder that is being filled.
const UNFINISHED: &str = ".murmuration-unfinished-";
/// Subfolder of the unfinished folder that keeps the replaced files.
const FORMER: &str = ".former";
/// Maximum number of files that an error names.
const NAMED: usize = 8;

/// A folder that is being filled. New files are in a hidden subfolder until [`Folder::finish`] moves them to their names.
///
/// The folder may hold the user's own files. By default, `finish` replaces only listed files that nobody changed since a command
/// wrote them. If any other file is in the way, `finish` fails and changes nothing. `finish` also removes unchanged listed files
/// that this command did not write again, such as files of an earlier report.
#[derive(Debug)]
pub struct Folder {
    path: PathBuf,
    unfinished: UnfinishedFolder,
    /// Names and digests of the files written so far, in order.
    files: Vec<(String, blake3::Hash)>,
    replaces: Replaces,
}

/// The existing files that a new file of the same name can replace.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Replaces {
    /// Files that a command wrote and that nobody changed since.
    Unchanged,
    /// Files that a command wrote, even if somebody changed them since.
    Changed,
    /// Every file: for the folders of a data directory, where only Murmuration writes.
    All,
}

/// Why a folder was not filled.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    #[error("cannot write {}: {source}", path.display())]
    Write { path: PathBuf, source: io::Error },
    /// The user's own files have the names of new files.
    #[error(
        "cannot write into {}: murmuration did not write {}, which {} in the way: name another folder, or move what is there",
        folder.display(),
        Names(names),
        if names.len() == 1 { "is" } else { "are" }
    )]
    Foreign { folder: PathBuf, names: Vec<String> },
    /// Somebody changed files that an earlier command wrote.
    #[error(
        "cannot write into {}: {} changed since murmuration wrote {}: name another folder, or replace {} with --force",
        folder.display(),
        Names(names),
        if names.len() == 1 { "it" } else { "them" },
        if names.len() == 1 { "it" } else { "them" }
    )]
    Changed { folder: PathBuf, names: Vec<String> },
}

/// Displays the first names of a list, and the number of the other names.
struct Names<'a>(&'a [String]);

impl fmt::Display for Names<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (named, others) = self.0.split_at(self.0.len().min(NAMED));
        f.write_str(&named.join(", "))?;
        match others.len() {
            0 => Ok(()),
            more => write!(f, " and {}", counted(more as u64, "other file")),
        }
    }
}

/// Digests of all contents that commands wrote to each file, by the file's path within the folder.
type Listed = BTreeMap<String, Vec<blake3::Hash>>;

impl Folder {
    /// Begins to fill the folder `path`, and creates this folder if it does not exist.
    ///
    /// # Errors
    /// [`FolderError::Write`] if no file can be written into the folder.
    pub fn create(path: &Path, replaces: Replaces) -> Result<Self, FolderError> {
        let begun = fs::create_dir_all(path).and_then(|()| UnfinishedFolder::new(path, UNFINISHED));
        Ok(Self {
            unfinished: begun.map_err(failed(path))?,
            path: path.to_owned(),
            files: Vec::new(),
            replaces,
        })
    }

    /// Writes a file of text; `name` is the file's path within the folder.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn text(&mut self, name: &str, text: &str) -> Result<(), FolderError> {
        self.bytes(name, text.as_bytes())
    }

    /// Writes a file.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn bytes(&mut self, name: &str, bytes: &[u8]) -> Result<(), FolderError> {
        self.write(name, |file| file.write_all(bytes))
    }

    /// Writes a file whose bytes come from `fill`.
    ///
    /// # Errors
    /// [`FolderError::Write`].
    pub fn write(
        &mut self,
        name: &str,
        fill: impl FnOnce(&mut dyn Write) -> io::Result<()>,
    ) -> Result<(), FolderError> {
        let path = self.unfinished.path().join(name);
        let digest = written(&path, fill).map_err(failed(&self.path.join(name)))?;
        self.files.retain(|(other, _)| other != name);
        self.files.push((name.to_owned(), digest));
        Ok(())
    }

    /// Checks that files with these names can be written, before the caller computes their contents.
    ///
    /// # Errors
    /// The errors of [`Folder::finish`].
    pub fn check_names<'a>(&self, names: impl IntoIterator<Item = &'a str>) -> Result<(), FolderError> {
        self.check(names, &self.listed()?)
    }

    fn check<'a>(
        &self,
        names: impl IntoIterator<Item = &'a str>,
        listed: &Listed,
    ) -> Result<(), FolderError> {
        let (mut foreign, mut changed) = (Vec::new(), Vec::new());
        for name in names {
            match self.state_of(name, listed) {
                State::Unlisted if self.replaces < Replaces::All => foreign.push(name.to_owned()),
                State::Foreign(found) => foreign.push(found),
                State::Changed if self.replaces == Replaces::Unchanged => changed.push(name.to_owned()),
                _ => {}
            }
        }
        foreign.dedup();
        let folder = self.path.clone();
        match (foreign.is_empty(), changed.is_empty()) {
            (false, _) => Err(FolderError::Foreign {
                folder,
                names: foreign,
            }),
            (true, false) => Err(FolderError::Changed {
                folder,
                names: changed,
            }),
            (true, true) => Ok(()),
        }
    }

    /// Moves the new files to their names, in the order of writing. Then removes unchanged files of earlier commands that this
    /// command did not write again. Returns the paths of the new files in the order of writing.
    ///
    /// # Errors
    /// [`FolderError::Foreign`] or [`FolderError::Changed`] lists the files that are in the way, and the folder is unchanged.
    /// [`FolderError::Write`] if the system refuses a change.
    pub fn finish(self) -> Result<Vec<PathBuf>, FolderError> {
        // Other commands wait until this command has written its list.
        let locked = File::open(&self.path).and_then(|folder| folder.lock().map(|()| folder));
        let _lock = locked.map_err(failed(&self.path))?;
        let mut listed = self.listed()?;
        let names = || self.files.iter().map(|(name, _)| name.as_str());
        self.check(names(), &listed)?;
        let stale: Vec<String> = listed
            .keys()
            .filter(|name| !names().any(|new| new == *name))
            .cloned()
            .collect();
        // The list names old and new files. If this command is killed from here on, the next command still recognises every file.
        for (name, digest) in &self.files {
            listed.entry(name.clone()).or_default().push(*digest);
        }
        self.keep_list(&listed)?;
        self.place_all()?;
        for name in stale {
            if self.state_of(&name, &listed) == State::Ours {
                let path = self.path.join(&name);
                fs::remove_file(&path).map_err(failed(&path))?;
                // If the file's folder is empty now, remove the folder too.
                let _ = path.parent().map(fs::remove_dir);
            }
        }
        let new = self
            .files
            .iter()
            .map(|(name, digest)| (name.clone(), vec![*digest]));
        self.keep_list(&new.collect())?;
        Ok(names().map(|name| self.path.join(name)).collect())
    }

    /// Moves every file to its place. If a file cannot be moved, restores the files replaced so far.
    fn place_all(&self) -> Result<(), FolderError> {
        let former = self.unfinished.path().join(FORMER);
        fs::create_dir(&former).map_err(failed(&self.path))?;
        for (name, _) in &self.files {
            if let Some(folder) = self.path.join(name).parent() {
                fs::create_dir_all(folder).map_err(failed(folder))?;
            }
        }
        let mut was_there = Vec::new();
        for (name, _) in &self.files {
            let target = self.path.join(name);
            // Keep the old file under a hard link, so that the file exists at every moment. Not all file systems support hard
            // links.
            let _ = fs::hard_link(&target, former.join(was_there.len().to_string()));
            let found = fs::symlink_metadata(&target).is_ok();
            if let Err(error) = fs::rename(self.unfinished.path().join(name), &target) {
                self.put_back(&former, &was_there);
                return Err(failed(&target)(error));
            }
            was_there.push(found);
        }
        Ok(())
    }

    /// Restores the files replaced so far, and removes the new files that replaced no file. If a previous file has no hard link,
    /// the new file stays, and the list names the new file.
    fn put_back(&self, former: &Path, was_there: &[bool]) {
        for (place, (was_there, (name, _))) in was_there.iter().zip(&self.files).enumerate() {
            let target = self.path.join(name);
            let _ = match was_there {
                true => fs::rename(former.join(place.to_string()), &target),
                false => fs::remove_file(&target),
            };
        }
    }

    /// The folder's list of files; empty if the folder has no list.
    ///
    /// # Errors
    /// [`FolderError::Foreign`] if something else has the list's name.
    fn listed(&self) -> Result<Listed, FolderError> {
        let path = self.path.join(LIST);
        let foreign = || FolderError::Foreign {
            folder: self.path.clone(),
            names: vec![LIST.to_owned()],
        };
        match fs::symlink_metadata(&path) {
            Ok(found) if found.is_file() && found.len() <= MAX_LIST_BYTES => {}
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Listed::new()),
            Ok(_) => return Err(foreign()),
            Err(error) => return Err(failed(&path)(error)),
        }
        let text = fs::read(&path).map_err(failed(&path))?;
        let text = String::from_utf8_lossy(&text);
        if text.lines().next() != Some(EXPLANATION) {
            return Err(foreign());
        }
        let mut listed = Listed::new();
        for (digest, name) in text.lines().filter_map(listed_file) {
            listed.entry(name.to_owned()).or_default().push(digest);
        }
        Ok(listed)
    }

    fn keep_list(&self, listed: &Listed) -> Result<(), FolderError> {
        let mut text = format!("{EXPLANATION}\n");
        for (name, digests) in listed {
            for digest in digests {
                text += &format!("{}  {name}\n", digest.to_hex());
            }
        }
        let path = self.path.join(LIST);
        write_file(&path, text).map(drop).map_err(failed(&path))
    }

    /// Compares the file at a path with the list.
    fn state_of(&self, name: &str, listed: &Listed) -> State {
        let path = self.path.join(name);
        let above = Path::new(name).ancestors().skip(1);
        for folder in above.filter(|folder| *folder != Path::new("")) {
            match fs::symlink_metadata(self.path.join(folder)) {
                Ok(found) if found.is_dir() => {}
                Ok(_) => return State::Foreign(folder.display().to_string()),
                Err(_) => return State::Absent,
            }
        }
        match (fs::symlink_metadata(&path), listed.get(name)) {
            (Err(error), _) if error.kind() == io::ErrorKind::NotFound => State::Absent,
            (Ok(found), None) if found.is_file() => State::Unlisted,
            (Ok(found), Some(digests)) if found.is_file() => match File::open(&path).and_then(digest_of) {
                Ok(digest) if digests.contains(&digest) => State::Ours,
                _ => State::Changed,
            },
            _ => State::Foreign(name.to_owned()),
        }
    }
}

/// State of the path of a file that a command is about to write or remove.
#[derive(Debug, Clone, PartialEq, Eq)]
enum State {
    Absent,
    /// A file that a command wrote and that nobody changed since.
    Ours,
    /// A file that a command wrote and that somebody changed since.
    Changed,
    /// A file that no command wrote.
    Unlisted,
    /// Path of something in the way: not a file at the file's path, or not a folder at the path of a parent folder.
    Foreign(String),
}

/// Writes a new file, waits until it is on disk, and returns its digest.
fn written(path: &Path, fill: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<blake3::Hash> {
    if let Some(folder) = path.parent() {
        fs::create_dir_all(folder)?;
    }
    let mut file = BufWriter::new(File::create(path)?);
    fill(&mut file)?;
    file.into_inner()
        .map_err(io::IntoInnerError::into_error)?
        .sync_all()?;
    digest_of(File::open(path)?)
}

fn failed(path: &Path) -> impl FnOnce(io::Error) -> FolderError {
    let path = path.to_owned();
    move |source| FolderError::Write { path, source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::os::unix::fs::symlink;

    fn fill(path: &Path, files: &[(&str, &str)], force: bool) -> Result<Vec<PathBuf>, FolderError> {
        let replaces = if force {
            Replaces::Changed
        } else {
            Replaces::Unchanged
        };
        fill_by(replaces, path, files)
    }

    fn fill_by(replaces: Replaces, path: &Path, files: &[(&str, &str)]) -> Result<Vec<PathBuf>, FolderError> {
        let mut folder = Folder::create(path, replaces)?;
        for (name, text) in files {
            folder.text(name, text)?;
        }
        folder.finish()
    }

    /// Text of every file in a folder, except the list.
    fn contents(path: &Path) -> BTreeMap<String, String> {
        let mut found = BTreeMap::new();
        let mut folders = vec![path.to_owned()];
        while let Some(folder) = folders.pop() {
            for entry in fs::read_dir(folder).unwrap() {
                let file = entry.unwrap().path();
                let name = file.strip_prefix(path).unwrap().to_str().unwrap().to_owned();
                match file.is_dir() {
                    true => folders.push(file),
                    false if name == LIST => {}
                    false => drop(found.insert(name, fs::read_to_string(&file).unwrap())),
                }
            }
        }
        found
    }

    #[test]
    fn a_later_command_replaces_what_an_earlier_one_wrote_and_nothing_else() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::write(at("recall.csv"), "mine").unwrap();
        fill(
            place.path(),
            &[("a.csv", "1"), ("maps/a.svg", "1"), ("page", "1")],
            false,
        )
        .unwrap();
        let written = fill(place.path(), &[("b.csv", "2"), ("page", "2")], false).unwrap();
        assert_eq!(written, [at("b.csv"), at("page")]);
        let left = contents(place.path());
        let left: Vec<_> = left
            .iter()
            .map(|(name, text)| (name.as_str(), text.as_str()))
            .collect();
        assert_eq!(left, [("b.csv", "2"), ("page", "2"), ("recall.csv", "mine")]);
        assert!(!at("maps").exists());
    }

    #[test]
    fn files_of_others_are_named_and_stay() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fs::write(at("spec.toml"), "mine").unwrap();
        fs::create_dir(at("page")).unwrap();
        let elsewhere = tempfile::tempdir().unwrap();
        symlink(elsewhere.path(), at("medoids")).unwrap();
        for force in [false, true] {
            let new = [
                ("spec.toml", "new"),
                ("medoids/1.png", "new"),
                ("page", "new"),
                ("x", "new"),
            ];
            let refused = fill(place.path(), &new, force).unwrap_err().to_string();
            assert!(
                refused.contains("did not write spec.toml, medoids, page, which are in the way"),
                "{refused}"
            );
        }
        assert_eq!(fs::read_to_string(at("spec.toml")).unwrap(), "mine");
        assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 0);
        assert_eq!(fs::read_dir(place.path()).unwrap().count(), 3);
    }

    #[test]
    fn a_changed_file_is_replaced_by_force_alone() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fill(place.path(), &[("page", "1"), ("table", "1")], false).unwrap();
        for name in ["page", "table"] {
            fs::write(at(name), "notes").unwrap();
        }
        let refused = fill(place.path(), &[("page", "2")], false).unwrap_err();
        let before = Folder::create(place.path(), Replaces::Unchanged).unwrap();
        for refused in [refused, before.check_names(["page"]).unwrap_err()] {
            assert!(
                matches!(&refused, FolderError::Changed { names, .. } if names == &["page"]),
                "{refused}"
            );
        }
        fill(place.path(), &[("page", "2")], true).unwrap();
        assert_eq!(fs::read_to_string(at("page")).unwrap(), "2");
        assert_eq!(
            fs::read_to_string(at("table")).unwrap(),
            "notes",
            "it is no longer ours"
        );
        let refused = fill(place.path(), &[("table", "3")], true).unwrap_err();
        assert!(matches!(refused, FolderError::Foreign { .. }), "{refused}");
    }

    #[test]
    fn a_folder_that_is_not_finished_stays_as_it_was() {
        let place = tempfile::tempdir().unwrap();
        fill(place.path(), &[("page", "1")], false).unwrap();
        let mut folder = Folder::create(place.path(), Replaces::Unchanged).unwrap();
        folder.text("page", "2").unwrap();
        let full = folder.write("table", |file| {
            file.write_all(b"half")?;
            Err(io::ErrorKind::StorageFull.into())
        });
        let full = full.unwrap_err().to_string();
        assert!(
            full.starts_with(&format!("cannot write {}", place.path().join("table").display())),
            "{full}"
        );
        drop(folder);
        assert_eq!(
            contents(place.path()),
            BTreeMap::from([("page".to_owned(), "1".to_owned())])
        );
    }

    #[test]
    fn a_list_that_somebody_wrote_reaches_nothing_outside() {
        let place = tempfile::tempdir().unwrap();
        let outside = place.path().join("outside");
        fs::write(&outside, "mine").unwrap();
        let folder = place.path().join("folder");
        fs::create_dir(&folder).unwrap();
        let digest = blake3::hash(b"mine").to_hex();
        let lines = format!(
            "{EXPLANATION}\n{digest}  ../outside\n{digest}  {}\n",
            outside.display()
        );
        fs::write(folder.join(LIST), lines).unwrap();
        fill(&folder, &[("page", "1")], true).unwrap();
        assert_eq!(fs::read_to_string(&outside).unwrap(), "mine");
        // The list can be a link, or a file that Murmuration did not write.
        fs::remove_file(folder.join(LIST)).unwrap();
        symlink(&outside, folder.join(LIST)).unwrap();
        fill(&folder, &[("page", "2")], true).unwrap_err();
        assert_eq!(fs::read_to_string(&outside).unwrap(), "mine");
        fs::remove_file(folder.join(LIST)).unwrap();
        fs::write(folder.join(LIST), "my notes").unwrap();
        let refused = fill(&folder, &[("page", "2")], true).unwrap_err().to_string();
        assert!(refused.contains("did not write .murmuration-files"), "{refused}");
        assert_eq!(fs::read_to_string(folder.join(LIST)).unwrap(), "my notes");
    }

    #[test]
    fn where_one_file_cannot_be_placed_all_stay_as_they_were() {
        let place = tempfile::tempdir().unwrap();
        let at = |name: &str| place.path().join(name);
        fill(place.path(), &[("a", "1"), ("b", "1")], false).unwrap();
        let mut folder = Folder::create(place.path(), Replaces::Unchanged).unwrap();
        for name in ["a", "c", "b"] {
            folder.text(name, "2").unwrap();
        }
        // Without its unfinished file, moving `b` will fail.
        fs::remove_file(folder.unfinished.path().join("b")).unwrap();
        folder.finish().unwrap_err();
        for name in ["a", "b"] {
            assert_eq!(fs::read_to_string(at(name)).unwrap(), "1");
        }
        assert!(!at("c").exists());
        fill(place.path(), &[("a", "3"), ("b", "3"), ("c", "3")], false).unwrap();
    }

    #[test]
    fn in_a_folder_of_ours_every_file_is_replaced() {
        let place = tempfile::tempdir().unwrap();
        fs::write(place.path().join("page"), "of a version without lists").unwrap();
        fill_by(Replaces::All, place.path(), &[("page", "2")]).unwrap();
        assert_eq!(fs::read_to_string(place.path().join("page")).unwrap(), "2");
        fs::write(place.path().join("page"), "changed").unwrap();
        fill_by(Replaces::All, place.path(), &[("page", "3")]).unwrap();
    }

    proptest! {
        /// No sequence of commands changes the user's own files in a folder.
        #[test]
        fn files_of_the_owner_stay(
            owned in prop::collection::btree_map("[a-f]", "[x-z]{0,3}", 0..4),
            commands in prop::collection::vec((prop::collection::btree_map("[a-h]", "[0-9]{1,3}", 1..5), any::<bool>()), 1..5),
        ) {
            let place = tempfile::tempdir().unwrap();
            for (name, text) in &owned {
                fs::write(place.path().join(name), text).unwrap();
            }
            let mut ours = BTreeMap::new();
            for (files, force) in commands {
                let named: Vec<_> = files.iter().map(|(name, text)| (name.as_str(), text.as_str())).collect();
                let is_free = files.keys().all(|name| !owned.contains_key(name));
                let filled = fill(place.path(), &named, force);
                prop_assert_eq!(filled.is_ok(), is_free);
                if is_free {
                    ours = files;
                }
                let mut expected = owned.clone();
                expected.extend(ours.clone());
                prop_assert_eq!(contents(place.path()), expected);
            }
        }
    }
}
