//! A folder that two file systems show, each with locks of its own, if this is possible ([`crate::Requirement::BoundFolders`]).

use std::{
    fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// A mount of bindfs: shows another folder, and keeps locks of its own, as some network file systems do. Dropping a `BoundFolder`
/// unmounts it.
#[derive(Debug)]
pub struct BoundFolder(PathBuf);

impl BoundFolder {
    /// Shows the folder `of` at `at`, a new folder. Panics if this is not possible.
    #[must_use]
    pub fn new(of: &Path, at: &Path) -> Self {
        Self::mount(of, at).expect("the harness asks first whether it is possible")
    }

    /// Mounts as [`BoundFolder::new`] does; `None` if this is not possible.
    pub(crate) fn mount(of: &Path, at: &Path) -> Option<Self> {
        for folder in [of, at] {
            fs::create_dir_all(folder).unwrap();
        }
        let mounted = Command::new("bindfs")
            .args([of, at])
            .stderr(Stdio::null())
            .status();
        mounted
            .is_ok_and(|status| status.success())
            .then(|| Self(at.to_owned()))
    }
}

impl Drop for BoundFolder {
    fn drop(&mut self) {
        // Unmounts lazily, because a killed process or a failed test may still use the folder.
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}
