//! A C library that fails on demand, for real processes: syncs and writes that do not arrive, clocks that jump.
//!
//! Limits: Linux with a C compiler, and what a process asks of its C library; see `faulty_libc/faulty_libc.c`.

use std::{
    cell::Cell,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// What `errno` says of a disk that fails, and of one that can only be read.
const EIO: u32 = 5;
const EROFS: u32 = 30;

/// Faults of the processes that are started under it; none until they are asked for.
#[derive(Debug)]
pub struct FaultyLibc {
    control: PathBuf,
    sync: Cell<bool>,
    read_only: Cell<bool>,
    clock: Cell<i64>,
}

impl FaultyLibc {
    /// Faults that are controlled by a file in `folder`.
    #[must_use]
    pub fn new(folder: &Path) -> Self {
        let faults = Self {
            control: folder.join("faults"),
            sync: Cell::new(false),
            read_only: Cell::new(false),
            clock: Cell::new(0),
        };
        faults.apply();
        faults
    }

    /// Has every `fsync` and `fdatasync` fail with EIO from now on, or no longer.
    pub fn fail_syncs(&self, fail: bool) {
        self.sync.set(fail);
        self.apply();
    }

    /// Has the disk be read-only from now on, as far as databases write to it, or no longer.
    pub fn read_only(&self, read_only: bool) {
        self.read_only.set(read_only);
        self.apply();
    }

    /// Has the time of day be this many seconds ahead (or behind) from now on. Monotonic clocks stay as they are.
    pub fn shift_clock(&self, seconds: i64) {
        self.clock.set(seconds);
        self.apply();
    }

    /// What a process needs in its environment to be subject to the faults.
    #[must_use]
    pub fn environment(&self) -> [(&'static str, OsString); 2] {
        [
            ("LD_PRELOAD", library().into()),
            ("MURMURATION_FAULTS", self.control.clone().into()),
        ]
    }

    /// Replaces the file, so that no process reads half of it.
    fn apply(&self) {
        let errno = |fails: &Cell<bool>, errno| if fails.get() { errno } else { 0 };
        let (sync, write) = (errno(&self.sync, EIO), errno(&self.read_only, EROFS));
        let next = self.control.with_extension("next");
        fs::write(
            &next,
            format!("sync {sync}\nwrite {write}\nclock {}\n", self.clock.get()),
        )
        .unwrap();
        fs::rename(&next, &self.control).unwrap();
    }
}

/// The library, compiled beside the binaries.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let library = crate::binary("faulty_libc.so");
        // Several tests may compile it at once.
        let own = library.with_extension(std::process::id().to_string());
        let compiled = Command::new("cc")
            .args(["-shared", "-fPIC", "-O2", "-Wall", "-Wextra", "-Werror", "-o"])
            .arg(&own)
            .arg(concat!(
                env!("CARGO_MANIFEST_DIR"),
                "/src/faulty_libc/faulty_libc.c"
            ))
            .status();
        assert!(
            compiled.unwrap().success(),
            "the faulty C library does not compile"
        );
        fs::rename(&own, &library).unwrap();
        library
    })
}
