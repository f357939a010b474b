//! A C library with faults that a test can switch on in real processes: syncs and writes that fail, and clocks that jump.
//!
//! Limits: the library needs Linux and a C compiler, and affects only calls of the C library; see `faulty_libc/faulty_libc.c`.

use std::{
    cell::Cell,
    ffi::OsString,
    fs,
    path::{Path, PathBuf},
    process::Command,
    sync::OnceLock,
};

/// The `errno` of a failing disk, and of a read-only disk.
const EIO: u32 = 5;
const EROFS: u32 = 30;

/// Injects faults into processes that are started with [`FaultyLibc::environment`]. Without a request, no fault occurs.
#[derive(Debug)]
pub struct FaultyLibc {
    control: PathBuf,
    sync: Cell<bool>,
    read_only: Cell<bool>,
    clock: Cell<i64>,
}

impl FaultyLibc {
    /// Faults that a file in `folder` controls.
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

    /// Starts or stops failing every `fsync` and `fdatasync` with EIO.
    pub fn fail_syncs(&self, fail: bool) {
        self.sync.set(fail);
        self.apply();
    }

    /// Makes the disk read-only for databases, or writable again.
    pub fn read_only(&self, read_only: bool) {
        self.read_only.set(read_only);
        self.apply();
    }

    /// Shifts the time of day by this many seconds from now on. Monotonic clocks are unchanged.
    pub fn shift_clock(&self, seconds: i64) {
        self.clock.set(seconds);
        self.apply();
    }

    /// The environment variables that inject the faults into a process.
    #[must_use]
    pub fn environment(&self) -> [(&'static str, OsString); 2] {
        [
            ("LD_PRELOAD", library().into()),
            ("MURMURATION_FAULTS", self.control.clone().into()),
        ]
    }

    /// Replaces the control file atomically, so that no process reads half of the file.
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

/// The library, compiled into the folder of the binaries.
fn library() -> &'static Path {
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    LIBRARY.get_or_init(|| {
        let library = crate::binary("faulty_libc.so");
        // Several tests may compile the library at the same time.
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
