//! The kind of file system that holds a data directory: whether all processes that reach the directory see each other's locks
//! and memory.

use std::{fmt, path::Path};

/// Kinds of file systems that only one machine mounts, so that its kernel sees all locks. A disk that a hypervisor or a cloud
/// attaches to one machine at a time has one of these kinds too.
const LOCAL: [&str; 22] = [
    "apfs",
    "bcachefs",
    "btrfs",
    "exfat",
    "ext2",
    "ext3",
    "ext4",
    "f2fs",
    "fuse.fuse-overlayfs",
    "fuseblk",
    "hfsplus",
    "jfs",
    "nilfs2",
    "ntfs3",
    "overlay",
    "ramfs",
    "reiserfs",
    "tmpfs",
    "ubifs",
    "vfat",
    "xfs",
    "zfs",
];

/// The file system of a folder or file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FileSystem {
    /// The system's name of the kind, such as `ext4` or `nfs4`; empty if it is unknown.
    kind: String,
    is_local: bool,
}

impl FileSystem {
    /// The file system that holds `path`. A kind that cannot be determined counts as shared.
    #[must_use]
    pub fn of(path: &Path) -> Self {
        Self::of_kind(kind_of(path).unwrap_or_default())
    }

    pub(crate) fn of_kind(kind: String) -> Self {
        // Other systems than Linux do not tell the kind in the same way, and clusters run Linux.
        let is_local = !cfg!(target_os = "linux") || LOCAL.contains(&kind.as_str());
        Self { kind, is_local }
    }

    /// Whether processes that use the directory through other mounts or on other machines do not exist, or do not matter: only
    /// this machine's kernel keeps the locks.
    #[must_use]
    pub const fn is_local(&self) -> bool {
        self.is_local
    }
}

impl fmt::Display for FileSystem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.kind.as_str() {
            "" => f.write_str("a file system of unknown kind"),
            kind => write!(f, "a file system of the kind {kind}"),
        }
    }
}

#[cfg(target_os = "linux")]
fn kind_of(path: &Path) -> Option<String> {
    use rustix::fs::{AtFlags, CWD, StatxFlags, statx};
    let found = statx(CWD, path, AtFlags::empty(), StatxFlags::MNT_ID).ok()?;
    let mounts = std::fs::read_to_string("/proc/self/mountinfo").ok()?;
    let number = found.stx_mnt_id.to_string();
    let device = format!("{}:{}", found.stx_dev_major, found.stx_dev_minor);
    // Linux knows the mount of a file since version 5.8, and its device always.
    match StatxFlags::from_bits_retain(found.stx_mask).contains(StatxFlags::MNT_ID) {
        true => kind_in(&mounts, 0, &number),
        false => kind_in(&mounts, 2, &device),
    }
}

#[cfg(not(target_os = "linux"))]
fn kind_of(_: &Path) -> Option<String> {
    None
}

/// The kind of the mount whose field at this place has this value, of the lines of `/proc/self/mountinfo` (see proc(5)): field 0 is
/// the mount's number, field 2 its device.
#[cfg_attr(not(target_os = "linux"), expect(dead_code))]
fn kind_in(mounts: &str, field: usize, value: &str) -> Option<String> {
    let line = mounts
        .lines()
        .find(|line| line.split(' ').nth(field) == Some(value))?;
    let (_, rest) = line.split_once(" - ")?;
    rest.split(' ').next().map(str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_kind_of_a_mount_is_read() {
        let mounts = "27 1 254:1 / / rw,relatime shared:1 - ext4 /dev/vda rw\n\
                      43 27 0:39 / /home/a\\040b rw - fuse.sshfs head:/home rw,user_id=0\n\
                      44 27 0:40 / /scratch rw shared:2 master:3 - lustre mds@tcp:/scratch rw\n";
        assert_eq!(kind_in(mounts, 0, "27").unwrap(), "ext4");
        assert_eq!(kind_in(mounts, 0, "43").unwrap(), "fuse.sshfs");
        assert_eq!(kind_in(mounts, 2, "0:40").unwrap(), "lustre");
        assert_eq!(kind_in(mounts, 0, "4"), None);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn what_has_no_mount_counts_as_shared() {
        let nowhere = FileSystem::of(Path::new("/proc/no/such/file"));
        assert!(!nowhere.is_local());
        assert_eq!(nowhere.to_string(), "a file system of unknown kind");
        assert!(!FileSystem::of(Path::new("/proc")).is_local());
    }
}
