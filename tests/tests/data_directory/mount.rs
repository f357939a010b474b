//! Small file systems of their own, where that is allowed.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

/// A mounted file system in memory, unmounted when dropped.
pub struct Mount(PathBuf);

impl Mount {
    /// `None`, with a line that says so, where mounting is not allowed.
    pub fn new(at: &Path, size: &str) -> Option<Self> {
        fs::create_dir_all(at).unwrap();
        let options = format!("size={size}");
        let mounted = Command::new("mount")
            .args(["-t", "tmpfs", "-o", &options, "tmpfs"])
            .arg(at)
            .output();
        if mounted.is_ok_and(|output| output.status.success()) {
            return Some(Self(at.to_owned()));
        }
        eprintln!("skipped: mounting a small file system needs root");
        None
    }

    /// Allows no more writing.
    pub fn make_read_only(&self) {
        let remount = Command::new("mount")
            .args(["-o", "remount,ro"])
            .arg(&self.0)
            .status();
        assert!(remount.unwrap().success());
    }

    /// Takes what room there is, until the file that is returned is removed.
    pub fn fill(&self) -> PathBuf {
        let path = self.0.join("filler");
        let mut zeros = std::io::repeat(0);
        let full = std::io::copy(&mut zeros, &mut fs::File::create(&path).unwrap()).unwrap_err();
        assert_eq!(full.kind(), std::io::ErrorKind::StorageFull);
        path
    }
}

impl Drop for Mount {
    fn drop(&mut self) {
        // Lazily: a test that failed may have left a process in it.
        let _ = Command::new("umount").arg("-l").arg(&self.0).status();
    }
}
