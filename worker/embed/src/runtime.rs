//! Finds the ONNX Runtime library, and loads it before its first use.

use super::{
    Device,
    device::{IDENTITY, open_session},
};
use murmuration_swarm::EmbeddingKind;
use ort::environment::Environment;
use std::{
    env::{self, consts::ARCH},
    fmt, fs,
    hash::{BuildHasher as _, RandomState},
    io,
    path::{Path, PathBuf},
    sync::{Mutex, PoisonError},
};

/// The version of ONNX Runtime that `make runtime` fetches: the last version whose Linux build does not contain the vendor's
/// telemetry. Versions from 1.17 on work.
pub(crate) const ONNX_RUNTIME_VERSION: &str = "1.28.0";

/// File names of the system's ONNX Runtime: from the development package, then from the runtime package.
#[cfg(not(target_os = "macos"))]
const SYSTEM_NAMES: &[&str] = &["libonnxruntime.so", "libonnxruntime.so.1"];
#[cfg(target_os = "macos")]
const SYSTEM_NAMES: &[&str] = &["libonnxruntime.dylib"];

/// Folders of a Python environment that contain a folder for each Python version.
const LIBRARY_FOLDERS: [&str; 2] = ["lib", "lib64"];
/// Folders of a Python version that contain packages: the usual folder, and Debian's folder, which pip shares with the system.
const PACKAGE_FOLDERS: [&str; 2] = ["site-packages", "dist-packages"];

/// ONNX Runtime, loaded into this process.
///
/// A process loads the library once; clones of this value are handles to the loaded library.
#[derive(Clone)]
pub struct Runtime {
    environment: Environment,
    library: PathBuf,
    device: Device,
}

/// Why ONNX Runtime is not available.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RuntimeError {
    /// The library was not found.
    #[error(
        "ONNX Runtime, which embedders run on, is not installed. `make runtime` fetches it, and so does \
         `pip install onnxruntime=={ONNX_RUNTIME_VERSION}` in the Python environment that this program is in; or set \
         ORT_DYLIB_PATH to the libonnxruntime.so of another (1.17 or newer). Looked for:{}",
        .0.iter().map(|place| format!("\n  {place}")).collect::<String>()
    )]
    Missing(Vec<String>),
    /// The library does not load.
    #[error("{} cannot be used as ONNX Runtime: {reason}", library.display())]
    Unusable { library: PathBuf, reason: String },
    /// The library is built for other devices.
    #[error(
        "{} is built without {device}: `pip install onnxruntime-gpu=={ONNX_RUNTIME_VERSION}` instead of `onnxruntime`, or set \
         ORT_DYLIB_PATH to the libonnxruntime.so of a build that has it", library.display()
    )]
    OtherDevices { library: PathBuf, device: Device },
    /// The device does not run a network.
    #[error(
        "{device} embeds nothing on this machine (a card, its driver or a library of {device} is missing?): {reason}"
    )]
    DeviceUnusable { device: Device, reason: String },
}

impl Runtime {
    /// Loads ONNX Runtime, if it is not loaded yet.
    ///
    /// Uses the library that `ORT_DYLIB_PATH` names. Without that variable, uses the first library that exists. The order is:
    /// `onnxruntime` in this program's Python environment, the pinned version beside this program, the pinned version in the
    /// [`cache_folder`], the system's library. Never fetches a library.
    ///
    /// # Errors
    /// [`RuntimeError::Missing`], whose text explains how to install the library, or [`RuntimeError::Unusable`] if the library
    /// does not load.
    pub fn load() -> Result<Self, RuntimeError> {
        static LOADED: Mutex<Option<Runtime>> = Mutex::new(None);
        let mut loaded = LOADED.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(runtime) = &*loaded {
            return Ok(runtime.clone());
        }
        let runtime = find(named_library(), &known_libraries())?;
        Ok(loaded.insert(runtime).clone())
    }

    /// This library, for embedders that run on `device`.
    ///
    /// # Errors
    /// [`RuntimeError::OtherDevices`], or [`RuntimeError::DeviceUnusable`] if a network of one node does not open on the device.
    pub fn on(self, device: Device) -> Result<Self, RuntimeError> {
        if device == self.device {
            return Ok(self);
        }
        let runtime = Self { device, ..self };
        runtime.try_device()?;
        Ok(runtime)
    }

    /// The device that embeds.
    #[must_use]
    pub const fn device(&self) -> Device {
        self.device
    }

    /// The path of the library, or its name if the system found it.
    #[must_use]
    pub fn library(&self) -> &Path {
        &self.library
    }

    /// The library's description of its build: version, commit, flags. Embeddings by two builds can differ in their last bits.
    #[must_use]
    pub fn build(&self) -> &'static str {
        ort::info()
    }

    /// The embedding kind of this machine: the processor's instruction sets, by which ONNX Runtime chooses its kernels, and the
    /// build of ONNX Runtime. Machines of the same kind compute embeddings with the same bits. A card's kind is another in each
    /// call: its bits can depend on its model, its driver, and the number of pictures.
    #[must_use]
    pub fn kind(&self) -> EmbeddingKind {
        match self.device {
            Device::Cpu => {
                EmbeddingKind::of(&format!("{ARCH} {} {}", instructions().join(" "), self.build()))
            }
            Device::Cuda => EmbeddingKind::from(RandomState::new().hash_one(self.device) | 1),
        }
    }

    pub(super) const fn environment(&self) -> &Environment {
        &self.environment
    }

    fn try_device(&self) -> Result<(), RuntimeError> {
        if !self.device.is_built_in() {
            return Err(RuntimeError::OtherDevices {
                library: self.library.clone(),
                device: self.device,
            });
        }
        let opened = open_session(&self.environment, self.device, IDENTITY);
        opened.map_err(|error| RuntimeError::DeviceUnusable {
            device: self.device,
            reason: error.to_string().trim_end().to_owned(),
        })?;
        Ok(())
    }
}

impl fmt::Debug for Runtime {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Runtime")
            .field("library", &self.library)
            .finish_non_exhaustive()
    }
}

/// Instruction sets of this CPU for which ONNX Runtime has kernels.
#[cfg(target_arch = "x86_64")]
fn instructions() -> Vec<&'static str> {
    macro_rules! detected {
        ($($name:tt)*) => {
            [$(($name, std::arch::is_x86_feature_detected!($name))),*]
        };
    }
    let all = detected!(
        "sse4.1" "avx" "fma" "f16c" "avx2" "avxvnni" "avx512f" "avx512bw" "avx512dq" "avx512vl" "avx512vnni"
        "avx512bf16" "avx512fp16"
    );
    let detected = all.into_iter().filter(|(_, detected)| *detected);
    detected.map(|(name, _)| name).collect()
}

#[cfg(target_arch = "aarch64")]
fn instructions() -> Vec<&'static str> {
    macro_rules! detected {
        ($($name:tt)*) => {
            [$(($name, std::arch::is_aarch64_feature_detected!($name))),*]
        };
    }
    let all = detected!("neon" "fp16" "dotprod" "i8mm" "bf16" "sve" "sve2");
    let detected = all.into_iter().filter(|(_, detected)| *detected);
    detected.map(|(name, _)| name).collect()
}

#[cfg(not(any(target_arch = "x86_64", target_arch = "aarch64")))]
fn instructions() -> Vec<&'static str> {
    Vec::new()
}

/// The folder for data that can be fetched again: `$XDG_CACHE_HOME/murmuration` or `~/.cache/murmuration`; `None` without a
/// home directory.
#[must_use]
pub fn cache_folder() -> Option<PathBuf> {
    let absolute = |name| {
        env::var_os(name)
            .map(PathBuf::from)
            .filter(|path| path.is_absolute())
    };
    let caches = absolute("XDG_CACHE_HOME").or_else(|| Some(absolute("HOME")?.join(".cache")))?;
    Some(caches.join("murmuration"))
}

fn named_library() -> Option<PathBuf> {
    env::var_os("ORT_DYLIB_PATH")
        .filter(|path| !path.is_empty())
        .map(PathBuf::from)
}

/// Possible paths of the library, in order of preference: first in the Python package, then of the pinned version.
fn known_libraries() -> Vec<PathBuf> {
    let file = match cfg!(target_os = "macos") {
        true => format!("libonnxruntime.{ONNX_RUNTIME_VERSION}.dylib"),
        false => format!("libonnxruntime.so.{ONNX_RUNTIME_VERSION}"),
    };
    let program = env::current_exe().ok();
    let folder = program.as_deref().and_then(Path::parent);
    let of_python = folder.into_iter().flat_map(of_python_environment);
    let beside = folder.map(|folder| folder.join(&file));
    let cached = cache_folder().map(|folder| {
        folder
            .join(format!("onnxruntime-{ONNX_RUNTIME_VERSION}"))
            .join(&file)
    });
    of_python.chain(beside).chain(cached).collect()
}

/// Libraries of the packages `onnxruntime` in the Python environment whose programs are in the folder `programs`. pip installs
/// `onnxruntime` as a dependency of Murmuration's wheel.
fn of_python_environment(programs: &Path) -> Vec<PathBuf> {
    let within = |folder: PathBuf, is_wanted: fn(&str) -> bool| -> Vec<PathBuf> {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let wanted = entries.filter(|entry| is_wanted(&entry.file_name().to_string_lossy()));
        let mut paths: Vec<_> = wanted.map(|entry| entry.path()).collect();
        paths.sort_unstable();
        paths
    };
    let Some(environment) = programs.parent() else {
        return Vec::new();
    };
    let folders = LIBRARY_FOLDERS.map(|folder| environment.join(folder));
    // Debian has one folder, `python3`, for all Python versions.
    let versions = folders
        .into_iter()
        .flat_map(|folder| within(folder, |name| name.starts_with("python3")));
    let packages = versions.flat_map(|version| PACKAGE_FOLDERS.map(|packages| version.join(packages)));
    packages
        .flat_map(|packages| within(packages.join("onnxruntime/capi"), is_library))
        .collect()
}

/// Whether a file of the Python package `onnxruntime` is the library. The library's version follows `so` in the file's name, or
/// precedes `dylib`.
fn is_library(file: &str) -> bool {
    let version = file.strip_prefix("libonnxruntime.");
    version.is_some_and(|version| version.starts_with("so.") || version.ends_with(".dylib"))
}

/// Loads the named library, or else the first pinned library that exists, or else the system's library.
fn find(named: Option<PathBuf>, pinned: &[PathBuf]) -> Result<Runtime, RuntimeError> {
    if let Some(library) = certain(named, pinned) {
        return load(library);
    }
    let mut tried: Vec<String> = pinned
        .iter()
        .map(|library| library.display().to_string())
        .collect();
    for &name in SYSTEM_NAMES {
        match load(PathBuf::from(name)) {
            // The loader's error does not distinguish a missing library from a library that is too old.
            Err(error) => tried.push(format!("{name} of the system: {error}")),
            loaded => return loaded,
        }
    }
    Err(RuntimeError::Missing(tried))
}

/// The named library, or else the first pinned library that exists. If this library does not load, no other library is tried.
fn certain(named: Option<PathBuf>, pinned: &[PathBuf]) -> Option<PathBuf> {
    // An unreadable file counts as present: a different library would compute different bits.
    let is_absent = |library: &Path| {
        fs::symlink_metadata(library).is_err_and(|error| error.kind() == io::ErrorKind::NotFound)
    };
    named.or_else(|| pinned.iter().find(|library| !is_absent(library)).cloned())
}

fn load(library: PathBuf) -> Result<Runtime, RuntimeError> {
    let unusable = |reason: String| RuntimeError::Unusable {
        library: library.clone(),
        reason,
    };
    // Load the library by its path before any other use of `ort`, because `ort` panics if it loads a library by itself and fails.
    let builder = ort::init_from(&library).map_err(|error| unusable(error.to_string()))?;
    let environment = builder
        .with_name("murmuration")
        .with_telemetry(false)
        .build()
        .map_err(|error| unusable(error.to_string()))?;
    Ok(Runtime {
        environment,
        library,
        device: Device::Cpu,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_that_is_named_goes_before_one_that_was_fetched() {
        let folder = tempfile::tempdir().unwrap();
        let [absent, fetched] = ["absent", "fetched"].map(|name| folder.path().join(name));
        fs::write(&fetched, "a library").unwrap();
        let pinned = [absent.clone(), fetched.clone()];
        assert_eq!(certain(Some(absent.clone()), &pinned), Some(absent.clone()));
        assert_eq!(certain(None, &pinned), Some(fetched));
        // An unreadable file counts as present: no other library is used instead.
        let unmounted = folder.path().join("unmounted");
        std::os::unix::fs::symlink(&absent, &unmounted).unwrap();
        let pinned = [unmounted.clone(), pinned[1].clone()];
        assert_eq!(certain(None, &pinned), Some(unmounted));
        assert_eq!(certain(None, &[absent]), None);
    }

    #[test]
    fn a_program_of_a_python_environment_finds_its_package() {
        let environment = tempfile::tempdir().unwrap();
        let programs = environment.path().join("bin");
        assert_eq!(of_python_environment(&programs), Vec::<PathBuf>::new());
        // Paths where pip installs the package: on Linux, on macOS, on Debian outside of an environment, and on Fedora.
        let places = [
            ("lib/python3.12/site-packages", "libonnxruntime.so.1.28.0"),
            ("lib/python3.13/site-packages", "libonnxruntime.1.28.0.dylib"),
            ("lib/python3/dist-packages", "libonnxruntime.so.1.24.4"),
            ("lib64/python3.14/site-packages", "libonnxruntime.so.1.28.0"),
        ];
        let libraries = places.map(|(packages, library)| {
            let package = environment.path().join(packages).join("onnxruntime/capi");
            fs::create_dir_all(&package).unwrap();
            for name in [
                library,
                "libonnxruntime_providers_shared.so",
                "libonnxruntime.dylib.txt",
            ] {
                fs::write(package.join(name), "a library").unwrap();
            }
            package.join(library)
        });
        let [linux, macos, debian, fedora] = libraries;
        assert_eq!(of_python_environment(&programs), [debian, linux, macos, fedora]);
    }

    #[test]
    fn what_is_missing_says_how_to_get_it() {
        let message = RuntimeError::Missing(vec!["/here".into(), "/there".into()]).to_string();
        assert!(
            [
                "`make runtime`",
                "`pip install onnxruntime==1.28.0`",
                "ORT_DYLIB_PATH"
            ]
            .iter()
            .all(|way| message.contains(way)),
            "{message}"
        );
        assert!(message.ends_with("Looked for:\n  /here\n  /there"), "{message}");
    }

    #[test]
    fn the_library_is_loaded_once() {
        let runtime = Runtime::load().unwrap();
        assert_eq!(Runtime::load().unwrap().library(), runtime.library());
        assert!(runtime.build().contains("ORT Build Info"), "{}", runtime.build());
    }

    #[test]
    fn a_device_is_tried_before_it_embeds() {
        let runtime = Runtime::load().unwrap();
        let kind = runtime.kind();
        assert!(
            runtime.try_device().is_ok(),
            "a processor opens the network that tries a device"
        );
        match runtime.clone().on(Device::Cuda) {
            Ok(card) => assert_ne!(card.kind(), kind),
            Err(RuntimeError::OtherDevices { library, .. }) => assert_eq!(library, runtime.library()),
            Err(error) => assert!(matches!(error, RuntimeError::DeviceUnusable { .. }), "{error}"),
        }
    }
}
