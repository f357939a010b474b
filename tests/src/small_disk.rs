//! A small separate file system, if mounting is allowed ([`crate::Requirement::Mount`]).

use std::{
    fs, io,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// A mounted file system in memory. Dropping a `SmallDisk` unmounts the file system.
#[derive(Debug)]
pub struct SmallDisk(PathBuf);

impl SmallDisk {
    /// Mounts a file system of this `size`, such as `8m`, in a new folder. Panics if mounting is not allowed.
    #[must_use]
    pub fn new(at: &Path, size: &str) -> Self {
        Self::mount(at, size).expect("the harness asks first whether mounting is allowed")
    }

    /// Mounts a file system as [`SmallDisk::new`] does; `None` if mounting is not allowed.
    pub(crate) fn mount(at: &Path, size: &str) -> Option<Self> {
        fs::create_dir_all(at).unwrap();
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &format!("size={size}"), "tmpfs"])
            .arg(at)
            .stderr(Stdio::null())
            .status();
        mounted
            .is_ok_and(|status| status.success())
            .then(|| Self(at.to_owned()))
    }

    pub fn make_read_only(&self) {
        let remount = Command::new("mount")
            .args(["-o", "remount,ro"])
            .arg(&self.0)
            .status();
        assert!(remount.unwrap().success());
    }

    /// Fills the disk until the returned file is removed.
    #[must_use]
    pub fn fill(&self) -> PathBuf {
        let path = self.0.join("filler");
        let full = io::copy(&mut io::repeat(0), &mut fs::File::create(&path).unwrap()).unwrap_err();
        assert_eq!(full.kind(), io::ErrorKind::StorageFull);
        path
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Unmounts lazily, because a killed process or a failed test may still use the disk.
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}
