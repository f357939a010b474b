//! Makes the folder of an export under a temporary name, and gives it its own name once it is complete.

use crate::{CHECKPOINTS, ExportError, digests};
use murmuration_files::{UnfinishedFolder, remove_leftovers};
use murmuration_store::files::is_empty;
use std::{
    env,
    fs::{self, File, Permissions},
    io,
    os::unix::fs::PermissionsExt as _,
    path::{Path, PathBuf},
};

/// Prefix of a folder that is being filled.
const PREFIX: &str = ".murmuration-export-";
/// Ending of the name that the folder of a former export has while a new export replaces it. If such a folder remains, the new
/// export possibly did not get its name.
const REPLACED: &str = "replaced";

/// The absolute path of an export, without links. The path must be an empty folder or not exist, unless `replaces` allows an
/// export there.
pub(crate) fn target(target: &Path, replaces: bool) -> Result<PathBuf, ExportError> {
    target_seen_from(&env::current_dir().unwrap_or_default(), target, replaces)
}

fn target_seen_from(current: &Path, target: &Path, replaces: bool) -> Result<PathBuf, ExportError> {
    let failed = ExportError::file("look into", target);
    // Links are resolved first, because a folder cannot be renamed to `.` or to a link.
    let whole = match fs::canonicalize(target) {
        Ok(whole) => whole,
        Err(error) if error.kind() == io::ErrorKind::NotFound => target.to_path_buf(),
        Err(error) => return Err(failed(error)),
    };
    if whole.is_file() {
        return Err(failed(io::Error::other("it is a file: name a new folder")));
    }
    remove_leftovers(&whole, PREFIX);
    if is_empty(&whole).map_err(failed)? {
        return Ok(whole);
    }
    if !replaces {
        return Err(ExportError::NotEmpty(target.to_path_buf()));
    }
    if !digests::is_alone(&whole).map_err(ExportError::file("look into", target))? {
        return Err(ExportError::NoExport(target.to_path_buf()));
    }
    match current.starts_with(&whole) {
        true => Err(ExportError::WorkingFolder(whole)),
        false => Ok(whole),
    }
}

/// Makes a new folder in `target` if that is an empty folder, or else beside `target`. Removes folders that ended processes left
/// in the same place.
pub(crate) fn new_folder(target: &Path) -> Result<UnfinishedFolder, ExportError> {
    let folder_of_it =
        match is_empty(target).map_err(ExportError::file("look into", target))? && target.is_dir() {
            true => target,
            false => parent(target),
        };
    fs::create_dir_all(folder_of_it).map_err(ExportError::file("make", folder_of_it))?;
    UnfinishedFolder::new(folder_of_it, PREFIX).map_err(ExportError::file("make a folder in", folder_of_it))
}

fn parent(target: &Path) -> &Path {
    match target.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// Gives a complete folder its name. If `replaces` is set, it then removes the former export of that name.
pub(crate) fn place(folder: UnfinishedFolder, target: &Path, replaces: bool) -> Result<(), ExportError> {
    let checkpoints = folder.path().join(CHECKPOINTS);
    if checkpoints.is_dir() {
        sync(&checkpoints)?;
    }
    sync(folder.path())?;
    if folder.path().parent() == Some(target) {
        return move_up(folder.path(), target);
    }
    let (folder, _lock) = folder.keep();
    let placed = rename(&folder, target, replaces);
    if placed.is_err() {
        // A folder that is left here would block the next export. If it cannot be removed here, the next export reports it.
        let _ = fs::remove_dir_all(&folder);
    }
    placed
}

/// Moves the files of a folder into its parent, the list of files last: without the list, a folder is no export.
fn move_up(folder: &Path, target: &Path) -> Result<(), ExportError> {
    let failed = |error| ExportError::file("write", target)(error);
    let entries = fs::read_dir(folder).map_err(failed)?;
    let names: Result<Vec<_>, _> = entries
        .map(|entry| entry.map(|entry| entry.file_name()))
        .collect();
    let mut names = names.map_err(failed)?;
    names.sort_by_key(|name| name == digests::FILE);
    // Another process can have written to the target meanwhile.
    if names
        .iter()
        .any(|name| target.join(name).symlink_metadata().is_ok())
    {
        return Err(ExportError::NotEmpty(target.to_path_buf()));
    }
    let mut moved = Vec::new();
    for name in names {
        if let Err(error) = fs::rename(folder.join(&name), target.join(&name)) {
            for name in moved {
                // The moved files go back into the folder, and are removed with the folder.
                let _ = fs::rename(target.join(&name), folder.join(&name));
            }
            return Err(failed(error));
        }
        moved.push(name);
    }
    sync(target)
}

fn rename(folder: &Path, target: &Path, replaces: bool) -> Result<(), ExportError> {
    let failed = |error| ExportError::file("write", target)(error);
    if is_empty(target).map_err(failed)? {
        // The target is missing or empty, so nothing is replaced.
        fs::rename(folder, target).map_err(failed)?;
        return sync(parent(target));
    }
    if !replaces {
        // Another process has written to the target meanwhile.
        return Err(ExportError::NotEmpty(target.to_path_buf()));
    }
    // A file can have been added to the old export meanwhile.
    if !digests::is_alone(target).unwrap_or(false) {
        return Err(ExportError::NoExport(target.to_path_buf()));
    }
    let old = folder.with_extension(REPLACED);
    fs::rename(target, &old).map_err(failed)?;
    if let Err(error) = fs::rename(folder, target) {
        return Err(match fs::rename(&old, target) {
            Ok(()) => failed(error),
            Err(_) => ExportError::Aside {
                old,
                target: target.to_path_buf(),
                source: error,
            },
        });
    }
    // The new export must be on disk under its name before the old export is removed.
    sync(parent(target))?;
    // The owner can have made the old export read-only.
    for folder in [old.clone(), old.join(CHECKPOINTS)] {
        let _ = fs::set_permissions(folder, Permissions::from_mode(0o755));
    }
    if let Err(error) = fs::remove_dir_all(&old) {
        tracing::warn!(path = %old.display(), %error, "the export that was replaced is still there: remove it");
    }
    Ok(())
}

fn sync(folder: &Path) -> Result<(), ExportError> {
    let synced = File::open(folder).and_then(|folder| folder.sync_all());
    synced.map_err(ExportError::file("write", folder))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{CAMPAIGN, DATABASE, SPEC};
    use std::os::unix::fs::symlink;

    fn export_in(folder: &Path, text: &str) {
        fs::create_dir_all(folder).unwrap();
        let mut listed = digests::Digests::default();
        for name in [SPEC, CAMPAIGN, DATABASE, "README.md"] {
            fs::write(folder.join(name), text).unwrap();
            listed.add(folder, name).unwrap();
        }
        fs::write(folder.join(digests::FILE), listed.to_text()).unwrap();
    }

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        names.collect()
    }

    #[test]
    fn a_link_to_an_empty_folder_is_followed() {
        let place_of_all = tempfile::tempdir().unwrap();
        let at = |name: &str| place_of_all.path().join(name);
        fs::create_dir(at("volume")).unwrap();
        fs::create_dir(at("empty")).unwrap();
        symlink(at("volume"), at("link")).unwrap();
        for name in ["link", "empty/.", "new"] {
            let target = target(&at(name), true).unwrap();
            let folder = new_folder(&target).unwrap();
            export_in(folder.path(), name);
            place(folder, &target, true).unwrap();
            assert_eq!(fs::read_to_string(at(name).join("README.md")).unwrap(), name);
            assert!(digests::is_alone(&at(name)).unwrap(), "{:?}", names(&at(name)));
        }
        assert!(at("link").is_symlink());
    }

    #[test]
    fn an_empty_folder_stays_the_same_folder() {
        use std::os::unix::fs::MetadataExt as _;
        let folder = tempfile::tempdir().unwrap();
        let before = fs::metadata(folder.path()).unwrap().ino();
        let target = target(folder.path(), false).unwrap();
        let filled = new_folder(&target).unwrap();
        export_in(filled.path(), "new");
        place(filled, &target, false).unwrap();
        // The empty folder itself stays, because a shell can be in it, or a volume can be mounted on it.
        assert_eq!(fs::metadata(folder.path()).unwrap().ino(), before);
        assert!(digests::is_alone(folder.path()).unwrap());
    }

    #[test]
    fn an_export_that_was_quicker_stays() {
        let place_of_all = tempfile::tempdir().unwrap();
        let path = place_of_all.path().join("export");
        let [first, second] = ["first", "second"].map(|text| {
            let target = target(&path, false).unwrap();
            let folder = new_folder(&target).unwrap();
            export_in(folder.path(), text);
            (folder, target)
        });
        place(first.0, &first.1, false).unwrap();
        let refused = place(second.0, &second.1, false);
        assert!(matches!(refused, Err(ExportError::NotEmpty(_))), "{refused:?}");
        assert_eq!(fs::read_to_string(path.join("README.md")).unwrap(), "first");
        assert_eq!(names(place_of_all.path()), ["export"]);
    }

    #[test]
    fn the_folder_that_somebody_is_in_is_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let whole = fs::canonicalize(folder.path()).unwrap();
        export_in(&whole, "old");
        let within = whole.join("checkpoints");
        for current in [&whole, &within] {
            let refused = target_seen_from(current, folder.path(), true).unwrap_err();
            assert!(refused.to_string().contains("is the working folder"), "{refused}");
        }
        let beside = whole.with_extension("beside");
        assert_eq!(target_seen_from(&beside, folder.path(), true).unwrap(), whole);
    }

    #[test]
    fn a_former_export_keeps_its_name_where_the_new_one_cannot_get_it() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("export");
        export_in(&target, "old");
        // A folder that does not exist cannot be renamed.
        let failed = rename(&folder.path().join("gone"), &target, true).unwrap_err();
        assert!(matches!(failed, ExportError::File { .. }), "{failed}");
        assert_eq!(fs::read_to_string(target.join("README.md")).unwrap(), "old");
        assert_eq!(names(folder.path()), ["export"]);
    }
}
